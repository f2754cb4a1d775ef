"""Gait improved by the derivative of the return: Adam on the numbers of a gait locked to the crank.

    pip install "hoof-env[jax]"
    python -m examples.jax_gait --steps 60000

Each of the four gait parameters is a constant plus two harmonics of the crank angle: 20 numbers, which begin
at random. A step of Adam takes the derivative of the mean reward over half a second; episodes continue from
one such window to the next. Prints the mean reward of a control step in each tenth of the steps. Compiling
takes one to three minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np

import hoof_env.jax
from examples.jax_learning import adam, new_moments, print_tenths
from hoof_env.tasks.one_leg import lead_of

ENVS, WINDOW, RATE = 16, 25, 0.03
HARMONICS = 2
SHAPE = 1 + 2 * HARMONICS, 4
"""Factors of 1, sin, cos, sin 2 ... of the crank angle, for each parameter, in halves of its range."""


def random_gait(seed: int) -> Any:
    """Return a random start, shape `SHAPE`: constants anywhere in their ranges, and small harmonics."""
    scale = np.array([1.0] + [0.3] * (2 * HARMONICS))[:, None]
    return np.random.default_rng(seed).uniform(-1.0, 1.0, SHAPE) * scale


class Gait:
    """Policy of gaits, and their improvement, for an id of one leg.

    Attributes:
        env, params: environment, as `hoof_env.jax.make` returns it.
    """

    def __init__(self, id: str) -> None:
        self.env, self.params = hoof_env.jax.make(id)
        leg: Any = gym.make(id).unwrapped
        body = leg.body
        self._low, self._high, self._middle, self._half = body.low, body.high, body.middle, body.half
        self._lead = lead_of(body.filters, leg.dt) * body.filters.to_array()[:, 1]
        self._reach = body.reach(leg.engine, leg.dt)
        names = list(self.env.observation_names)
        self._sine, self._cosine = names.index("sin(crank angle)"), names.index("cos(crank angle)")
        self._now = names.index("crank speed")
        self._turn = jax.jit(self._window)

    def act(self, gait: Any, observation: Any) -> Any:
        """Return the action that goes to the gait as fast as is allowed, shape (4,), for an observation."""
        angle = jnp.arctan2(observation[self._sine], observation[self._cosine])
        turns = angle * jnp.arange(1, HARMONICS + 1)
        waves = jnp.stack([jnp.sin(turns), jnp.cos(turns)], -1).reshape(-1)
        wanted = self._middle + self._half * (jnp.concatenate([jnp.ones(1), waves]) @ gait)
        seen, rate = observation[self._now : self._now + 4], observation[self._now + 4 : self._now + 8]
        heading = self._middle + self._half * seen + self._lead * rate
        return jnp.clip((jnp.clip(wanted, self._low, self._high) - heading) / self._reach, -1.0, 1.0)

    def improve(self, gait: Any, steps: int, seed: int) -> Iterator[tuple[int, Any, float]]:
        """Improve a gait. After each window, yield the number of steps so far, the gait, and the window's
        mean reward of a step."""
        gait = jnp.asarray(gait, jnp.float32)
        key, of_starts = jax.random.split(jax.random.key(seed))
        begin = jax.jit(jax.vmap(self.env.reset, (0, None)))(jax.random.split(of_starts, ENVS), self.params)
        carry = gait, new_moments(gait), begin, key
        turns = max(steps // (ENVS * WINDOW), 1)
        for k in range(turns):
            carry, reward = self._turn(carry, 1.0 - k / turns)
            yield (k + 1) * ENVS * WINDOW, carry[0], float(reward)

    def _window(self, carry: Any, left: Any) -> Any:
        """Play a window and take a step of Adam; its rate falls with the share of steps that is `left`."""
        gait, moments, begin, key = carry
        key, of_steps = jax.random.split(key)
        slopes, (end, reward) = jax.grad(self._loss, has_aux=True)(gait, begin, of_steps)
        gait, moments = adam(gait, moments, slopes, RATE * left, 1.0)
        return (jnp.clip(gait, -1.0, 1.0), moments, end, key), reward

    def _loss(self, gait: Any, begin: Any, key: Any) -> Any:
        """Return minus the mean reward of a window; and where it ended, and the reward."""

        def step(carry: Any, key: Any) -> Any:
            observations, states = carry
            actions = jax.vmap(self.act, (None, 0))(gait, observations)
            observations, states, rewards, _, _ = jax.vmap(self.env.step, (0, 0, 0, None))(
                jax.random.split(key, ENVS), states, actions, self.params
            )
            return (observations, states), rewards

        end, rewards = jax.lax.scan(step, begin, jax.random.split(key, WINDOW))
        return -rewards.mean(), (end, rewards.mean())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--env-id", default="hoof_env/HorseLeg-v0", help="id of an environment of one leg")
    parser.add_argument("--steps", type=int, default=60_000, help="number of steps of all environments")
    parser.add_argument("--seed", type=int, default=0, help="seed, of the random start, too")
    given = parser.parse_args()
    progress = Gait(given.env_id).improve(random_gait(given.seed), given.steps, given.seed)
    print(np.round(np.asarray(print_tenths(progress, given.steps)), 3))
