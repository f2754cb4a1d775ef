"""PPO in one compiled program: environment, learner and their loop inside `jax.jit`, by `envs.xla()`.

    pip install "hoof-env[jax]"
    python -m examples.jax_ppo --steps 200000

Settings as in `agents/hyperparams/ppo_flat.yml`. Prints the mean return of the episodes that ended
in each tenth of the steps.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np

import hoof_env  # noqa: F401 - registers the environments
from examples.jax_learning import adam, answer, new_moments, new_network

ENVS, LENGTH, EPOCHS, BATCHES = 16, 128, 8, 8
GAMMA, LAMBDA, CLIP, RATE, WIDTH = 0.99, 0.95, 0.2, 1e-3, 64


def log_density(agent: Any, observations: Any, actions: Any) -> Any:
    """Return the logarithm of the policy's density."""
    z = (actions - answer(agent["actor"], observations)) / jnp.exp(agent["spread"])
    return (-0.5 * z**2 - agent["spread"] - 0.5 * np.log(2 * np.pi)).sum(-1)


def advantages(rewards: Any, values: Any, following: Any, ends: Any, terminated: Any) -> Any:
    """Return generalized advantages; a truncated episode goes on in `following`."""

    def back(later: Any, row: Any) -> Any:
        reward, value, after, end, is_last = row
        change = reward + GAMMA * jnp.where(is_last, 0.0, after) - value
        later = change + GAMMA * LAMBDA * jnp.where(end, 0.0, later)
        return later, later

    rows = rewards, values, following, ends, terminated
    return jax.lax.scan(back, jnp.zeros(rewards.shape[1]), rows, reverse=True)[1]


def loss(agent: Any, batch: Any) -> Any:
    """Return PPO's clipped loss with the critic's."""
    observations, actions, densities, gains, targets = batch
    ratio = jnp.exp(log_density(agent, observations, actions) - densities)
    gains = (gains - gains.mean()) / (gains.std() + 1e-8)
    of_actor = -jnp.minimum(ratio * gains, jnp.clip(ratio, 1 - CLIP, 1 + CLIP) * gains).mean()
    return of_actor + 0.5 * ((answer(agent["critic"], observations)[:, 0] - targets) ** 2).mean()


def scaled(scale: Any, rewards: Any, ends: Any) -> Any:
    """Return the scale after a rollout, and the rewards divided by it. The scale is the standard deviation of
    the discounted returns from the start of an episode up to each step."""
    count, mean, square, running = scale

    def add(running: Any, row: Any) -> Any:
        reward, end = row
        running = running + reward
        return jnp.where(end, 0.0, GAMMA * running), running

    running, returns = jax.lax.scan(add, running, (rewards, ends))
    total, gap = count + returns.size, returns.mean() - mean
    between = gap**2 * count * returns.size / total
    square = (square * count + returns.var() * returns.size + between) / total
    scale = total, mean + gap * returns.size / total, square, running
    return scale, jnp.clip(rewards / jnp.sqrt(square + 1e-8), -10.0, 10.0)


