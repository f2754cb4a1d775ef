"""Training, evaluation and the demonstration. Run from a checkout (`python -m agents.train`); not in the wheel."""
