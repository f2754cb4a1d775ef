"""The flat PPO: arithmetic beside torch's, values over time limits, that it learns, repeats and refuses."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import DummyVecEnv

from agents.perceptrons import ACTIONS, ADVANTAGE, CHUNK, LOG_PROB
from agents.ppo_flat import FlatPPO, Scale
from agents.train import Args, train
from agents.watch import DivergedError
from hoof_env.policies.find import find_saved
from hoof_env.simd import threads

GAMMA, LAMBDA = 0.9, 0.8


class Guess(gym.Env):
    """Pays 1 less the squared distance of the action from 0.5, five steps long, then cut short or over."""

    observation_space = gym.spaces.Box(-1, 1, (2,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (1,), np.float32)

    def __init__(self, ends: str = "truncated"):
        self.ends = ends

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = 5
        return np.ones(2, np.float32), {}

    def step(self, action):
        self.left -= 1
        over = self.left == 0
        ended = over and self.ends == "terminated", over and self.ends == "truncated"
        return np.ones(2, np.float32), 1.0 - float(action[0] - 0.5) ** 2, *ended, {}


def model(net_arch=(8,), envs=2, ends="truncated", **changes) -> FlatPPO:
    usual = {"n_steps": 32, "batch_size": 64, "gamma": GAMMA, "learning_rate": 0.01, "seed": 0}
    kwargs = {"net_arch": [*net_arch], "log_std_init": -2.0}
    many = DummyVecEnv([lambda: Guess(ends)] * envs)
    return FlatPPO("MlpPolicy", many, policy_kwargs=kwargs, **{**usual, **changes})


@pytest.mark.parametrize("count", [2, 64, CHUNK, CHUNK + 1, 2 * CHUNK + 500])
@pytest.mark.parametrize("net_arch", [(), (8,), (64, 64), (5, 7, 3)])
def test_the_gradient_agrees_with_torch_and_stable_baselines(net_arch, count):
    """The loss as PPO.train has it, differentiated by torch."""
    generator = np.random.default_rng(0)
    one = model(net_arch, batch_size=count, n_steps=-(-count // 2), ent_coef=0.01, vf_coef=0.7)
    observations = generator.normal(size=(3 * count, 2)).astype(np.float32)
    actions = generator.normal(size=(3 * count, 1)).astype(np.float32) * 0.3
    with torch.no_grad():
        _, log_probs, _ = one.policy.evaluate_actions(torch.tensor(observations), torch.tensor(actions))
    old = log_probs.numpy() + 0.3 * generator.normal(size=3 * count).astype(np.float32)
    advantages, targets = generator.normal(size=(2, 3 * count)).astype(np.float32)
    chosen = generator.permutation(3 * count)[:count]
    half = 0.5 * np.log(2 * np.pi)  # each action's, which ours leaves out of both probabilities
    steps = np.column_stack([old + half, advantages, targets, actions]).astype(np.float32)
    gradient = one.gradient
    policy_loss, value_loss = gradient.compute(observations, steps, chosen, one.clip_range)

    x, a, b, adv, v = (torch.tensor(row[chosen]) for row in (observations, actions, old, advantages, targets))
    values, log_prob, entropy = one.policy.evaluate_actions(x, a)
    adv, ratio = (adv - adv.mean()) / (adv.std() + 1e-8), (log_prob - b).exp()
    of_policy = -torch.min(adv * ratio, adv * ratio.clamp(0.8, 1.2)).mean()
    of_value = torch.nn.functional.mse_loss(values.flatten(), v)
    (of_policy + 0.7 * of_value - 0.01 * entropy.mean()).backward()
    expected = torch.cat([parameter.grad.flatten() for parameter in one.policy.parameters()]).numpy()
    assert policy_loss == pytest.approx(of_policy.item(), abs=2e-5)
    assert value_loss == pytest.approx(of_value.item(), rel=2e-5)
    np.testing.assert_allclose(gradient.vector, expected, atol=2e-5 * np.abs(expected).max())


def test_nothing_of_the_last_batch_stays():
    """The arrays do."""
    generator = np.random.default_rng(0)
    one = model((8, 8), batch_size=2 * CHUNK + 500)
    observations, steps = (generator.normal(size=(5000, n)).astype(np.float32) for n in (2, ACTIONS + 1))
    first, second = generator.permutation(5000).reshape(2, -1)
    expected = one.gradient.compute(observations, steps, first, 0.2), one.gradient.vector.copy()
    one.gradient.compute(observations, steps, second, 0.2)
    found = one.gradient.compute(observations, steps, first, 0.2), one.gradient.vector
    assert found[0] == expected[0]
    np.testing.assert_array_equal(found[1], expected[1])


@pytest.mark.filterwarnings("error")
def test_a_ratio_beyond_all_numbers_counts_as_the_clipped_one():
    one = model(vf_coef=0.0)
    steps = np.zeros((2, ACTIONS + 1), np.float32)
    steps[:, LOG_PROB] = -1e3  # of an action that was next to impossible
    steps[:, ADVANTAGE] = 1.0, -1.0
    steps[1, LOG_PROB] = 0.0
    steps[1, ACTIONS] = 1e3  # and one that is so now
    policy_loss, _ = one.gradient.compute(np.zeros((2, 2), np.float32), steps, np.arange(2), 0.2)
    assert policy_loss == pytest.approx(-(1.2 - 0.8) / 2 * np.sqrt(0.5), rel=1e-5)
    np.testing.assert_array_equal(one.gradient.vector, 0.0)


def test_steps_agree_with_adam():
    """torch's, with its own clipping of the norm."""
    one, generator = model(), np.random.default_rng(0)
    copies = [parameter.detach().clone().requires_grad_() for parameter in one.policy.parameters()]
    adam = torch.optim.Adam(copies, lr=0.01, eps=1e-5)
    for size in (0.01, 1.0, 0.1, 10.0, 1e-4):
        gradient = (size * generator.normal(size=one.weights.vector.size)).astype(np.float32)
        for copy, part in zip(
            copies, np.split(gradient, np.cumsum([c.numel() for c in copies])[:-1]), strict=True
        ):
            copy.grad = torch.tensor(part.reshape(tuple(copy.shape)))
        torch.nn.utils.clip_grad_norm_(copies, 0.5)
        adam.step()
        one.descend(gradient, 0.01)
        expected = torch.cat([copy.detach().flatten() for copy in copies]).numpy()
        np.testing.assert_allclose(one.weights.vector, expected, rtol=1e-4, atol=1e-6)


