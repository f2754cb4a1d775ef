"""The flat PPO of agents/ as an algorithm of Stable-Baselines3, on every id."""

from __future__ import annotations

import pytest
from alone import learns, skip_unless_native, torch_parameters
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecMonitor

from agents.ppo_flat import FlatPPO
from hoof_env import Sb3VecEnv


@pytest.mark.parametrize("native", [False, True], ids=["one by one", "native"])
def test_learn(env_id, native, tmp_path):
    """`agents/ppo_flat.py`: `learn` (256 steps), `save`, `load`, `evaluate_policy`, one by one and native."""
    short = {"episode_seconds": 0.4}
    if native:
        skip_unless_native(env_id)
    envs = VecMonitor(Sb3VecEnv(env_id, 2, **short)) if native else make_vec_env(env_id, 2, env_kwargs=short)
    settings = {"n_steps": 64, "batch_size": 64, "n_epochs": 2, "policy_kwargs": {"net_arch": [16]}}
    learns(FlatPPO("MlpPolicy", envs, seed=0, **settings), envs, tmp_path, torch_parameters)
