"""Processes that compile tiny kernels, for the tests of the files in which kernels are kept."""

import pytest

from tests.simd.processes import CALL, start_copy, start_fresh

MODULE = """
import os, sys, time
from hoof_env.simd.compile import kernel
from hoof_env.simd.cache import COMPILED
from hoof_env.simd.types import instruction
from pathlib import Path

HERE = Path(__file__).parent

@instruction(lambda x: x(x))
def same(code, x):
    (HERE / "began").touch()
    limit = time.monotonic() + 100
    while not (HERE / "go").exists() and time.monotonic() < limit:
        time.sleep(0.05)
    return x

@kernel
def inner(x):
    return same(x) + 1.0

@kernel
def tiny(x):
    return 2.0 * inner(x)

@kernel
def wrong(x):
    return x.nothing
"""


@pytest.fixture
def start(tmp_path):
    """Starts a process that has tiny kernels, whose compilation ends once the file `go` is there."""
    yield from starter(tmp_path, start_copy)


@pytest.fixture
def start_anew(tmp_path):
    """Starts one likewise that imports numba and the package itself."""
    yield from starter(tmp_path, start_fresh)


def starter(folder, make):
    (folder / "tiny.py").write_text(MODULE)
    processes = []

    def begin(code=CALL, **settings):
        processes.append(make(code, folder, settings))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()
        process.communicate()
