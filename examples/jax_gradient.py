"""Derivative of a return by a constant action, against the length of the window that it goes through.

    pip install "hoof-env[jax]"
    python -m examples.jax_gradient --env-id hoof_env/HorseLeg-v0

Where a window is short, the derivative is the difference quotient. Through more and more landings it grows,
and the two part, because the return bends where a landing comes earlier or later. Prints for each window, as
the median of several starts, the size of the derivative along one direction and its distance from the central
difference, relative to it.
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import hoof_env.jax

WINDOWS = (5, 12, 25, 37, 50, 100)
"""Control steps of each window."""

SMALL = 1e-3
"""Step of the differences."""


def compare(id: str, starts: int) -> list[dict[str, float]]:
    """Return for each window its length [s], the size of the derivative and its distance from the difference,
    medians of the starts. Asks for doubles in JAX."""
    env, params = hoof_env.jax.make(id, starts=starts)
    key = jax.random.key(0)
    action = 0.2 * jax.random.normal(key, (env.num_actions,))
    direction = jax.random.normal(jax.random.key(1), (env.num_actions,))
    direction = direction / jnp.linalg.norm(direction)

    def returns(along: Any, state: Any) -> Any:
        def step(state: Any, _: Any) -> Any:
            _, state, reward, _, _ = env.step_env(key, state, action + along * direction)
            return state, reward

        return jnp.cumsum(jax.lax.scan(step, state, length=max(WINDOWS))[1])

    # of all windows at once: forward mode needs no memory of the steps
    @jax.jit
    @partial(jax.vmap, in_axes=(None, 0))
    def both(along: Any, state: Any) -> Any:
        return jax.jvp(lambda x: returns(x, state), (along,), (1.0,))

    slopes = np.asarray(both(0.0, params.starts)[1])
    above, below = (np.asarray(both(sign * SMALL, params.starts)[0]) for sign in (1.0, -1.0))
    quotients = (above - below) / (2 * SMALL)
    rows = []
    for length in WINDOWS:
        slope, quotient = slopes[:, length - 1], quotients[:, length - 1]
        apart = np.abs(slope - quotient) / np.maximum(np.abs(quotient), 1e-9)
        sizes = {"size": float(np.median(np.abs(slope))), "apart": float(np.median(apart))}
        rows.append({"seconds": length * env.dt, **sizes})
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--env-id", default="hoof_env/HorseLeg-v0", help="id of an environment")
    parser.add_argument("--starts", type=int, default=16, help="number of starts")
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print("| window [s] | size of the derivative | distance from the difference |\n|---|---|---|")
    for row in compare(given.env_id, given.starts):
        print(f"| {row['seconds']:g} | {row['size']:.3g} | {row['apart']:.2g} |")
