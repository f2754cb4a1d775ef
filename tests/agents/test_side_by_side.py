"""Learners side by side: an update and a rollout as Stable-Baselines3's, and each learner on its own."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import CallbackList
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import DummyVecEnv

from agents.side_by_side import DEFAULTS, Learners, Player, Rollout, advantages_of, train
from hoof_env.errors import ParameterError
from hoof_env.evaluation.episodes import make_rows

RAIL = "hoof_env/HorseLegRail-v0"
STEPS = 128
ONE_BATCH = replace(DEFAULTS, n_steps=STEPS, batch_size=STEPS, n_epochs=3)


def peer(steps, batch):
    """Return Stable-Baselines3's PPO after a rollout."""
    envs = DummyVecEnv([lambda: gym.make(RAIL, episode_seconds=1.0)])
    model = PPO("MlpPolicy", envs, n_steps=steps, batch_size=batch, n_epochs=3, seed=0, device="cpu")
    model.set_logger(configure(None, []))
    model._setup_learn(steps)
    model.collect_rollouts(model.env, _silent(model), model.rollout_buffer, steps)
    return model


def _silent(model):
    """Return a callback that does nothing."""
    callback = CallbackList([])
    callback.init_callback(model)
    return callback


def weights_of(model):
    """Return its weights in the order of `Learners.weights`, each of shape (1, fan in, fan out)."""
    policy = model.policy
    layers = [*policy.mlp_extractor.policy_net[::2], policy.action_net]
    layers += [*policy.mlp_extractor.value_net[::2], policy.value_net]
    both = [part for layer in layers for part in (layer.weight.detach().T, layer.bias.detach()[None])]
    return [part.clone()[None] for part in (*both, policy.log_std.detach()[None])]


def with_weights(model, n=1):
    """Return n learners that all have the weights of Stable-Baselines3's model."""
    seen = model.observation_space.shape[0]
    learners = Learners([0] * n, seen, model.action_space.shape[0], ONE_BATCH)
    with torch.no_grad():
        for own, its in zip(learners.weights, weights_of(model), strict=True):
            assert own.shape[1:] == its.shape[1:]
            own.copy_(its.expand_as(own))
    return learners


def rollout_of(model):
    buffer = model.rollout_buffer
    actions = buffer.actions.reshape(STEPS, 1, -1)
    return Rollout(buffer.observations, actions, buffer.log_probs, buffer.advantages, buffer.returns)


def test_an_update_is_that_of_stable_baselines3():
    model = peer(STEPS, STEPS)
    learners = with_weights(model)
    before = weights_of(model)
    rollout = rollout_of(model)
    model.train()
    learners.improve(rollout, np.random.default_rng(0))
    for own, its, old in zip(learners.weights, weights_of(model), before, strict=True):
        assert torch.allclose(own.detach(), its, atol=2e-6)
        assert not torch.allclose(its, old, atol=1e-4)  # the update is larger than that by far


def test_advantages_are_those_of_stable_baselines3():
    buffer = peer(STEPS, STEPS).rollout_buffer
    # Where an episode began anew, the step before it had ended one
    begins = np.concatenate([buffer.episode_starts[1:], [[0.0]]]).astype(bool)
    assert begins.sum() == 2
    last = buffer.returns[-1] - buffer.rewards[-1]
    values = np.concatenate([buffer.values, last[None] / DEFAULTS.gamma])
    own = advantages_of(buffer.rewards, values, begins, DEFAULTS.gamma, DEFAULTS.gae_lambda)
    assert np.allclose(own, buffer.advantages, atol=1e-5)


def test_a_rollout_has_the_densities_and_values_of_its_learners():
    envs = make_rows(RAIL, 2, episode_seconds=1.0, autoreset_mode="SAME_STEP")
    learners = Learners([0, 1], envs.single_observation_space.shape[0], 4, replace(DEFAULTS, n_steps=120))
    rollout = Player(learners, envs, [3, 4], np.random.default_rng(0)).roll()
    seen = torch.from_numpy(rollout.observations.swapaxes(0, 1).copy())
    normal = torch.distributions.Normal(learners.means(seen), learners.weights[-1].exp())
    taken = torch.from_numpy(rollout.actions.swapaxes(0, 1).copy())
    expected = normal.log_prob(taken).sum(-1).detach().numpy().T
    assert np.allclose(rollout.log_probs, expected, atol=1e-4)
    values = learners.values(seen).detach().numpy().T
    assert np.allclose(rollout.returns - rollout.advantages, values, atol=1e-4)


def test_learners_do_not_know_each_other():
    """What one sees and earns changes no other one."""
    random = np.random.default_rng(0)
    shape = (STEPS, 2)
    parts = [random.standard_normal((*shape, 5)), random.standard_normal((*shape, 3))]
    parts += [random.standard_normal(shape) for _ in range(3)]
    parts = [part.astype(np.float32) for part in parts]
    other = [part.copy() for part in parts]
    for part in other:
        part[:, 1] = 7.0 * part[::-1, 1]
    found = []
    for each in (parts, other):
        learners = Learners([5, 6], 5, 3, replace(ONE_BATCH, n_epochs=1))
        learners.improve(Rollout(*each), np.random.default_rng(1))
        found.append(learners.weights)
    for one, two in zip(*found, strict=True):
        assert torch.equal(one[0], two[0])
        assert not torch.equal(one[1], two[1])


def test_they_learn_and_refuse_no_seed():
    ticks = []
    settings = replace(DEFAULTS, n_steps=256)
    learners = train(RAIL, 2, 500, settings, lambda steps, _: ticks.append(steps), episode_seconds=1.0)
    assert ticks == [256, 512]
    assert all(torch.isfinite(weight).all() for weight in learners.weights)
    for seeds in (0, 1.5, True):
        with pytest.raises(ParameterError, match="seeds"):
            train(RAIL, seeds, 500)


def test_a_blind_learner_acts_on_the_groups_that_it_sees_alone():
    settings = replace(DEFAULTS, n_steps=256)
    learners = train(RAIL, 1, 256, settings, blind=1, groups=["crank", "gait"], episode_seconds=1.0)
    envs = make_rows(RAIL, 1)
    crank = [name for name in envs.observation_names if "crank" in name]
    seen = np.random.default_rng(0).standard_normal((2, 6, envs.single_observation_space.shape[0]))
    for name in envs.observation_names:
        other = seen.copy()
        other[..., envs.observation_names.index(name)] += 1.0
        changed = (learners.act(other.astype(np.float32)) != learners.act(seen.astype(np.float32))).any(
            (1, 2)
        )
        assert changed[0]
        assert changed[1] == (name in crank or "swing" in name)
