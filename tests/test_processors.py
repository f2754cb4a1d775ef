"""Lesser processors, of which numba is told: the code runs, and its numbers have the same bits.

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
from numba import njit

from benchmarks.speed_cases import engine, scenes
from benchmarks.speed_ceilings import WIDE, ceilings, loops
from benchmarks.speed_code import WIDTHS, assembly, instructions, is_counted, vector_bits
from hoof_env.simd import anywhere, choose, floor, read, rows, write
from hoof_env.simd import math as exact_math
from hoof_env.simd.memory import address, doubles

LANES, OUTPUTS, NUMBERS = 8, 8, 64

needs_x86 = pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="numba is told of lesser x86 processors"
)


@njit(error_model="numpy")
def work(given, found):
    row = rows(doubles(LANES), LANES, None)
    for n in range(0, NUMBERS, LANES):
        x = read(row, address(given), n, 1)
        c, s = exact_math.cos_sin(x)
        tall, low = exact_math.root_power(x, 12), exact_math.exp_of_negative(-x * x)
        chosen = choose((x > 0.0) & (c < s), x / c, floor(x))
        large = 1.0 if anywhere(x > 90.0) else 0.0
        many = (c, s, tall, low, chosen, exact_math.tanh(x), x * c + s * 1.7, large * x)
        for k in range(OUTPUTS):
            write(many[k], address(found), k * NUMBERS + n, 1)


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


def report(engines):
    timed = ceilings(WIDTHS[-1] // 64, 10)  # of vectors that the processor need not have
    return {
        "bits": vector_bits(), "ceilings": {kind: run() for kind, (run, _) in timed.items()},
        "lanes": lane_bits(), "engines": engine_bits() if engines else {},
    }  # fmt: skip


def on(processor, *arguments):
    """What this script prints where numba is told that it compiles for `processor`."""
    if processor == "haswell" and not llvm.get_host_cpu_features().get("avx2"):
        pytest.skip("this processor has no AVX2, so it cannot run code for haswell")
    environment = os.environ | {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    command = [sys.executable, "-m", "tests.test_processors", *arguments]
    root = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@needs_x86
@pytest.mark.parametrize(("processor", "bits"), [("haswell", 256), ("x86-64", 128)])
def test_the_probe_and_the_lanes_run_on_lesser_processors(processor, bits):
    found = on(processor)
    assert found["bits"] == bits
    assert all(seconds > 0 for seconds in found["ceilings"].values())
    assert found["lanes"] == lane_bits()


@needs_x86
@pytest.mark.slow
@pytest.mark.parametrize("processor", ["haswell", "x86-64"])
def test_engines_have_the_same_bits_on_every_processor(processor):
    """With the same NumPy, BLAS and C library, which make the leg's table."""
    assert on(processor, "engines")["engines"] == engine_bits()


@pytest.mark.skipif(not is_counted(), reason="counts x86 code")
def test_the_probe_does_what_it_counts():
    bits = vector_bits()
    for kind, (loop, count) in loops(bits // 64).items():
        loop(np.zeros(WIDE * bits // 64), 2)
        found = instructions(assembly(loop))
        assert found[kind, bits] >= WIDE * count, kind


if __name__ == "__main__":
    json.dump(report("engines" in sys.argv), sys.stdout)
