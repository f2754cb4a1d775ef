"""Perceptrons, Adam and printed progress in plain JAX, shared by the learners of these examples.

Adam is written out, in a dozen lines, so that the examples need nothing but JAX; the extra `jax` does not
install optax.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import jax
import jax.numpy as jnp


def new_network(key: Any, sizes: tuple[int, ...], last: float) -> Any:
    """Return weights and biases of layers, orthogonal, the last one scaled."""
    scales = [2**0.5] * (len(sizes) - 2) + [last]
    parts = zip(jax.random.split(key, len(scales)), scales, sizes[:-1], sizes[1:], strict=True)
    return [(jax.nn.initializers.orthogonal(scale)(k, (m, n)), jnp.zeros(n)) for k, scale, m, n in parts]


def answer(network: Any, x: Any) -> Any:
    """Return the output of a network, shape (..., n), for inputs of shape (..., m)."""
    for weights, biases in network[:-1]:
        x = jnp.tanh(x @ weights + biases)
    weights, biases = network[-1]
    return x @ weights + biases


def new_moments(parameters: Any) -> Any:
    """Return what `adam` remembers before its first step."""
    zeros = jax.tree.map(jnp.zeros_like, parameters)
    return jnp.float32(0.0), zeros, zeros


def adam(
    parameters: Any, moments: Any, slopes: Any, rate: Any, largest: float = 0.5, mean: float = 0.9
) -> Any:
    """Return parameters and moments after one step of Adam.

    Args:
        parameters: tree of arrays.
        moments: see `new_moments`.
        slopes: tree of derivatives.
        rate: learning rate.
        largest: norm to which the slopes are limited.
        mean: decay of their mean.
    """
    count, means, squares = moments
    norm = jnp.sqrt(sum((x**2).sum() for x in jax.tree.leaves(slopes)))
    slopes = jax.tree.map(lambda x: x * jnp.minimum(1.0, largest / (norm + 1e-6)), slopes)
    means = jax.tree.map(lambda m, x: mean * m + (1 - mean) * x, means, slopes)
    squares = jax.tree.map(lambda s, x: 0.999 * s + 0.001 * x**2, squares, slopes)
    count = count + 1
    rate = rate * jnp.sqrt(1 - 0.999**count) / (1 - mean**count)
    step = lambda a, m, s: a - rate * m / (jnp.sqrt(s) + 1e-8)  # noqa: E731
    return jax.tree.map(step, parameters, means, squares), (count, means, squares)


def print_tenths(progress: Iterable[tuple[int, Any, float]], steps: int) -> Any:
    """Print the mean reward of each tenth of the steps; return what was learned last.

    Args:
        progress: number of steps, what is learned, and mean reward of a step, after each window.
        steps: number of steps at the end.
    """
    start, rewards, shown, learned = time.perf_counter(), [], 0, None
    for taken, learned, reward in progress:  # noqa: B007 - the last is returned
        rewards.append(reward)
        if taken * 10 // steps > shown:
            shown, mean = taken * 10 // steps, sum(rewards) / len(rewards)
            print(f"{taken:>9,} steps, {time.perf_counter() - start:6.1f} s, reward {mean:7.3f}", flush=True)
            rewards = []
    return learned
