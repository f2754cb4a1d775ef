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


def test_infos(env_id):
    """`auto_register_info_dict`: infos in the tensordicts, with and without drawn parameters."""
    for settings in ({}, {"randomize": {"friction": (0.2, 0.8)}}):
        if settings and gym.make(env_id).unwrapped.settings.solver == "paper":
            continue  # nothing can be drawn
        env = GymEnv(env_id, episode_seconds=0.1, device="cpu", **settings).auto_register_info_dict()
        steps = env.rollout(20, break_when_any_done=False)
        assert steps["next", "done"].any()
        assert steps["next", "reward_peak"].dtype == torch.float64
        assert steps["next", "measured"].shape[1] == len(env.reset()["measured"])
        assert ("parameters" in steps) == bool(settings)


FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0, "episode_seconds": 2.0}


@pytest.mark.parametrize("settings", [{"episode_seconds": 0.1}, FALLS], ids=["truncated", "failed"])
def test_many_of_its_own(env_id, settings):
    """`GymEnv(id, num_envs=2)` over the ends of episodes, infos included."""
    if settings is FALLS and gym.make(env_id).unwrapped.settings.trunk != "suspended":
        pytest.skip("nothing falls")
    env = GymEnv(f"hoof_env:{env_id}", num_envs=2, device="cpu", **settings)  # for workers that are new
    steps = env.rollout(300, break_when_any_done=False)
    assert steps["next", "terminated" if settings is FALLS else "truncated"].sum() >= 2
    assert torch.isfinite(steps["measured"]).all()
    assert steps["gait"].shape == (2, 300, 4)
    env.close()


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
    many = {"num_envs": 4, "vectorization_mode": "vector_entry_point", "autoreset_mode": mode}
    check_env_specs(GymWrapper(gym.make_vec(env_id, **many), device="cpu"), seed=0)
    if mode == gym.vector.AutoresetMode.SAME_STEP:
        envs = GymWrapper(gym.make_vec(env_id, **many, episode_seconds=0.1), device="cpu")
        assert envs.rollout(20, break_when_any_done=False)["next", "done"].sum() >= 12


def test_collector(env_id):
    """`Collector`: 200 random steps over the ends of episodes."""
    env = GymWrapper(gym.make(env_id, episode_seconds=0.2), device="cpu")
    collector = Collector(env, RandomPolicy(env.action_spec), frames_per_batch=100, total_frames=200)
    batches = list(collector)
    assert sum(batch.numel() for batch in batches) == 200
    assert batches[0]["next", "done"].any()
    collector.shutdown()
