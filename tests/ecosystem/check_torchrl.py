"""TorchRL: its two ways to take a Gymnasium environment, and its check of specifications, on every id."""

from __future__ import annotations

import gymnasium as gym
import pytest
import torch
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, GymWrapper, check_env_specs
from torchrl.envs.utils import RandomPolicy

torch.set_num_threads(1)


def test_gym_env(env_id):
    """`GymEnv` and `check_env_specs`."""
    check_env_specs(GymEnv(env_id, device="cpu"), seed=0)


def test_gym_wrapper(env_id):
    """`GymWrapper`, `check_env_specs` and a rollout."""
    env = GymWrapper(gym.make(env_id, episode_seconds=0.2), device="cpu")
    check_env_specs(env, seed=0)
    steps = env.rollout(50)
    assert len(steps) <= 10
    assert steps["next", "done"][-1].item()
    assert torch.isfinite(steps["next", "reward"]).all()


@pytest.mark.parametrize("mode", ["same_step", "disabled"])
def test_native_vector(env_id, mode):
    """`GymWrapper` of the native vector environment, restarting on the same step or not at all."""
    if gym.spec(env_id).vector_entry_point is None:
        pytest.skip("no native vector environment")
    mode = gym.vector.AutoresetMode[mode.upper()]
    envs = gym.make_vec(env_id, num_envs=4, vectorization_mode="vector_entry_point", autoreset_mode=mode)
    check_env_specs(GymWrapper(envs, device="cpu"), seed=0)


def test_collector(env_id):
    """`Collector`: 200 random steps over the ends of episodes."""
    env = GymWrapper(gym.make(env_id, episode_seconds=0.2), device="cpu")
    collector = Collector(env, RandomPolicy(env.action_spec), frames_per_batch=100, total_frames=200)
    batches = list(collector)
    assert sum(batch.numel() for batch in batches) == 200
    assert batches[0]["next", "done"].any()
    collector.shutdown()
