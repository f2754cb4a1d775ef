"""Cases of `compare`, as a script that knows only what every commit has: public names and ids.

Its arguments are the number of runs of each case and the share of a run's steps that is taken. It prints the
file of the package, and for each case the least processor time of a run [s].
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

import hoof_env
from hoof_env import Ground, Limb, Motor, Trunk, TrunkEngine, load_gait, load_geometry

BATCH = 1024


def advance(hips: tuple[float, ...], trunk: str, count: int, steps: int, calls: int) -> Callable[[], object]:
    """Return a function of `calls` calls of `steps` steps of 1 ms of an engine with motors, each from the
    same state."""
    leg = load_geometry("identified")
    walk = load_gait("walk", "identified")
    # A fixed trunk hangs lower, or its hooves would hardly touch the ground
    low = 0.05 if trunk == "fixed" else 0.0
    body = Trunk(trunk, mass=200.0, pitch_inertia=150.0, height=leg.hip_height - low)
    limbs = [Limb(leg, hip=(x, 0.0), drive=Motor()) for x in hips]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of steps that are long for the ground
        engine = TrunkEngine(limbs, body, Ground(exponent=1.375), sim_dt=1e-3, substeps=1, num_envs=count)
    engine.reset(walk, np.add.outer(np.arange(len(hips)) * np.pi, np.linspace(0.3, 6.5, count)))
    state = engine.get_state()

    def run() -> None:
        for _ in range(calls):
            engine.set_state(state)
            assert not engine.advance(steps=steps, account=False).any(), engine.messages()

    return run


def step(env: gym.Env, steps: int, size: float = 1.0) -> Callable[[], object]:
    """Return a function of `steps` steps of one environment with random actions up to a size, going on from
    the last."""
    shape: tuple[int, ...] = env.action_space.shape or ()
    actions = np.random.default_rng(0).uniform(-size, size, (steps, *shape)).astype(env.action_space.dtype)
    env.reset(seed=0)

    def run() -> None:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return run


def step_many(envs: Any, count: int, steps: int, size: float = 1.0) -> Callable[[], object]:
    """Return a function of `steps` steps of `count` environments that have been reset, of Gymnasium or
    EnvPool, with random actions up to a size."""
    shape = (min(steps, 8), count, envs.action_space.shape[-1])
    actions = np.random.default_rng(0).uniform(-size, size, shape).astype(envs.action_space.dtype)

    def run() -> None:
        for k in range(steps):
            envs.step(actions[k % len(actions)])

    return run


def least_seconds(cases: dict[str, Callable[[], object]], runs: int) -> dict[str, float]:
    """Return the least processor time [s] of each case, by turns, after one run of each that compiles and
    warms up: other work of the machine adds to a run and takes nothing off."""
    spent: dict[str, list[float]] = {name: [] for name in cases}
    for k in range(runs + 1):
        for name, run in cases.items():
            begin = time.thread_time()
            run()
            if k:
                spent[name].append(time.thread_time() - begin)
    return {name: min(seconds) for name, seconds in spent.items()}


def main(runs: int, share: float) -> None:
    """Time all cases and print them."""

    def cut(count: int) -> int:
        return max(1, round(count * share))

    leg = "hoof_env/HorseLeg-v0"
    terrain = "hoof_env/HorseLegTerrain-v0"
    many = gym.make_vec(leg, num_envs=BATCH)
    many.reset(seed=0)
    cases = {
        "one leg": advance((0.0,), "fixed", 1, 1000, cut(100)),
        f"{BATCH} legs": advance((0.0,), "fixed", BATCH, cut(100), 4),
        "one horse": advance((0.6, 0.6, -0.6, -0.6), "free", 1, 500, cut(60)),
        "HorseLeg, step": step(gym.make(leg), cut(3000)),
        "HorseLegTerrain, step": step(gym.make(terrain), cut(3000)),
        f"HorseLeg, {BATCH} at once": step_many(many, BATCH, cut(50)),
    }
    json.dump({"package": hoof_env.__file__, "seconds": least_seconds(cases, runs)}, sys.stdout)


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
