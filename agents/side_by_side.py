"""PPO of Stable-Baselines3 with its defaults, for many seeds side by side: each seed has one environment.

`train` plays one row of the native vector environment for each seed and improves all networks by batched
products. Rollouts, advantages, losses, gradients' norms and Adam are those of `PPO("MlpPolicy", env)`
(`tests/agents/test_side_by_side.py` compares an update), so ten seeds take the time of about three.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from hoof_env.errors import count

Floats = NDArray[Any]

WIDTH = 64  # units of each hidden layer

BETA1 = 0.9
BETA2 = 0.999
EPSILON = 1e-5
"""Decay rates of Adam's moments, and the term that keeps it from dividing by 0."""

TRAINING_SEED = 10_000
"""Difference between the first seeds of the environments of two learners."""


@dataclass(frozen=True)
class Defaults:
    """Settings of Stable-Baselines3's PPO, with its defaults."""

    n_steps: int = 2048
    batch_size: int = 64
    n_epochs: int = 10
    learning_rate: float = 3e-4
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5


DEFAULTS = Defaults()


@dataclass(frozen=True)
class Rollout:
    """Steps of all learners, with time as the first axis and learners as the second one.

    Attributes:
        observations: shape (T, n, k).
        actions: before they are clipped, shape (T, n, m).
        log_probs: logarithms of their densities, shape (T, n).
        advantages, returns: of the actions and states, shape (T, n).
    """

    observations: Floats
    actions: Floats
    log_probs: Floats
    advantages: Floats
    returns: Floats


class Learners:
    """Networks of n learners, and what improves them.

    Args:
        seeds: seed of each learner's networks.
        inputs, outputs: numbers of an observation and of an action.
        settings: of the updates.
        seen: False where a learner sees 0 in place of an entry, shape (n, k); None for learners that see all.
    """

    def __init__(
        self,
        seeds: list[int],
        inputs: int,
        outputs: int,
        settings: Defaults = DEFAULTS,
        seen: NDArray[np.bool_] | None = None,
    ) -> None:
        self.settings = settings
        all_seen = np.ones((len(seeds), inputs), bool)
        self.seen = torch.from_numpy((all_seen if seen is None else seen).astype(np.float32))[:, None]
        sizes = [(inputs, WIDTH, 2**0.5), (WIDTH, WIDTH, 2**0.5)]
        heads = (outputs, 0.01), (1, 1.0)
        self.weights: list[Tensor] = []
        for k, (head, gain) in enumerate(heads):
            for fan_in, fan_out, scale in (*sizes, (WIDTH, head, gain)):
                # Policy and value begin with layers of their own
                self.weights.append(_orthogonal([2 * seed + k for seed in seeds], fan_in, fan_out, scale))
                self.weights.append(torch.zeros(len(seeds), 1, fan_out))
        # The last one: the logarithm of the actions' standard deviation
        self.weights.append(torch.zeros(len(seeds), 1, outputs))
        for weight in self.weights:
            weight.requires_grad_()
        self._first = [torch.zeros_like(weight) for weight in self.weights]
        self._second = [torch.zeros_like(weight) for weight in self.weights]
        self._updates = 0

    def means(self, observations: Tensor) -> Tensor:
        """Return the means of the actions, shape (n, b, m), for observations, shape (n, b, k)."""
        return _perceptron(self.weights[:6], observations * self.seen)

    def values(self, observations: Tensor) -> Tensor:
        """Return the values of observations, shape (n, b)."""
        return _perceptron(self.weights[6:12], observations * self.seen)[..., 0]

    def act(self, observations: Floats) -> Floats:
        """Return the learners' actions without noise, within -1 and 1, shape (n, b, m), for observations of
        shape (n, b, k)."""
        with torch.no_grad():
            actions: Floats = self.means(torch.from_numpy(observations)).clamp(-1.0, 1.0).numpy()
        return actions

    def alone(self, at: int) -> Learners:
        """Return the learner of a number, for playing."""
        one = copy.copy(self)
        one.weights = [weight.detach()[at : at + 1] for weight in self.weights]
        one.seen = self.seen[at : at + 1]
        return one

    def losses(self, batch: list[Tensor]) -> Tensor:
        """Return the losses of a batch, shape (n,): observations, actions, their log densities, advantages
        and returns, shapes (n, b, ...)."""
        s = self.settings
        observations, actions, log_probs, advantages, returns = batch
        spread = advantages.std(1, keepdim=True) + 1e-8
        advantages = (advantages - advantages.mean(1, keepdim=True)) / spread
        ratio = torch.exp(self._log_probs(observations, actions) - log_probs)
        clipped = ratio.clamp(1 - s.clip_range, 1 + s.clip_range)
        policy = -torch.min(ratio * advantages, clipped * advantages).mean(1)
        value = ((returns - self.values(observations)) ** 2).mean(1)
        return policy + s.vf_coef * value

    def _log_probs(self, observations: Tensor, actions: Tensor) -> Tensor:
        log_std = self.weights[-1]
        off = (actions - self.means(observations)) * torch.exp(-log_std)
        constant = 0.5 * float(np.log(2 * np.pi))
        return (-0.5 * off * off - log_std - constant).sum(-1)

    def step(self, batch: list[Tensor]) -> None:
        """Take one step of Adam, of each learner with its own gradient of limited norm."""
        s = self.settings
        gradients = torch.autograd.grad(self.losses(batch).sum(), self.weights)
        with torch.no_grad():
            squares = [(gradient * gradient).flatten(1).sum(1) for gradient in gradients]
            norm = torch.stack(squares).sum(0).sqrt()
            scale = (s.max_grad_norm / (norm + 1e-6)).clamp(max=1.0)[:, None, None]
            self._updates += 1
            unbiased = (1 - BETA2**self._updates) ** 0.5
            rate = s.learning_rate / (1 - BETA1**self._updates)
            moments = zip(self.weights, gradients, self._first, self._second, strict=True)
            for weight, gradient, first, second in moments:
                limited = gradient * scale
                first.mul_(BETA1).add_(limited, alpha=1 - BETA1)
                second.mul_(BETA2).addcmul_(limited, limited, value=1 - BETA2)
                weight.addcdiv_(first, (second.sqrt() / unbiased).add_(EPSILON), value=-rate)

    def improve(self, rollout: Rollout, random: np.random.Generator) -> None:
        """Take all steps of Adam that a rollout is worth."""
        s = self.settings
        parts = rollout.observations, rollout.actions, rollout.log_probs, rollout.advantages, rollout.returns
        of_learners = [torch.from_numpy(np.ascontiguousarray(part.swapaxes(0, 1))) for part in parts]
        n, steps = of_learners[2].shape
        learner = torch.arange(n)[:, None]
        for _ in range(s.n_epochs):
            order = torch.from_numpy(np.argsort(random.random((n, steps)), axis=1))
            for begin in range(0, steps, s.batch_size):
                chosen = order[:, begin : begin + s.batch_size]
                self.step([part[learner, chosen] for part in of_learners])


