"""Trained policies in files, and how any policy is found: shipped, saved, scripted, or a function."""