class Ppo:
    """Learner for an id; its program is compiled once.

    Attributes:
        envs: environments, which `train` resets.
    """

    def __init__(self, id: str) -> None:
        self.envs: Any = gym.make_vec(id, num_envs=ENVS, autoreset_mode="SAME_STEP").unwrapped
        self._step = self.envs.xla().step
        self._run = jax.jit(lambda carry, left: jax.lax.scan(self._turn, carry, left))

    def begin(self, seed: int) -> Any:
        """Return what a learner starts with."""
        self.envs.reset(seed=seed)
        handle, recv, *_ = self.envs.xla()
        handle, states = recv(handle)
        size, count = states.observations.shape[1], self.envs.single_action_space.shape[0]
        key, of_actor, of_critic = jax.random.split(jax.random.key(seed), 3)
        agent = {
            "actor": new_network(of_actor, (size, WIDTH, WIDTH, count), 0.01),
            "critic": new_network(of_critic, (size, WIDTH, WIDTH, 1), 1.0),
            "spread": jnp.zeros(count),
        }
        zeros, none = jnp.zeros(ENVS), jnp.float32(0.0)
        scale = none, none, none, zeros
        return agent, new_moments(agent), scale, handle, states.observations, zeros, key

    def train(self, steps: int, seed: int, parts: int = 10) -> Iterator[tuple[int, Any, float]]:
        """Train an agent, at a learning rate that falls to 0. After each of `parts` equal parts, yield the
        number of steps so far, the agent, and the mean return of the episodes that ended in that part."""
        carry = self.begin(seed)
        part = max(steps // (LENGTH * ENVS * parts), 1)
        left = (1.0 - jnp.arange(part * parts) / (part * parts)).reshape(parts, part)
        for k in range(parts):
            carry, (total, ended) = jax.block_until_ready(self._run(carry, left[k]))
            yield (k + 1) * part * LENGTH * ENVS, carry[0], float(total.sum()) / max(int(ended.sum()), 1)

    def _act(self, carry: Any, key: Any) -> Any:
        """Take a step; return what was seen."""
        agent, handle, observations, returns = carry
        actions = answer(agent["actor"], observations)
        actions = actions + jnp.exp(agent["spread"]) * jax.random.normal(key, actions.shape)
        handle, states = self._step(handle, jnp.clip(actions, -1.0, 1.0))
        ends = states.terminated | states.truncated
        returns = returns + states.rewards
        final = states.infos["final_obs"]
        seen = observations, actions, states.rewards, final, ends, states.terminated, returns
        return (agent, handle, states.observations, jnp.where(ends, 0.0, returns)), seen

    def _turn(self, carry: Any, left: Any) -> Any:
        """Play a rollout and learn from it."""
        agent, moments, scale, handle, observations, returns, key = carry
        key, of_actions, of_order = jax.random.split(key, 3)
        keys = jax.random.split(of_actions, LENGTH)
        first = agent, handle, observations, returns
        (_, handle, now, returns), seen = jax.lax.scan(self._act, first, keys)
        observations, actions, rewards, final, ends, terminated, so_far = seen
        scale, rewards = scaled(scale, rewards, ends)
        values = answer(agent["critic"], observations)[..., 0]
        gains = advantages(rewards, values, answer(agent["critic"], final)[..., 0], ends, terminated)
        rows = (observations, actions, log_density(agent, observations, actions), gains, gains + values)
        flat = jax.tree.map(lambda x: x.reshape(LENGTH * ENVS, *x.shape[2:]), rows)
        order = [jax.random.permutation(k, LENGTH * ENVS) for k in jax.random.split(of_order, EPOCHS)]
        order = jnp.stack(order).reshape(EPOCHS * BATCHES, -1)

        def learn(carry: Any, rows: Any) -> Any:
            agent, moments = carry
            slopes = jax.grad(loss)(agent, jax.tree.map(lambda x: x[rows], flat))
            return adam(agent, moments, slopes, RATE * left), None

        (agent, moments), _ = jax.lax.scan(learn, (agent, moments), order)
        figures = jnp.where(ends, so_far, 0.0).sum(), ends.sum()
        return (agent, moments, scale, handle, now, returns, key), figures


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--env-id", default="hoof_env/HorseLeg-v0", help="id of an environment")
    parser.add_argument("--steps", type=int, default=200_000, help="number of steps of all environments")
    parser.add_argument("--seed", type=int, default=0, help="seed")
    given = parser.parse_args()
    start = time.perf_counter()
    for taken, _, mean in Ppo(given.env_id).train(given.steps, given.seed):
        seconds = time.perf_counter() - start
        print(f"{taken:>9,} steps, {seconds:6.1f} s, return {mean:7.1f}", flush=True)
