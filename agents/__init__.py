"""Training, evaluation and the demonstration, run from a checkout (`python -m agents.train`)."""
