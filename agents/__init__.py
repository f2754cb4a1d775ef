"""Training, evaluation and the demonstration, run from a checkout (`python -m agents.train`)."""

import os

# Before torch is imported: one thread unless more are asked for, and threads that sleep while they wait. By
# default they spin, which on cores that others use too takes ten times as long or more (docs/decisions.md).
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
