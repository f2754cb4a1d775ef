"""Compile the kernels that most tests need: `python -m tests.kernels`, run by `make test` beside the linter.

Otherwise each of the tests' processes, which begin together, compiles them for itself. What is forgotten here
is compiled by the first test that wants it.
"""

from benchmarks.scenes import engine, scenes
from hoof_env.envs.compile_ahead import compile_kernels
from hoof_env.paper.reproduce import run_cycle
from tests.legs import FIRST_FIT


def horse():
    """Four legs on one trunk."""
    engine(scenes(FIRST_FIT)["horse"], FIRST_FIT).advance(steps=1)


if __name__ == "__main__":
    compile_kernels(print)
    run_cycle("run", "paper")
    horse()
