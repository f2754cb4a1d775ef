"""Lesser processors, for which kernels are compiled: the code runs, and its numbers have the same bits.

As a script this prints what the tests compare.
"""

import hashlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np
import pytest

from benchmarks.machine import vector_bits
from benchmarks.scenes import engine, scenes
from hoof_env.simd import Matrix, any_lane, floor, gather_eight, loop, read, where, write
from hoof_env.simd import math as exact_math
from hoof_env.simd.compile import PROCESSOR, kernel
from hoof_env.simd.noise import uniform

LANES, OUTPUTS, NUMBERS = 8, 10, 64
IS_X86 = platform.machine() in ("x86_64", "AMD64")
needs_x86 = pytest.mark.skipif(not IS_X86, reason="lesser processors of x86")


@kernel
def work(given: Matrix, found: Matrix) -> None:
    for n in loop(0, NUMBERS, LANES):
        x = read(given.first, n, 1, LANES)
        c, s = exact_math.cos_sin(x)
        tall, low = exact_math.root_power(x, 12), exact_math.exp_of_negative(-x * x)
        chosen = where((x > 0.0) & (c < s), x / c, floor(x))
        large = where(any_lane(x > 90.0), 1.0, 0.0)
        near = gather_eight(given.first, floor(8.0 * (1.0 + c)))[3]
        many = (
            c, s, tall, low, chosen, exact_math.tanh(x), x * c + s * 1.7, large * x, near, uniform(x, x, 2)
        )  # fmt: skip
        for k, value in enumerate(many):
            write(value, found.first, k * NUMBERS + n, 1)


def digest(array):
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def lane_bits():
    found = np.empty((OUTPUTS, NUMBERS))
    work(np.random.default_rng(0).uniform(-100, 100, NUMBERS), found)
    return digest(found)


def engine_bits():
    """Of the columns in use of engines' memories, after each of the three kernels has run."""
    found = {}
    for scene, number in (("leg", 1), ("leg", 20), ("suspended leg", 8), ("horse", 1), ("horse", 9)):
        made = engine(scenes("identified")[scene], "identified", number)
        made.advance(steps=300)
        found[f"{scene}, {number}"] = digest(made._memory.data[:, :number])
    return found


def on(processor, *arguments):
    """What this script prints where it compiles for `processor`."""
    if processor == "haswell" and not llvm.get_host_cpu_features().get("avx2"):
        pytest.skip("this processor has no AVX2, so it cannot run code for haswell")
    environment = os.environ | {PROCESSOR: processor}
    command = [sys.executable, "-m", "tests.test_processors", *arguments]
    root = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@needs_x86
@pytest.mark.parametrize(("processor", "bits"), [("haswell", 256), ("x86-64", 128)])
def test_lanes_have_the_same_bits_on_lesser_processors(processor, bits):
    found = on(processor)
    assert found["bits"] == bits  # of the widest vectors in the code
    assert found["lanes"] == lane_bits()


@needs_x86
@pytest.mark.slow
@pytest.mark.parametrize("processor", ["haswell", "x86-64"])
def test_engines_have_the_same_bits_on_every_processor(processor):
    """With the same NumPy, BLAS and C library, which make the leg's table."""
    assert on(processor, "engines")["engines"] == engine_bits()


if __name__ == "__main__":
    engines = engine_bits() if "engines" in sys.argv else {}
    json.dump({"bits": vector_bits(), "lanes": lane_bits(), "engines": engines}, sys.stdout)
