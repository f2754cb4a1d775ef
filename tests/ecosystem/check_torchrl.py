"""TorchRL: its two ways to take a Gymnasium environment, and its check of specifications, on every id."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
import torch
from alone import alone, skip_unless_native
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, GymWrapper, check_env_specs
from torchrl.envs.utils import RandomPolicy

torch.set_num_threads(1)

SHORT = {"episode_seconds": 0.2}
"""Episodes of ten steps."""


def test_gym_env(env_id):
    """`GymEnv` and `check_env_specs`."""
    check_env_specs(GymEnv(env_id, device="cpu"), seed=0)


def test_gym_env_of_several(env_id):
    """`GymEnv` with `num_envs=2`, spawned, `hoof_env:` before the id: the environment's own data."""
    env = GymEnv(f"hoof_env:{env_id}", num_envs=2, device="cpu", **SHORT)
    try:
        check_env_specs(env)
        steps = rollout(env)
    finally:
        env.close()
    # Of Gymnasium's own environments, too, TorchRL loses the last observations in such a one
    assert_plays_again(env_id, steps, last=torch.zeros_like)


def rollout(env):
    """Random steps over the ends of episodes."""
    return env.rollout(25, auto_reset=False, tensordict=env.reset(seed=3), break_when_any_done=False)


def assert_plays_again(env_id, steps, last=lambda observation: observation, episodes=2):
    """What a rollout holds is what the environment does, a last observation what `last` makes of it."""
    for row, played in enumerate(steps.unbind(0)):
        env, ends = gym.make(env_id, **SHORT), 0
        told = alone(env, played["action"].numpy(), seed=3 + row)
        for step, (observation, following, reward, terminated, truncated) in zip(
            played.unbind(0), told, strict=True
        ):
            ended = terminated or truncated
            np.testing.assert_array_equal(step["observation"], observation)
            assert step["next", "reward"].item() == np.float32(reward)
            assert step["next", "done"].item() == ended
            wanted = last(torch.tensor(following)) if ended else following
            np.testing.assert_array_equal(step["next", "observation"], wanted)
            ends += ended
            if ends == episodes:
                break
        assert ends == episodes


@pytest.mark.parametrize("drawn", [{}, {"randomize": {"friction": (0.2, 0.8)}}], ids=["same", "drawn"])
def test_infos(env_id, drawn):
    """`auto_register_info_dict`: every number of `infos` in a rollout, with and without drawn parameters."""
    if drawn and gym.make(env_id).unwrapped.settings.solver == "paper":
        pytest.skip("nothing can be drawn")
    env = GymEnv(env_id, device="cpu", **SHORT, **drawn).auto_register_info_dict()
    check_env_specs(env, seed=0)
    steps = env.rollout(25, break_when_any_done=False)
    told = steps["next"]
    assert told["done"].sum() >= 2
    terms = [term for key, term in told.items() if key.startswith("reward_")]
    assert terms
    torch.testing.assert_close(sum(terms).squeeze(), told["reward"].double().squeeze(), rtol=0, atol=1e-6)
    assert told["measured"].shape[1] == len(env.reset()["measured"])
    assert ("parameters" in steps) == bool(drawn)


FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0, "episode_seconds": 4.0}


def test_falls_of_several(env_id):
    """`GymEnv(id, num_envs=2)` over the ends of episodes that fail, infos included."""
    if gym.make(env_id).unwrapped.settings.trunk != "suspended":
        pytest.skip("nothing falls")
    torch.manual_seed(0)
    env = GymEnv(f"hoof_env:{env_id}", num_envs=2, device="cpu", **FALLS)
    env.set_seed(0)
    steps = env.rollout(600, break_when_any_done=False)
    assert steps["next", "terminated"].sum() >= 2
    assert torch.isfinite(steps["measured"]).all()
    assert steps["gait"].shape == (2, 600, 4)
    env.close()


@pytest.mark.parametrize("mode", ["same_step", "disabled"])
def test_native_vector(env_id, mode):
    """`GymWrapper` of the native vector environment, restarting on the same step or not: its own data."""
    skip_unless_native(env_id)
    settings = {"vectorization_mode": "vector_entry_point", "autoreset_mode": mode.upper(), **SHORT}
    env = GymWrapper(gym.make_vec(env_id, num_envs=4, **settings), device="cpu")
    check_env_specs(env, seed=0)
    # One that has restarted by itself TorchRL restarts again, which skips a start
    assert_plays_again(env_id, rollout(env), episodes=1 if mode == "same_step" else 2)


def test_collector(env_id):
    """`GymWrapper`, `check_env_specs` and `Collector`: 200 random steps over the ends of episodes."""
    env = GymWrapper(gym.make(env_id, **SHORT), device="cpu")
    check_env_specs(env, seed=0)
    collector = Collector(env, RandomPolicy(env.action_spec), frames_per_batch=100, total_frames=200)
    batches = list(collector)
    assert sum(batch.numel() for batch in batches) == 200
    assert batches[0]["next", "done"].any()
    assert torch.isfinite(batches[0]["next", "reward"]).all()
    collector.shutdown()
