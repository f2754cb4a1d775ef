"""Trainings by plan: stock learners, the table of baselines, and trainers of PPO compared.

A plan is a file of `agents/plans`. Its trainings run side by side, each in a process of its own and each
resumable, and their results make the plan's page.
"""