def _orthogonal(seeds: list[int], fan_in: int, fan_out: int, gain: float) -> Tensor:
    """Return orthogonal weights of each learner, shape (n, fan_in, fan_out)."""
    layers = []
    for seed in seeds:
        generator = torch.Generator().manual_seed(seed + 1_000 * fan_in + fan_out)
        layer = torch.empty(fan_out, fan_in)
        nn.init.orthogonal_(layer, gain, generator)
        layers.append(layer.T)
    return torch.stack(layers).contiguous()


def _perceptron(weights: list[Tensor], x: Tensor) -> Tensor:
    """Return the outputs of perceptrons with two hidden layers of tanh, shape (n, b, outputs)."""
    for k in (0, 2):
        x = torch.tanh(torch.baddbmm(weights[k + 1], x, weights[k]))
    return torch.baddbmm(weights[5], x, weights[4])


def advantages_of(
    rewards: Floats, values: Floats, ended: NDArray[np.bool_], gamma: float, gae_lambda: float
) -> Floats:
    """Return generalised advantages, shape (T, n).

    Args:
        rewards: with the value of the last state where an episode was cut off, shape (T, n).
        values: of the states, the one after the last step included, shape (T + 1, n).
        ended: True where an episode ended with the step, shape (T, n).
        gamma, gae_lambda: discount, and decay of what later steps say.
    """
    advantages = np.zeros_like(rewards)
    last = np.zeros_like(rewards[0])
    for t in reversed(range(len(rewards))):
        goes_on = ~ended[t]
        error = rewards[t] + gamma * goes_on * values[t + 1] - values[t]
        last = error + gamma * gae_lambda * goes_on * last
        advantages[t] = last
    return advantages


