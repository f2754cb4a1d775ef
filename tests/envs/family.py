"""The ids of the family and what their tests share."""

from __future__ import annotations

import gymnasium as gym
import numpy as np

import hoof_env  # noqa: F401

IDS = sorted(
    name for name, spec in gym.registry.items() if str(spec.entry_point).endswith("horse_leg:HorseLegEnv")
)
"""All ids of one environment class."""

FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}
"""A suspended trunk that nothing else holds up: episodes end by failure."""


def actions(seed: int, *shape: int) -> np.ndarray:
    """Random actions."""
    return np.random.default_rng(seed).uniform(-1, 1, (*shape, 4)).astype(np.float32)


def same(one, two) -> None:
    """Raise unless both are the same to the bit, arrays, mappings and numbers."""
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            same(one[key], two[key])
    else:
        a, b = np.asarray(one), np.asarray(two)
        if a.dtype == object:
            for x, y in zip(a, b, strict=True):
                assert (x is None) == (y is None)
                if x is not None:
                    same(x, y)
        else:
            assert (a.dtype, a.shape) == (b.dtype, b.shape)
            assert a.tobytes() == b.tobytes(), (one, two)


def roll(env, count: int, seed: int = 5):
    """What random actions lead to: a list of (observation, reward, terminated, truncated)."""
    return [env.step(action)[:4] for action in actions(seed, count)]
