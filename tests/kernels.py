"""Compile the kernels that most tests need: `python -m tests.kernels`, run by `make test` beside the linter.

Otherwise each of the tests' processes, which begin together, compiles them for itself. What is forgotten here
is compiled by the first test that wants it.
"""

import gymnasium as gym
import numpy as np

import hoof_env  # noqa: F401  (registers the environments)
from benchmarks.speed_cases import engine, scenes
from hoof_env.gait.parameters import load_gait
from hoof_env.identify.candidate import encode
from hoof_env.identify.objective import Objective
from hoof_env.leg.geometry import load_geometry
from hoof_env.paper.reproduce import run_cycle

PRESET = "first_fit"


def environments():
    """One and a batch, stepping and recording."""
    for env_id in ("hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"):
        env = gym.make(env_id).unwrapped
        env.reset(seed=0)
        for _ in range(2):
            env.step(np.zeros(4, np.float32))
            env.record()  # from the second step on
    envs = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=9)
    envs.reset(seed=0)
    envs.step(np.zeros((9, 4), np.float32))


def horse():
    """Four legs on one trunk."""
    engine(scenes(PRESET)["horse"], PRESET).advance(steps=1)


def search():
    """Costs of a leg."""
    choice, x = encode(load_geometry(PRESET), *(load_gait(gait, PRESET) for gait in ("walk", "run")))
    objective = Objective(choice, paper_solver=True)
    objective.cost(np.array(x))


if __name__ == "__main__":
    environments()
    search()
    run_cycle("run", "paper")
    horse()
