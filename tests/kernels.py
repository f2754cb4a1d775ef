"""Compile the kernels that most tests need: `python -m tests.kernels`, run by `make test` beside the linter.

Otherwise each of the tests' processes, which begin together, compiles them for itself. What is forgotten here
is compiled by the first test that wants it.
"""

from benchmarks.scenes import engine, scenes
from hoof_env.envs.compile_ahead import compile_kernels
from hoof_env.paper.reproduce import run_cycle
from research.identify.leg import encode
from research.identify.objective import Objective
from tests.legs import FIRST_FIT


def horse():
    """Four legs on one trunk."""
    engine(scenes(FIRST_FIT)["horse"], FIRST_FIT).advance(steps=1)


def search():
    """Costs of a leg."""
    choice, x = encode(FIRST_FIT)
    Objective(choice, paper_solver=True).rate(x)


if __name__ == "__main__":
    compile_kernels(print)
    search()
    run_cycle("run", "paper")
    horse()
