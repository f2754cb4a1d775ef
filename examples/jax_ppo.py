"""PPO in one compiled program: environment, learner and their loop inside `jax.jit`, by `envs.xla()`.

    pip install "hoof-env[jax]"
    python examples/jax_ppo.py --steps 200000

Networks and Adam are a few lines of JAX, so that nothing else is needed. Prints the mean return of the
episodes that ended in each tenth of the steps.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np

import hoof_env  # noqa: F401 - registers the environments

ENVS, LENGTH, EPOCHS, BATCHES = 16, 128, 8, 8
GAMMA, LAMBDA, CLIP, RATE, WIDTH = 0.99, 0.95, 0.2, 3e-4, 64


def new_network(key: Any, sizes: tuple[int, ...], last: float) -> Any:
    """Return weights and biases of layers, orthogonal, the last one scaled."""
    scales = [2**0.5] * (len(sizes) - 2) + [last]
    parts = zip(jax.random.split(key, len(scales)), scales, sizes[:-1], sizes[1:], strict=True)
    return [(jax.nn.initializers.orthogonal(scale)(k, (m, n)), jnp.zeros(n)) for k, scale, m, n in parts]


def answer(network: Any, x: Any) -> Any:
    """Return the output of a network."""
    for weights, biases in network[:-1]:
        x = jnp.tanh(x @ weights + biases)
    weights, biases = network[-1]
    return x @ weights + biases


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


def adam(agent: Any, moments: Any, slopes: Any) -> Any:
    """Return agent and moments after one step of Adam, with the slopes' norm limited to 0.5."""
    count, means, squares = moments
    norm = jnp.sqrt(sum((x**2).sum() for x in jax.tree.leaves(slopes)))
    slopes = jax.tree.map(lambda x: x * jnp.minimum(1.0, 0.5 / (norm + 1e-6)), slopes)
    means = jax.tree.map(lambda m, x: 0.9 * m + 0.1 * x, means, slopes)
    squares = jax.tree.map(lambda m, x: 0.999 * m + 0.001 * x**2, squares, slopes)
    count = count + 1
    rate = RATE * jnp.sqrt(1 - 0.999**count) / (1 - 0.9**count)
    agent = jax.tree.map(lambda a, m, s: a - rate * m / (jnp.sqrt(s) + 1e-8), agent, means, squares)
    return agent, (count, means, squares)


def train(id: str, steps: int, seed: int) -> None:
    """Train an agent, and print returns."""
    envs: Any = gym.make_vec(id, num_envs=ENVS, autoreset_mode="SAME_STEP").unwrapped
    envs.reset(seed=seed)
    handle, recv, _, step = envs.xla()
    handle, states = recv(handle)
    size, count = states.observations.shape[1], envs.single_action_space.shape[0]
    key, of_actor, of_critic = jax.random.split(jax.random.key(seed), 3)
    agent = {
        "actor": new_network(of_actor, (size, WIDTH, WIDTH, count), 0.01),
        "critic": new_network(of_critic, (size, WIDTH, WIDTH, 1), 1.0),
        "spread": jnp.full(count, -0.5, jnp.float32),
    }
    zeros = jax.tree.map(jnp.zeros_like, agent)

    def act(carry: Any, key: Any) -> Any:
        agent, handle, observations, returns = carry
        actions = answer(agent["actor"], observations)
        actions = actions + jnp.exp(agent["spread"]) * jax.random.normal(key, actions.shape)
        handle, states = step(handle, jnp.clip(actions, -1.0, 1.0))
        ends = states.terminated | states.truncated
        returns = returns + states.rewards
        seen = (
            observations,
            actions,
            states.rewards,
            states.infos["final_obs"],
            ends,
            states.terminated,
            returns,
        )
        return (agent, handle, states.observations, jnp.where(ends, 0.0, returns)), seen

    def learn(carry: Any, batch: Any) -> Any:
        agent, moments = carry
        return adam(agent, moments, jax.grad(loss)(agent, batch)), None

    def turn(carry: Any, _: Any) -> Any:
        agent, moments, handle, observations, returns, key = carry
        key, of_actions, of_order = jax.random.split(key, 3)
        keys = jax.random.split(of_actions, LENGTH)
        (_, handle, now, returns), seen = jax.lax.scan(act, (agent, handle, observations, returns), keys)
        observations, actions, rewards, final, ends, terminated, so_far = seen
        values = answer(agent["critic"], observations)[..., 0]
        gains = advantages(rewards, values, answer(agent["critic"], final)[..., 0], ends, terminated)
        rows = (observations, actions, log_density(agent, observations, actions), gains, gains + values)
        flat = jax.tree.map(lambda x: x.reshape(LENGTH * ENVS, *x.shape[2:]), rows)
        order = [jax.random.permutation(k, LENGTH * ENVS) for k in jax.random.split(of_order, EPOCHS)]
        order = jnp.stack(order).reshape(EPOCHS * BATCHES, -1)
        (agent, moments), _ = jax.lax.scan(
            lambda carry, rows: learn(carry, jax.tree.map(lambda x: x[rows], flat)), (agent, moments), order
        )
        figures = jnp.where(ends, so_far, 0.0).sum(), ends.sum()
        return (agent, moments, handle, now, returns, key), figures

    turns = steps // (LENGTH * ENVS)
    part = max(turns // 10, 1)
    run = jax.jit(lambda carry: jax.lax.scan(turn, carry, length=part))
    carry = (agent, (jnp.float32(0.0), zeros, zeros), handle, states.observations, jnp.zeros(ENVS), key)
    start = time.perf_counter()
    for k in range(turns // part):
        carry, (total, count) = jax.block_until_ready(run(carry))
        mean = float(total.sum()) / max(int(count.sum()), 1)
        taken, seconds = (k + 1) * part * LENGTH * ENVS, time.perf_counter() - start
        print(
            f"{taken:>9,} steps, {seconds:6.1f} s, {int(count.sum()):>4} episodes, return {mean:7.1f}",
            flush=True,
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--env-id", default="hoof_env/HorseLeg-v0", help="id of an environment")
    parser.add_argument("--steps", type=int, default=200_000, help="number of steps of all environments")
    parser.add_argument("--seed", type=int, default=0, help="seed")
    given = parser.parse_args()
    train(given.env_id, given.steps, given.seed)
