"""Scores of policies: episodes, statistics over them, and tables."""
