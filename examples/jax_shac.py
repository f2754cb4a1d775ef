"""SHAC, the short-horizon actor-critic of Xu et al. (2022), in plain JAX. The actor climbs the derivative of
half a second of return, through the contact; a critic estimates the return after it.

    pip install "hoof-env[jax]"
    python -m examples.jax_shac --steps 100000

Prints the mean reward of a control step in each tenth of the steps. Compiling takes one to three minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp

import hoof_env.jax
from examples.jax_learning import adam, answer, new_moments, new_network, print_tenths

ENVS, WINDOW = 16, 25
GAMMA, LAMBDA, WIDTH = 0.99, 0.95, 64
ACTOR_RATE, CRITIC_RATE = 2e-3, 2e-3
SPREAD = 0.0
"""Logarithm of the standard deviation of the actions' noise, at the start of training."""

SCALE = 20.0
"""Unit of the critic's output: about the discounted sum of rewards of a few tenths."""

VISITS, BATCHES = 16, 4
"""Epochs and batches of the critic after each window."""

KEPT = 0.2
"""Share of the old critic that the critic of targets keeps."""


class Shac:
    """Learner for an id.

    Attributes:
        env, params: environment, as `hoof_env.jax.make` returns it.
    """

    def __init__(self, id: str) -> None:
        self.env, self.params = hoof_env.jax.make(id)
        self._turn = jax.jit(self._window)

    def begin(self, seed: int) -> Any:
        """Return what a learner starts with."""
        size, count = len(self.env.observation_names), self.env.num_actions
        key, of_actor, of_critic, of_starts = jax.random.split(jax.random.key(seed), 4)
        actor = {
            "mean": new_network(of_actor, (size, WIDTH, WIDTH, count), 0.01),
            "spread": jnp.full(count, SPREAD, jnp.float32),
        }
        critic = new_network(of_critic, (size, WIDTH, WIDTH, 1), 1.0)
        observations, states = jax.jit(jax.vmap(self.env.reset, (0, None)))(
            jax.random.split(of_starts, ENVS), self.params
        )
        learned = actor, critic, critic, new_moments(actor), new_moments(critic)
        return learned, (observations, states), key

    def train(self, steps: int, seed: int) -> Iterator[tuple[int, Any, float]]:
        """Train. After each window, yield the number of steps so far, the actor, and the window's mean reward
        of a step."""
        carry = self.begin(seed)
        turns = max(steps // (ENVS * WINDOW), 1)
        for k in range(turns):
            carry, reward = self._turn(carry, 1.0 - k / turns)
            yield (k + 1) * ENVS * WINDOW, carry[0][0], float(reward)

    def _window(self, carry: Any, left: Any) -> Any:
        """Play a window and learn from it; rates fall with the share of steps that is `left`."""
        (actor, critic, target, of_actor, of_critic), begin, key = carry
        key, of_noise, of_order = jax.random.split(key, 3)
        slopes, (end, seen) = jax.grad(self._loss, has_aux=True)(actor, target, begin, of_noise)
        actor, of_actor = adam(actor, of_actor, slopes, ACTOR_RATE * left, 1.0, 0.7)
        critic, of_critic = self._fit(critic, of_critic, target, seen, of_order, CRITIC_RATE * left)
        target = jax.tree.map(lambda old, new: KEPT * old + (1 - KEPT) * new, target, critic)
        return ((actor, critic, target, of_actor, of_critic), end, key), seen[1].mean()

    def _loss(self, actor: Any, target: Any, begin: Any, key: Any) -> Any:
        """Return minus the discounted return of a window by step, with the critic's value at its end and at
        the end of each episode in it; and where the window ended, and what was seen."""

        def step(carry: Any, key: Any) -> Any:
            observations, states, weight, total = carry
            of_noise, of_step = jax.random.split(key)
            means = answer(actor["mean"], observations)
            noise = jnp.exp(actor["spread"]) * jax.random.normal(of_noise, means.shape)
            keys = jax.random.split(of_step, ENVS)
            after, states, rewards, done, info = jax.vmap(self.env.step, (0, 0, 0, None))(
                keys, states, jnp.tanh(means + noise), self.params
            )
            value = SCALE * answer(target, info["final_obs"])[:, 0]
            value = jnp.where(info["terminated"], 0.0, value)
            total = total + weight * (rewards + jnp.where(done, GAMMA * value, 0.0))
            weight = jnp.where(done, 1.0, GAMMA * weight)
            return (after, states, weight, total), (observations, rewards, value, done)

        first = (*begin, jnp.ones(ENVS), jnp.zeros(ENVS))
        (observations, states, weight, total), seen = jax.lax.scan(step, first, jax.random.split(key, WINDOW))
        total = total + weight * SCALE * answer(target, observations)[:, 0]
        return -total.mean() / WINDOW, ((observations, states), seen)

    def _fit(self, critic: Any, moments: Any, target: Any, seen: Any, key: Any, rate: Any) -> Any:
        """Return critic and moments after fits to the returns of a window, mixed over lengths by `LAMBDA`."""
        observations, rewards, values, done = seen

        def back(later: Any, row: Any) -> Any:
            reward, value, end = row
            mixed = reward + GAMMA * jnp.where(end, value, (1 - LAMBDA) * value + LAMBDA * later)
            return mixed, mixed

        wanted = jax.lax.scan(back, values[-1], (rewards, values, done), reverse=True)[1]
        flat = observations.reshape(ENVS * WINDOW, -1), wanted.reshape(-1)
        order = [jax.random.permutation(k, ENVS * WINDOW) for k in jax.random.split(key, VISITS)]

        def error(critic: Any, x: Any, y: Any) -> Any:
            return ((answer(critic, x)[:, 0] - y / SCALE) ** 2).mean()

        def learn(carry: Any, rows: Any) -> Any:
            critic, moments = carry
            slopes = jax.grad(error)(critic, *(x[rows] for x in flat))
            return adam(critic, moments, slopes, rate, 1.0), None

        order = jnp.stack(order).reshape(VISITS * BATCHES, -1)
        return jax.lax.scan(learn, (critic, moments), order)[0]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--env-id", default="hoof_env/HorseLeg-v0", help="id of an environment")
    parser.add_argument("--steps", type=int, default=100_000, help="number of steps of all environments")
    parser.add_argument("--seed", type=int, default=0, help="seed")
    given = parser.parse_args()
    print_tenths(Shac(given.env_id).train(given.steps, given.seed), given.steps)
