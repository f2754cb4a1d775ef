"""Gymnasium's own checks, vector environments and wrappers, on every id."""

from __future__ import annotations

import warnings
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from alone import assert_filmed, skip_unless_native
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordVideo, vector

SHORT = 0.2
"""Seconds of an episode: ten steps."""


@pytest.fixture(params=["sync", "async", "native"])
def envs(request, env_id):
    """Two environments side by side, ten steps an episode, warnings as errors."""
    mode = "vector_entry_point" if request.param == "native" else request.param
    if request.param == "native":
        skip_unless_native(env_id)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)  # torch's
        envs = gym.make_vec(env_id, num_envs=2, vectorization_mode=mode, episode_seconds=SHORT)
    yield envs
    envs.close()


def rollout(envs, steps=25):
    """Observations (steps + 1, 2, n), rewards and flags (steps, 2), and infos of random actions."""
    envs.action_space.seed(0)
    observations, rewards, terminated, truncated, infos = [envs.reset(seed=0)[0]], [], [], [], []
    for _ in range(steps):
        observation, *others, info = envs.step(envs.action_space.sample())
        observations.append(observation)
        for history, value in zip((rewards, terminated, truncated), others, strict=True):
            history.append(value)
        infos.append(info)
    return np.array(observations), np.array(rewards), np.array(terminated), np.array(truncated), infos


def test_check_env(env_id):
    """`check_env`, warnings as errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(env_id).unwrapped)


def test_make(env_id):
    """`make`, from its JSON spec too, with the passive checker's warnings as errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for made in (
            gym.make(env_id),
            gym.make(gym.envs.registration.EnvSpec.from_json(gym.spec(env_id).to_json())),
        ):
            observation, _ = made.reset(seed=0)
            for _ in range(20):
                observation, reward, terminated, *_ = made.step(made.action_space.sample())
                assert observation in made.observation_space
                assert np.isfinite(reward)
                if terminated:
                    break


def test_make_vec(envs):
    """`make_vec`: sync, async and native, restarting by themselves."""
    observations, rewards, terminated, truncated, _ = rollout(envs)
    ended = terminated | truncated
    assert observations[0] in envs.observation_space
    assert np.isfinite(rewards).all()
    assert ended.any(axis=0).all()
    assert (rewards[1:][ended[:-1]] == 0).all()  # the step that restarts


def test_spawned_workers(env_id):
    """Spawned workers that import nothing, `hoof_env:` before the id."""
    make = partial(gym.make, f"hoof_env:{env_id}", episode_seconds=SHORT)
    envs = gym.vector.AsyncVectorEnv([make], context="spawn")
    try:
        observations, rewards, *_ = rollout(envs, steps=12)
        here = gym.make(env_id, episode_seconds=SHORT)
        np.testing.assert_array_equal(here.reset(seed=0)[0], observations[0, 0])
        assert np.isfinite(rewards).all()
    finally:
        envs.close()


def test_record_video(env_id, tmp_path):
    """`RecordVideo` of an episode: its frames, not all alike."""
    pytest.importorskip("moviepy", reason='pip install "hoof-env[record]"')
    env = gym.make(env_id, render_mode="rgb_array", episode_seconds=SHORT)
    env = RecordVideo(env, str(tmp_path / "videos"))
    env.reset(seed=0)
    env.action_space.seed(0)
    while not any(env.step(env.action_space.sample())[2:4]):
        pass
    env.close()
    assert_filmed(tmp_path / "videos")


def test_record_episode_statistics(envs):
    """`RecordEpisodeStatistics` of a vector environment."""
    wrapped = vector.RecordEpisodeStatistics(envs)
    _, rewards, terminated, truncated, infos = rollout(wrapped)
    first = np.argmax((terminated | truncated)[:, 0])
    assert infos[first]["episode"]["r"][0] == pytest.approx(rewards[: first + 1, 0].sum(), rel=1e-5)
    assert wrapped.episode_count >= 2


def test_normalize_observation(envs):
    """`NormalizeObservation` of a vector environment."""
    observations, *_ = rollout(vector.NormalizeObservation(envs), steps=100)
    assert np.isfinite(observations).all()
    assert np.abs(observations.mean()) < 1
