"""What `change_settings`, curricula, `randomize` and reset options change is data: kernels are traced for
kinds alone, such as a terrain or none, and 200 changes trace nothing more and keep memory level."""

import resource

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.simd import compile as compiler
from hoof_env.tasks.settings import PER_EPISODE

CHANGES = 200
LEG, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"
FLAT, HILLS = None, {"kind": "hills", "seed": 1, "rise": 0.02}
RANGES = {
    "trunk_mass": (40.0, 90.0), "trunk_share": (0.5, 0.9), "trunk_stiffness": (1e3, 4e3),
    "trunk_damping": (100.0, 300.0), "trunk_drag": (0.0, 5.0), "stiffness": (2e4, 3e5),
    "restitution": (0.2, 0.9), "approach_floor": (1e-4, 1e-2), "friction": (0.2, 0.8),
    "friction_slow": (1e-3, 2e-3), "friction_fast": (1e-2, 2e-2), "motor_gain": (20.0, 60.0),
    "motor_torque": (200.0, 500.0),
}  # fmt: skip
"""A range of each setting that may change for an episode."""


def drawn(generator, is_horse):
    """Return settings drawn at random, of each kind of change that there is."""
    low, high = np.array(list(RANGES.values())).T
    values = dict(zip(RANGES, generator.uniform(low, high).tolist(), strict=True))
    names = [name for name in RANGES if not (is_horse and name.startswith("trunk_"))]
    names = [name for name in names if not name.startswith("motor_")]
    some = generator.choice(names, 3, replace=False).tolist()
    settings = {name: values[name] for name in some if name not in ("friction_slow", "friction_fast")}
    steep = float(generator.uniform(0.0, 0.05))
    choices = [
        {"terrain": FLAT},
        {"terrain": HILLS | {"seed": int(generator.integers(1000)), "rise": steep}},
        {"noise": {"gait": steep}},
        {"noise": None, "bias": {"gait": steep}},
        {"reward_weights": {"peak": float(generator.uniform(0, 3))}},
        {"randomize": {"friction": (0.3, 0.3 + steep)}},
        {"strength": float(generator.uniform(0, 2)), "schedule": None},
        {"schedule": {"strength": [0.0, 1.0, int(generator.integers(1, 50))]}, "strength": 1.0},
        {"push_impulse": float(generator.uniform(0, 20)), "push_seconds": (0.1, 0.3)},
        {"target_speed": (1.0, float(generator.uniform(1.5, 3.0)))},
    ]
    return settings | choices[generator.integers(len(choices))]


def test_the_ranges_are_of_all_settings_that_change_for_an_episode():
    assert set(RANGES) == set(PER_EPISODE)


@pytest.mark.parametrize(("name", "rows"), [(LEG, 1), (LEG, 9), (HORSE, 9)])
def test_changes_trace_nothing_more_and_keep_memory_level(name, rows, monkeypatch):
    traces = []
    trace = compiler.traced
    monkeypatch.setattr(compiler, "traced", lambda *arguments: traces.append(1) or trace(*arguments))
    many = {"vectorization_mode": "vector_entry_point"}
    envs = gym.make(name) if rows == 1 else gym.make_vec(name, rows, **many)
    generator = np.random.default_rng(rows)
    kept = []

    def change(settings):
        envs.unwrapped.change_settings(**settings)
        friction = float(generator.uniform(0.3, 0.7))
        envs.reset(seed=int(generator.integers(2**31)), options={"parameters": {"friction": friction}})
        for _ in range(2):
            envs.step(envs.action_space.sample())

    for kind in (FLAT, HILLS):  # and one of each kind of change, which warms up Python
        change({"terrain": kind, "noise": {"gait": 0.1}})
    for k in range(CHANGES + 20):
        change(drawn(generator, name == HORSE))
        if k == 20:
            before = len(traces), len(compiler._LOADED)
            kept.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert (len(traces), len(compiler._LOADED)) == before
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - kept[0]
    assert grown < 8 * 1024, f"{grown} KiB for {CHANGES} changes"
