"""The ids of the family and what their tests share."""

from __future__ import annotations

from dataclasses import replace

import gymnasium as gym
import numpy as np

from hoof_env.envs.tasks import TASKS, Settings, check_effect
from hoof_env.errors import ParameterError

IDS = sorted(
    name for name, spec in gym.registry.items() if str(spec.entry_point).endswith("horse_leg:HorseLegEnv")
)
"""All ids of one environment class."""

FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}
"""A suspended trunk that nothing else holds up: episodes end by failure."""


def effective(given, env_id: str = "hoof_env/HorseLeg-v0", **settings):
    """Those of some settings that have an effect beside others on an id."""
    task = TASKS[gym.spec(env_id).kwargs["task"]]
    found = replace(Settings(), **{**task.defaults, **settings})

    def has_effect(name):
        try:
            check_effect(name, found)
        except ParameterError:
            return False
        return True

    return {name: value for name, value in given.items() if has_effect(name)}


def actions(seed: int, *shape: int) -> np.ndarray:
    """Random actions."""
    return np.random.default_rng(seed).uniform(-1, 1, (*shape, 4)).astype(np.float32)


def same(one, two) -> None:
    """Raise unless both are the same to the bit, arrays, mappings and numbers."""
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            same(one[key], two[key])
    elif isinstance(one, (list, tuple)) or getattr(one, "dtype", None) == np.dtype(object):
        for a, b in zip(one, two, strict=True):
            same(a, b)
    elif one is None or isinstance(one, (int, str)):
        assert one == two
    else:
        a, b = np.asarray(one), np.asarray(two)
        assert (a.dtype, a.shape) == (b.dtype, b.shape)
        assert a.tobytes() == b.tobytes(), (one, two)


def roll(env, count: int, seed: int = 5):
    """What random actions lead to: a list of (observation, reward, terminated, truncated)."""
    return [env.step(action)[:4] for action in actions(seed, count)]


def together(records):
    """What `env.unwrapped.record()` gave after several steps as one array for each name, shape (n,), with the
    forces on the hoof as "normal" and "grf"."""
    trace = {name: np.concatenate([record[name].ravel() for record in records]) for name in records[0]}
    normal, friction = (trace[f"toe_{name}"] + trace[f"heel_{name}"] for name in ("normal", "friction"))
    return trace | {"normal": normal, "grf": np.hypot(normal, friction)}


def substeps(env, action) -> dict[str, np.ndarray]:
    """Substeps of an episode, from its start to its end, under one action."""
    records, done = [env.unwrapped.record()], False
    while not done:
        *_, terminated, truncated, _ = env.step(action)
        records.append(env.unwrapped.record())
        done = terminated or truncated
    return together(records[1:])
