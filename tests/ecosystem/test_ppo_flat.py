"""The flat PPO of agents/, on every id."""

from __future__ import annotations

import numpy as np
import pytest
from alone import skip_unless_native

from agents.ppo_flat import Args, learn


@pytest.mark.parametrize("vectorization", ["sync", "vector_entry_point"])
def test_learn(env_id, vectorization):
    """`agents/ppo_flat.py`, 1024 steps, sync and native."""
    if vectorization == "vector_entry_point":
        skip_unless_native(env_id)
    small = {"steps": 1024, "n_envs": 8, "n_steps": 64, "env_kwargs": ("episode_seconds=0.4",)}
    learned = learn(Args(env_id=env_id, vectorization=vectorization, **small))
    assert learned.progress[-1]["steps"] == 1024
    assert learned.progress[-1]["episodes"] >= 8
    assert np.isfinite(learned.progress[-1]["episodic_return"])
