"""Stable-Baselines3: its checker and three algorithms, on every id."""

from __future__ import annotations

import warnings

import gymnasium as gym
import pytest
import torch
from alone import learns, torch_parameters
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env

SMALL = {
    PPO: {"n_steps": 64, "batch_size": 64, "n_epochs": 2},
    SAC: {"learning_starts": 100, "batch_size": 32},
    TD3: {"learning_starts": 100, "batch_size": 32},
}


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def test_check_env(env_id):
    """`check_env`, warnings as errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(env_id))


@pytest.mark.parametrize("algorithm", list(SMALL), ids=lambda algorithm: algorithm.__name__)
def test_learn(env_id, algorithm, tmp_path):
    """PPO, SAC and TD3: `learn` (256 steps), `save`, `load`, `evaluate_policy`."""
    envs = make_vec_env(env_id, n_envs=2, seed=0, env_kwargs={"episode_seconds": 0.4})
    model = algorithm(
        "MlpPolicy", envs, seed=0, policy_kwargs={"net_arch": [16]}, device="cpu", **SMALL[algorithm]
    )
    learns(model, envs, tmp_path, torch_parameters)
