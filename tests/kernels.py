"""Compile the kernels that most tests need: `python -m tests.kernels`, run by `make test` beside the linter.

Otherwise each of the tests' processes, which begin together, compiles them for itself. What is forgotten here
is compiled by the first test that wants it.
"""

import os
from pathlib import Path

from numba.core.caching import _CacheLocator

import hoof_env
from benchmarks.scenes import engine, scenes
from hoof_env.envs.compile_ahead import compile_kernels
from hoof_env.paper.reproduce import run_cycle
from hoof_env.simd.cache import given_folder
from tests.legs import FIRST_FIT


def horse():
    """Four legs on one trunk."""
    engine(scenes(FIRST_FIT)["horse"], FIRST_FIT).advance(steps=1)


def link_kernels(folder: Path) -> None:
    """Put what is compiled of the package into another folder, for a test that changes or counts files there:
    it need not compile all of it again."""
    for room in (path for path in Path(hoof_env.__file__).parent.iterdir() if path.is_dir()):
        name = _CacheLocator.get_suitable_cache_subpath(str(room / "any.py"))
        there = Path(given_folder(), name) if given_folder() else room / "__pycache__"
        for path in there.glob("*.nb[ci]"):
            (folder / name).mkdir(0o755, parents=True, exist_ok=True)
            os.link(path, folder / name / path.name)


if __name__ == "__main__":
    compile_kernels(print)
    run_cycle("run", "paper")
    horse()
