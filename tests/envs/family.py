"""The ids of the family and what their tests share."""

from __future__ import annotations

import re
from dataclasses import replace

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from hoof_env.errors import ParameterError
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.settings import NEEDED, PER_EPISODE, Settings, check_effect

HORSE = "hoof_env/Horse-v0"
ROUGH = "hoof_env/HorseRough-v0"
HORSES = (HORSE, ROUGH, "hoof_env/HorseSafe-v0")

LEGS = sorted(
    name
    for name, spec in gym.registry.items()
    # Modules of other tests may have registered ids of their own
    if name.startswith("hoof_env/") and str(spec.entry_point).endswith("horse_leg:HorseLegEnv")
    if name not in HORSES
)
"""The ids of one leg."""

IDS = [*LEGS, *HORSES]
"""All ids of one environment class."""

LARGER = {
    name: default + 1 if isinstance(default, int) else 1.25 * default or 1.0
    for name, default in vars(Settings()).items()
    if isinstance(default, (int, float))
}
"""Other values of settings whose default is a number."""

OTHER = {name: LARGER[name] for name in (*PER_EPISODE, *NEEDED) if name in LARGER} | {
    "trunk_mass": 120.0, "trunk_share": 0.5, "trunk_stiffness": 6000.0, "trunk_damping": 900.0,
    "trunk_drag": 60.0, "stiffness": 4e4, "restitution": 0.9, "approach_floor": 9.0, "friction": 0.1,
    "friction_slow": 0.04, "friction_fast": 0.2, "motor_gain": 30.0, "motor_torque": 100.0,
    "motor_inertia": 2.0, "target_seconds": (0.02, 0.1), "exponent": 1.25, "size": 1.2, "harmonics": 1,
    "filters": "slow", "footfall": "free", "crank_rate": 5.0, "swing_rate": 0.3,
}  # fmt: skip
"""Values other than the defaults of settings that an episode may change or that need another setting."""

FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}
"""A suspended trunk that nothing else holds up: episodes end by failure."""


def effective(given, env_id: str = "hoof_env/HorseLeg-v0", **settings):
    """Settings among `given` that have an effect on an id, together with `settings`."""
    task = TASKS[gym.spec(env_id).kwargs["task"]]
    found = replace(Settings(), **{**task.defaults, **settings})

    def has_effect(name):
        try:
            check_effect(name, found)
        except ParameterError:
            return False
        return True

    return {name: value for name, value in given.items() if has_effect(name)}


def actions(seed: int, *shape: int, env_id: str = LEGS[0]) -> np.ndarray:
    """Random actions."""
    width = 16 if env_id in HORSES else 4
    return np.random.default_rng(seed).uniform(-1, 1, (*shape, width)).astype(np.float32)


def same(one, two) -> None:
    """Raise unless both are the same to the bit, arrays, mappings and numbers."""
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        same([*one.values()], [two[key] for key in one])
    elif isinstance(one, (list, tuple)) or getattr(one, "dtype", None) == np.dtype(object):
        if {*map(type, one)} == {float} == {*map(type, two)}:
            same(np.array(one), np.array(two))  # all at once, which is quicker
            return
        for a, b in zip(one, two, strict=True):
            same(a, b)
    elif one is None or isinstance(one, (int, str)):
        assert one == two
    else:
        a, b = np.asarray(one), np.asarray(two)
        assert (a.dtype, a.shape) == (b.dtype, b.shape)
        assert a.tobytes() == b.tobytes(), (one, two)


def same_rows(found, expected, rows):
    """Raise unless arrays, and infos where they are valid, have the same first rows to the bit."""
    *arrays, infos = found
    *others, expected_infos = expected
    for one, other in zip(arrays, others, strict=True):
        same(one[:rows], other[:rows])
    _same_infos(infos, expected_infos, rows)


def _same_infos(found, expected, rows):
    for key in (key for key in expected if not key.startswith("_")):
        mask = expected.get(f"_{key}", np.ones(rows, bool))[:rows]
        if not mask.any():
            continue
        same(found.get(f"_{key}", np.ones(rows, bool))[:rows] & mask, mask)
        if isinstance(expected[key], dict):
            _same_infos(found[key], expected[key], rows)
        elif expected[key].dtype == np.dtype(object):
            same([*found[key][:rows][mask]], [*expected[key][:rows][mask]])
        else:
            assert len(found[key]) >= rows
            same(np.asarray(found[key])[:rows][mask], np.asarray(expected[key])[:rows][mask])


def make(env_id, n=0, **settings):
    """The environment of an id, or `n` of them side by side."""
    return (gym.make_vec(env_id, num_envs=n, **settings) if n else gym.make(env_id, **settings)).unwrapped


def steps(env, count: int, seed: int = 5):
    """What `count` random actions lead to, of one environment or many."""
    shape = count, *env.action_space.shape[:-1]
    return [env.step(action) for action in actions(seed, *shape, env_id=env.unwrapped.task.id)]


def roll(env, count: int, seed: int = 5):
    """The same without infos."""
    return [step[:4] for step in steps(env, count, seed)]


def together(records):
    """What `env.unwrapped.record()` gave after several steps as one array for each name, shape (n,), with the
    forces on the hoof as "normal" and "grf"."""
    trace = {name: np.concatenate([record[name].ravel() for record in records]) for name in records[0]}
    normal, friction = (trace[f"toe_{name}"] + trace[f"heel_{name}"] for name in ("normal", "friction"))
    return trace | {"normal": normal, "grf": np.hypot(normal, friction)}


def substeps(env, gait=None) -> dict[str, np.ndarray]:
    """Substeps of an episode, from its start to its end, in the gait that it has, or on the way to another
    one and in that."""
    leg, zero = env.unwrapped, np.zeros(4, np.float32)
    records, done = [leg.record()], False
    while not done:
        *_, terminated, truncated, _ = env.step(zero if gait is None else leg.action_for(gait))
        records.append(leg.record())
        done = terminated or truncated
    return together(records[1:])


def running_peak_charge(forces):
    """What a running peak rises in all that never is more than twice the present force."""
    running = charge = 0.0
    for force in forces:
        fallen = min(running, 2 * force)
        running = max(force, fallen)
        charge += max(force - fallen, 0.0)
    return charge


MODES = list(AutoresetMode)


def both(env_id, n, mode=AutoresetMode.NEXT_STEP, **settings):
    """Our vector environment, and Gymnasium's over single environments."""
    ours = gym.make_vec(env_id, num_envs=n, autoreset_mode=mode, **settings)
    theirs = SyncVectorEnv([lambda: gym.make(env_id, **settings)] * n, autoreset_mode=mode)
    return ours.unwrapped, theirs


def scaled(scaling, x, leg):
    """What the manual page says that becomes of a measured number, or of a row of them."""
    if scaling in ("none", "0 or 1"):
        return x
    if bounds := re.fullmatch(r"linear, -1 at (\S+) and 1 at (\S+)", scaling):
        low, high = (float(bound) for bound in bounds.groups())
        return (2 * x - low - high) / (high - low)
    if part := re.fullmatch(r"/ ([\d.]+)", scaling):
        return np.clip(x / float(part[1]), -1, 1)
    formula = re.sub(r"(\d+) weights( / s)?", r"(\1 * weight)", scaling)
    formula = formula.replace("0.2 hip height", "0.2 * hip height")
    formula = formula.replace("hip height", f"{leg.body.height}")
    return eval(formula, {"tanh": np.tanh, "x": x, "weight": leg.weight})
