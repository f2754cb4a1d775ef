"""sb3-contrib: TQC and the recurrent PPO, and Stable-Baselines3's own worker processes, on every id."""

from __future__ import annotations

import pytest
import torch
from alone import learns, torch_parameters
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv, VecNormalize

torch.set_num_threads(1)

CASES = {
    TQC: ("MlpPolicy", {"learning_starts": 100, "batch_size": 32, "policy_kwargs": {"net_arch": [16]}}),
    RecurrentPPO: ("MlpLstmPolicy", {"n_steps": 64, "n_epochs": 2, "policy_kwargs": {"lstm_hidden_size": 8}}),
}


@pytest.mark.parametrize("algorithm", list(CASES), ids=lambda algorithm: algorithm.__name__)
def test_learn(env_id, algorithm, tmp_path):
    """TQC and RecurrentPPO: `learn` (256 steps), `save`, `load`, `evaluate_policy`."""
    policy, settings = CASES[algorithm]
    envs = make_vec_env(env_id, n_envs=2, seed=0, env_kwargs={"episode_seconds": 0.4})
    learns(algorithm(policy, envs, seed=0, device="cpu", **settings), envs, tmp_path, torch_parameters)


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_worker_processes(env_id, method):
    """`SubprocVecEnv`, spawned and from a fork server, `hoof_env:` before the id; PPO on it."""
    processes = {"vec_env_cls": SubprocVecEnv, "vec_env_kwargs": {"start_method": method}}
    envs = make_vec_env(
        f"hoof_env:{env_id}", n_envs=2, seed=0, env_kwargs={"episode_seconds": 0.4}, **processes
    )
    try:
        short = {"n_steps": 32, "batch_size": 32, "n_epochs": 1}
        model = PPO("MlpPolicy", VecNormalize(envs), device="cpu", **short).learn(64)
        assert all(torch.isfinite(parameter).all() for parameter in model.policy.parameters())
    finally:
        envs.close()
