"""The pony's own tests, in an environment that knows hoof-env from its wheel alone."""

from __future__ import annotations

import warnings
from pathlib import Path

import gymnasium as gym
import hoof_pony
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy

import hoof_env

ID = "hoof_pony/OnTime-v0"


def test_comes_from_wheels():
    """Neither package lies in a checkout."""
    for package in hoof_env, hoof_pony:
        assert "site-packages" in Path(package.__file__).parts


def test_check_env():
    """`check_env` of the task, warnings as errors, but that a wrapper of its own is in place."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*different from the unwrapped version.*")
        check_env(gym.make(ID, disable_env_checker=True), skip_render_check=True)


def test_other_leg_and_other_reward():
    """Another geometry, another mass, another reward than `HorseLeg-v0`'s."""
    pony, horse = gym.make(ID), gym.make("hoof_env/HorseLeg-v0")
    assert pony.unwrapped.geometry.hip_height == pytest.approx(
        0.7 * horse.unwrapped.geometry.hip_height, abs=1e-6
    )
    assert pony.unwrapped.weight < horse.unwrapped.weight
    pony.reset(seed=0)
    _, reward, *_, info = pony.step(pony.action_space.sample())
    terms = sum(value for name, value in info.items() if name.startswith("reward_"))
    assert reward == pytest.approx(terms - info["reward_progress"])


def test_train(tmp_path):
    """Stable-Baselines3's PPO on the task: `learn` (4096 steps), `save`, `load`, `evaluate_policy`."""
    envs = make_vec_env(ID, n_envs=8, seed=0, env_kwargs={"episode_seconds": 2.0})
    model = PPO("MlpPolicy", envs, n_steps=128, batch_size=256, n_epochs=4, seed=0, device="cpu").learn(4096)
    model.save(tmp_path / "pony")
    mean, _ = evaluate_policy(PPO.load(tmp_path / "pony", device="cpu"), envs, n_eval_episodes=4)
    assert -50 < mean < 10
