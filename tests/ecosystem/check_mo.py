"""MO-Gymnasium: its `make` and its wrappers, on every id with a vector reward."""

from __future__ import annotations

import gymnasium as gym
import mo_gymnasium
import numpy as np
import pytest
from mo_gymnasium import wrappers

import hoof_env


def play(env, steps=None):
    """Rewards of random actions to the end of an episode or for `steps`, and the last info."""
    env.reset(seed=0)
    env.action_space.seed(0)
    rewards, ended = [], False
    while not ended:
        _, reward, terminated, truncated, info = env.step(env.action_space.sample())
        rewards.append(reward)
        ended = terminated or truncated or len(rewards) == steps
    return np.array(rewards), info


def test_make(mo_id):
    """`mo_gymnasium.make`: a reward within `reward_space` in every step."""
    env = mo_gymnasium.make(mo_id)
    rewards, _ = play(env)
    assert rewards.shape[1:] == env.unwrapped.reward_space.shape == (3,)
    assert all(reward in env.unwrapped.reward_space for reward in rewards)
    assert (np.ptp(rewards, axis=0) > 0).all()


def test_linear_reward(mo_id):
    """`LinearReward`: the weighted sum."""
    weight = np.array([0.5, 0.2, 0.3])
    vector, _ = play(mo_gymnasium.make(mo_id), steps=50)
    scalar, info = play(wrappers.LinearReward(mo_gymnasium.make(mo_id), weight=weight), steps=50)
    np.testing.assert_allclose(scalar, vector @ weight, rtol=1e-6)
    np.testing.assert_array_equal(info["vector_reward"], vector[-1])


def test_statistics(mo_id):
    """`MORecordEpisodeStatistics`: the return of each objective."""
    rewards, info = play(wrappers.MORecordEpisodeStatistics(mo_gymnasium.make(mo_id)))
    np.testing.assert_allclose(info["episode"]["r"], rewards.sum(axis=0), rtol=1e-4)


def test_normalise_and_clip(mo_id):
    """`MONormalizeReward`, `MOClipReward` and `MOMaxAndSkipObservation`."""
    env = wrappers.MOMaxAndSkipObservation(mo_gymnasium.make(mo_id), skip=2)
    for objective in range(3):
        env = wrappers.MOClipReward(wrappers.MONormalizeReward(env, idx=objective), objective, -1.0, 1.0)
    rewards, _ = play(env, steps=50)
    assert np.abs(rewards).max() <= 1.0


def test_vector(mo_id):
    """`MOSyncVectorEnv` and its `MORecordEpisodeStatistics`."""
    envs = wrappers.vector.MOSyncVectorEnv([lambda: mo_gymnasium.make(mo_id, episode_seconds=0.2)] * 2)
    envs = wrappers.vector.MORecordEpisodeStatistics(envs)
    envs.reset(seed=0)
    total = np.zeros((2, 3))
    for _ in range(10):
        _, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
        total += rewards
        if (terminated | truncated).any():
            break
    assert rewards.shape == (2, 3)
    assert infos["episode"]["r"] == pytest.approx(total * (terminated | truncated)[:, None], rel=1e-4)


def test_native(mo_id):
    """`make_vec` beside `MOSyncVectorEnv`, over ends of episodes: the same bits, spaces and dtypes."""
    short = {"episode_seconds": 0.1}
    theirs = wrappers.vector.MOSyncVectorEnv([lambda: mo_gymnasium.make(mo_id, **short)] * 3)
    ours = gym.make_vec(mo_id, num_envs=3, **short)
    assert ours.unwrapped.reward_space == theirs.reward_space
    for envs in ours, theirs:
        envs.reset(seed=1)
        envs.action_space.seed(0)
    ends = 0
    for _ in range(20):
        action = ours.action_space.sample()
        for found, expected in zip(ours.step(action)[:4], theirs.step(action)[:4], strict=True):
            assert found.dtype == expected.dtype
            np.testing.assert_array_equal(found, expected)
        ends += found.sum()
    assert ends == 9


def test_native_statistics(mo_id):
    """The vector `MORecordEpisodeStatistics` on `make_vec`: the return of each objective."""
    envs = wrappers.vector.MORecordEpisodeStatistics(gym.make_vec(mo_id, num_envs=2, episode_seconds=0.1))
    envs.reset(seed=0)
    totals = []
    for _ in range(5):
        *_, infos = stepped = envs.step(envs.action_space.sample())
        totals.append(stepped[1])
    assert infos["_episode"].all()
    np.testing.assert_allclose(infos["episode"]["r"], np.sum(totals, axis=0), rtol=1e-6)


def test_own_linear_reward(mo_id):
    """`LinearReward` of this package, single and vector, beside theirs."""
    weight = np.array([0.5, 0.2, 0.3])
    expected, info = play(wrappers.LinearReward(mo_gymnasium.make(mo_id), weight=weight), steps=50)
    found, info_too = play(hoof_env.LinearReward(mo_gymnasium.make(mo_id), weight=weight), steps=50)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_array_equal(info["vector_reward"], info_too["vector_reward"])
    envs = wrappers.vector.MOSyncVectorEnv([lambda: mo_gymnasium.make(mo_id)] * 2)
    envs = hoof_env.VectorLinearReward(envs, weight)
    envs.reset(seed=0)
    _, rewards, _, _, infos = envs.step(envs.action_space.sample())
    np.testing.assert_allclose(rewards, infos["vector_reward"] @ weight, rtol=1e-6)


def test_picture(mo_id):
    """`render`, drawn by pygame, which differs from pygame-ce: letters have gaps between them.

    MO-Gymnasium brings it; the word is "time"."""
    env = mo_gymnasium.make(mo_id, render_mode="rgb_array")
    env.reset(seed=0)
    word = env.render()[28:52, 654:700]
    inked = (word < 200).all(axis=2).any(axis=0).astype(int)
    assert (np.diff(inked, prepend=0, append=0) > 0).sum() == 4
    env.close()
