"""SBX, Stable-Baselines3's algorithms in JAX, on every id."""

from __future__ import annotations

import gymnasium as gym
import jax
import numpy as np
import pytest
from alone import alone, learns, skip_unless_native
from sbx import PPO, SAC
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecMonitor

from hoof_env import Sb3VecEnv

jax.config.update("jax_platforms", "cpu")

SECONDS = 0.4
CASES = {
    PPO: {"n_steps": 64, "batch_size": 64, "n_epochs": 2},
    SAC: {"learning_starts": 100, "batch_size": 32, "buffer_size": 1000},
}


@pytest.fixture(params=["dummy", "native"])
def envs(request, env_id):
    """Two environments as Stable-Baselines3's `make_vec_env` makes them, or `Sb3VecEnv`."""
    if request.param == "dummy":
        return make_vec_env(env_id, n_envs=2, env_kwargs={"episode_seconds": SECONDS})
    skip_unless_native(env_id)
    return VecMonitor(Sb3VecEnv(env_id, num_envs=2, episode_seconds=SECONDS))


@pytest.mark.parametrize("algorithm", list(CASES), ids=lambda algorithm: algorithm.__name__)
def test_learn(env_id, envs, algorithm, tmp_path):
    """PPO and SAC: `learn` (256 steps), `save`, `load`, `evaluate_policy`; also on `Sb3VecEnv`."""
    model = algorithm("MlpPolicy", envs, seed=5, policy_kwargs={"net_arch": [16]}, **CASES[algorithm])
    learns(model, envs, tmp_path, lambda model: jax.tree.leaves(model.policy.actor_state.params))
    if algorithm is SAC:
        assert_plays_again(env_id, model)


def assert_plays_again(env_id, model):
    """What the replay buffer holds is what the environment does, the last observations of episodes too."""
    buffer = model.replay_buffer
    for row in range(2):
        actions = model.policy.unscale_action(buffer.actions[: buffer.pos, row])
        played = alone(gym.make(env_id, episode_seconds=SECONDS), actions, seed=5 + row)
        for step, (observation, following, reward, terminated, truncated) in enumerate(played):
            np.testing.assert_array_equal(buffer.observations[step, row], observation)
            np.testing.assert_array_equal(buffer.next_observations[step, row], following)
            assert buffer.rewards[step, row] == np.float32(reward)
            assert buffer.dones[step, row] == (terminated or truncated)
            assert buffer.timeouts[step, row] == (truncated and not terminated)
