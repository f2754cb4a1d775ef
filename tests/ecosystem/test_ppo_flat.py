"""The flat PPO of agents/, on every id."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from agents.ppo_flat import Args, learn


@pytest.mark.parametrize("vectorization", ["sync", "vector_entry_point"])
def test_learn(env_id, vectorization):
    """`agents/ppo_flat.py`, 1024 steps, sync and native."""
    if vectorization == "vector_entry_point" and gym.spec(env_id).vector_entry_point is None:
        pytest.skip("no native vector environment")
    learned = learn(
        Args(
            env_id=env_id,
            vectorization=vectorization,
            steps=1024,
            n_envs=8,
            n_steps=64,
            env_kwargs=("episode_seconds=0.4",),
        )
    )
    assert learned.progress[-1]["steps"] == 1024
    assert learned.progress[-1]["episodes"] >= 8
    assert np.isfinite(learned.progress[-1]["episodic_return"])