def test_the_scale_is_the_deviation_of_all_returns_so_far():
    generator, scale = np.random.default_rng(0), Scale(GAMMA)
    seen, running = [], np.zeros(4)
    for _ in range(6):
        rewards = (5 + 3 * generator.normal(size=(50, 4))).astype(np.float32)
        ended = generator.random((50, 4)) < 0.1
        found = scale.after(rewards, ended)
        for reward, over in zip(rewards, ended, strict=True):
            running = running + reward
            seen.append(running)
            running = np.where(over, 0.0, GAMMA * running)
    assert found == pytest.approx(np.std(seen), rel=1e-3)


FOR_EVER = 1 / (1 - GAMMA)
UNTIL_THE_END = np.mean([(1 - GAMMA**left) / (1 - GAMMA) for left in range(1, 6)])


@pytest.mark.parametrize(("ends", "value"), [("truncated", FOR_EVER), ("terminated", UNTIL_THE_END)])
def test_a_time_limit_is_not_the_end_but_a_termination_is(ends, value):
    """At a reward of 1; the observation does not tell the time, so that the value is a mean over it."""
    one = model(ends=ends, envs=8, learning_rate=0.03).learn(10_000)
    assert one.weights.critic(np.ones((1, 2), np.float32)) == pytest.approx(value, rel=0.1)


@pytest.mark.parametrize("clip_range", [0.2, LinearSchedule(0.3, 0.1, 1.0)])
def test_learns_the_action_that_pays(clip_range):
    one = model(envs=8, norm_reward=True, clip_range=clip_range).learn(8_000)
    assert one.weights.actor(np.ones((1, 2), np.float32)) == pytest.approx(0.5, abs=0.1)
    assert one.num_timesteps >= 8_000


def test_another_number_of_environments_goes_on(tmp_path):
    """Their returns so far are another's."""
    model(envs=8, norm_reward=True).learn(512).save(tmp_path / "model.zip")
    loaded = FlatPPO.load(tmp_path / "model.zip", env=DummyVecEnv([Guess] * 3))
    assert loaded.learn(96, reset_num_timesteps=False).num_timesteps == 608


@pytest.mark.parametrize("num_threads", [1, 2, 5])
def test_same_seed_same_bits_on_any_number_of_threads(num_threads, monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 5)

    def learned(**changes):
        return model(envs=8, n_steps=400, batch_size=2500, **changes).learn(6400).weights.vector

    np.testing.assert_array_equal(learned(num_threads=num_threads), learned())
    assert (learned(seed=1) != learned()).any()


def test_what_it_leaves_is_played_as_stable_baselines_plays(tmp_path):
    """Weights by name, so that the library builds its own PPO with them."""
    folder = tmp_path / "run"
    small = ("n_envs=4", "n_steps=32", "batch_size=64", 'policy_kwargs={"net_arch": [8, 8]}')
    train(Args(algo="ppo_flat", steps=256, params=small, env_kwargs=("episode_seconds=0.4",), out=folder))
    with gym.make("hoof_env/HorseLeg-v0", episode_seconds=0.4) as env:
        played = find_saved(folder).load(env, "hoof_env/HorseLeg-v0")
        shape = (50, *env.observation_space.shape)
        observations = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)
    assert type(played.model) is PPO
    kept = FlatPPO.load(folder / "model.zip")
    expected = np.clip(kept.weights.actor(observations), -1, 1)
    assert np.abs(expected).max() > 1e-4
    np.testing.assert_allclose(played.predict(observations)[0], expected, atol=1e-5)


def test_a_training_that_diverges_says_so(tmp_path):
    params = ("n_envs=4", "n_steps=32", "batch_size=64", "vf_coef=1e38", "learning_rate=1e30")
    with pytest.raises(DivergedError, match="diverged"):
        train(Args(algo="ppo_flat", steps=1024, params=params, out=Path(tmp_path, "run")))
