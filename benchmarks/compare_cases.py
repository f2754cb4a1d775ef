"""The cases of `compare`, as a script that knows only what every commit has: public names and ids.

Its argument is the share of the usual length. Prints the folder of the package, and for each case the median
processor time of several runs [s].
"""

from __future__ import annotations

import json
import statistics
import sys
import time
import warnings
from collections.abc import Callable

import gymnasium as gym
import numpy as np

import hoof_env
from hoof_env import Ground, Limb, Motor, Trunk, TrunkEngine, load_gait, load_geometry

BATCH, RUNS = 1024, 15


def advance(hips: tuple[float, ...], trunk: str, count: int, steps: int, calls: int) -> Callable[[], object]:
    """So many calls of so many steps of 1 ms of an engine with motors, each from the same state."""
    leg, walk = load_geometry("identified"), load_gait("walk", "identified")
    low = 0.05 if trunk == "fixed" else 0.0
    body = Trunk(trunk, mass=200.0, pitch_inertia=150.0, height=leg.hip_height - low)
    limbs = [Limb(leg, hip=(x, 0.0), drive=Motor()) for x in hips]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of steps that are long for the ground
        engine = TrunkEngine(limbs, body, Ground(exponent=1.375), sim_dt=1e-3, substeps=1, num_envs=count)
    engine.reset(walk, theta=np.add.outer(np.arange(len(hips)) * np.pi, np.linspace(0.3, 6.5, count)))
    state = engine.get_state()

    def run() -> None:
        for _ in range(calls):
            engine.set_state(state)
            assert not engine.advance(steps=steps, account=False).any(), engine.messages()

    return run


def step(env_id: str, steps: int) -> Callable[[], object]:
    """So many steps of one environment with random actions, from the same seed each time."""
    env = gym.make(env_id)
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, 4)).astype(np.float32)

    def run() -> None:
        env.reset(seed=0)
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return run


def step_many(env_id: str, steps: int) -> Callable[[], object]:
    """So many steps of `BATCH` environments at once."""
    envs = gym.make_vec(env_id, num_envs=BATCH)
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, BATCH, 4)).astype(np.float32)

    def run() -> None:
        envs.reset(seed=0)
        for action in actions:
            envs.step(action)

    return run


def seconds_of(run: Callable[[], object]) -> float:
    """Median processor time [s] of a run, after one that compiles and warms up."""
    run()
    spent = []
    for _ in range(RUNS):
        begin = time.thread_time()
        run()
        spent.append(time.thread_time() - begin)
    return statistics.median(spent)


def main(share: float) -> None:
    """Time all cases and print them."""
    leg, terrain = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegTerrain-v0"

    def length(number: int) -> int:
        return max(1, round(share * number))

    cases = {
        "one leg": advance((0.0,), "fixed", 1, 1000, length(100)),
        f"{BATCH} legs": advance((0.0,), "fixed", BATCH, 100, length(4)),
        "one horse": advance((0.6, 0.6, -0.6, -0.6), "free", 1, 500, length(60)),
        "HorseLeg, step": step(leg, length(3000)),
        "HorseLegTerrain, step": step(terrain, length(3000)),
        f"HorseLeg, {BATCH} at once": step_many(leg, length(50)),
    }
    seconds = {name: seconds_of(run) for name, run in cases.items()}
    json.dump({"package": hoof_env.__file__, "seconds": seconds}, sys.stdout)


if __name__ == "__main__":
    main(float(sys.argv[1]))
