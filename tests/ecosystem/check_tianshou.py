"""Tianshou 2: its vector environments, collectors and trainers, on every id."""

from __future__ import annotations

from functools import partial

import gymnasium as gym
import numpy as np
import pytest
import torch
from alone import alone
from tianshou.algorithm import PPO, SAC
from tianshou.algorithm.algorithm_base import RandomActionPolicy
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.modelfree.sac import SACPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, SubprocVectorEnv
from tianshou.trainer import OffPolicyTrainerParams, OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic
from torch.distributions import Independent, Normal

torch.set_num_threads(1)

SECONDS = 0.2
"""Of an episode: ten steps."""


def test_collector(env_id):
    """`Collector` of a `DummyVectorEnv` over the ends of episodes: the environment's own data."""
    assert_collects(DummyVectorEnv, env_id)


def test_spawned_workers():
    """`Collector` of a `SubprocVectorEnv`, spawned, `hoof_env:` before the id, likewise; HorseLeg-v0."""
    assert_collects(partial(SubprocVectorEnv, context="spawn"), "hoof_env:hoof_env/HorseLeg-v0")


def assert_collects(vectorize, env_id):
    """Random steps of two environments are those that each takes alone."""
    make = partial(gym.make, env_id, episode_seconds=SECONDS)
    envs = vectorize([make, make])
    try:
        buffer = VectorReplayBuffer(100, 2)
        collector = Collector(RandomActionPolicy(make().action_space), envs, buffer)
        collector.reset(gym_reset_kwargs={"seed": 3})
        stats = collector.collect(n_step=50, random=True)
        assert stats.n_collected_steps == 50
        assert stats.n_collected_episodes >= 4
    finally:
        envs.close()
    for row in buffer.buffers:
        assert_plays_again(make(), row[:])


def assert_plays_again(env, batch):
    """What a buffer holds is what the environment does with its actions."""
    for step, (observation, following, reward, *ended) in enumerate(alone(env, batch.act, seed=3)):
        np.testing.assert_array_equal(batch.obs[step], observation)
        np.testing.assert_array_equal(batch.obs_next[step], following)
        assert batch.rew[step] == reward
        assert [batch.terminated[step], batch.truncated[step]] == ended


def actor(env):
    """A Gaussian policy's network."""
    net = Net(state_shape=env.observation_space.shape, hidden_sizes=[16])
    return ContinuousActorProbabilistic(
        preprocess_net=net, action_shape=env.action_space.shape, unbounded=True
    )


def ppo(env):
    """The algorithm, and the parameters of its trainer."""
    critic = ContinuousCritic(preprocess_net=Net(state_shape=env.observation_space.shape, hidden_sizes=[16]))
    policy = ProbabilisticActorPolicy(
        actor=actor(env),
        dist_fn=lambda parameters: Independent(Normal(*parameters), 1),
        action_space=env.action_space,
    )
    algorithm = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3))
    return algorithm, partial(OnPolicyTrainerParams, update_step_num_repetitions=2)


def sac(env):
    """The same of SAC."""
    net = Net(
        state_shape=env.observation_space.shape,
        action_shape=env.action_space.shape,
        hidden_sizes=[16],
        concat=True,
    )
    algorithm = SAC(
        policy=SACPolicy(actor=actor(env), action_space=env.action_space),
        policy_optim=AdamOptimizerFactory(lr=1e-3),
        critic=ContinuousCritic(preprocess_net=net),
        critic_optim=AdamOptimizerFactory(lr=1e-3),
    )
    return algorithm, partial(OffPolicyTrainerParams, update_step_num_gradient_steps_per_sample=0.5)


@pytest.mark.parametrize("make", [ppo, sac], ids=["PPO", "SAC"])
def test_learn(env_id, make):
    """PPO and SAC: two epochs of 128 steps in two environments, an episode of test after each."""
    algorithm, parameters = make(gym.make(env_id))
    before = [parameter.clone() for parameter in algorithm.policy.parameters()]
    envs, tests = (
        DummyVectorEnv([partial(gym.make, env_id, episode_seconds=SECONDS)] * count) for count in (2, 1)
    )
    envs.seed(0)
    tests.seed(9)
    result = algorithm.run_training(
        parameters(
            training_collector=Collector(algorithm, envs, VectorReplayBuffer(256, 2)),
            test_collector=Collector(algorithm, tests),
            max_epochs=2,
            epoch_num_steps=128,
            collection_step_num_env_steps=64,
            batch_size=32,
            show_progress=False,
        )
    )
    assert result.train_step == 256
    assert result.train_episode >= 24  # none is longer than ten steps
    assert result.test_episode >= 2
    assert np.isfinite(result.best_reward)
    after = list(algorithm.policy.parameters())
    assert any(not torch.equal(*pair) for pair in zip(before, after, strict=True))
    assert all(torch.isfinite(parameter).all() for parameter in after)