class Player:
    """Play rollouts of learners, each in its own environment.

    Args:
        learners: whose actions are played.
        envs: native vector environment with autoreset SAME_STEP, one row a learner.
        seeds: seed of each environment.
        random: of the actions' noise.
    """

    def __init__(self, learners: Learners, envs: Any, seeds: list[int], random: np.random.Generator) -> None:
        self.learners = learners
        self.envs = envs
        self.random = random
        self.seen, _ = envs.reset(seed=seeds)

    def roll(self) -> Rollout:
        """Play `n_steps` steps of each learner."""
        s = self.learners.settings
        n, k = self.seen.shape
        m = self.envs.single_action_space.shape[0]
        observations = np.empty((s.n_steps, n, k), np.float32)
        actions = np.empty((s.n_steps, n, m), np.float32)
        log_probs, rewards = np.empty((2, s.n_steps, n), np.float32)
        values = np.empty((s.n_steps + 1, n), np.float32)
        ended = np.empty((s.n_steps, n), bool)
        log_std = self.learners.weights[-1].detach().numpy()[:, 0]
        constant = 0.5 * m * np.log(2 * np.pi) + log_std.sum(1)
        for t in range(s.n_steps):
            noise = self.random.standard_normal((n, m), np.float32)
            mean, values[t] = self._ask(self.seen)
            observations[t] = self.seen
            actions[t] = mean + np.exp(log_std) * noise
            log_probs[t] = -0.5 * (noise * noise).sum(1) - constant
            clipped = np.clip(actions[t], -1.0, 1.0)
            self.seen, rewards[t], terminated, truncated, infos = self.envs.step(clipped)
            ended[t] = terminated | truncated
            cut_off = truncated & ~terminated
            if cut_off.any():
                # An episode that was cut off would have gone on
                final = np.stack([self.seen[i] if last is None else last for i, last in _finals(infos, n)])
                rewards[t] += s.gamma * cut_off * self._ask(final)[1]
        values[-1] = self._ask(self.seen)[1]
        advantages = advantages_of(rewards, values, ended, s.gamma, s.gae_lambda)
        return Rollout(observations, actions, log_probs, advantages, advantages + values[:-1])

    def _ask(self, observations: Any) -> tuple[Floats, Floats]:
        """Return means of actions, shape (n, m), and values, shape (n,), of observations, shape (n, k)."""
        with torch.no_grad():
            seen = torch.from_numpy(np.ascontiguousarray(observations, np.float32))[:, None]
            return self.learners.means(seen)[:, 0].numpy(), self.learners.values(seen)[:, 0].numpy()


def _finals(infos: Mapping[str, Any], n: int) -> list[tuple[int, Any]]:
    """Return the number of each row and its last observation, None where no episode ended."""
    final = infos["final_obs"]
    has_ended = infos["_final_obs"]
    return [(i, final[i] if has_ended[i] else None) for i in range(n)]


def train(
    env_id: str,
    seeds: int,
    steps: int,
    settings: Defaults = DEFAULTS,
    tick: Callable[[int, Learners], None] = lambda steps, learners: None,
    blind: int = 0,
    groups: Collection[str] = (),
    **env_kwargs: Any,
) -> Learners:
    """Train a learner for each of the seeds 0, 1, ..., for at least `steps` steps of its environment, then
    `blind` learners of the same seeds that see only some groups of the observation.

    Args:
        env_id: id of this package.
        seeds: number of learners.
        steps: of each.
        settings: of Stable-Baselines3's PPO.
        tick: called after each rollout with the steps so far and the learners.
        blind: number of learners that see 0 in place of every entry that is not in `groups`.
        groups: of the observation, that these see.
        **env_kwargs: arguments of the environment.

    Raises:
        ParameterError: a count below 1, or an argument that the environment refuses.
    """
    seeds = count("seeds", seeds)
    steps = count("steps", steps)
    numbers = [*range(seeds), *range(count("blind", blind, low=0))]
    envs: Any = gym.make_vec(
        env_id, len(numbers), "vector_entry_point", autoreset_mode="SAME_STEP", **env_kwargs
    ).unwrapped
    group_of = {entry.name: entry.group for entry in envs.task.entries}
    is_left = np.array([group_of[name] in groups for name in envs.observation_names])
    seen = np.array([is_left | (i < seeds) for i in range(len(numbers))])
    learners = Learners(numbers, len(is_left), envs.single_action_space.shape[0], settings, seen)
    random = np.random.default_rng(0)
    player = Player(learners, envs, [TRAINING_SEED * (1 + seed) for seed in numbers], random)
    played = 0
    while played < steps:
        learners.improve(player.roll(), random)
        played += settings.n_steps
        tick(played, learners)
    return learners
