"""Elementary functions against arbitrary precision, and their bits alone against those in a loop."""

import math
import platform
import re
from functools import partial

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite.binding import get_host_cpu_features
from numba import njit

from hoof_env.simd import math as exact_math
from hoof_env.simd import read, rows, write
from hoof_env.simd.math import LOWEST_EXPONENT
from hoof_env.simd.memory import address, doubles

EIGHTHS = range(8, 25)
LANES = 8


FUNCTIONS = {  # of a number or lanes, and whole eighths
    "cosine": lambda x, eighths: exact_math.cos_sin(x)[0],
    "sine": lambda x, eighths: exact_math.cos_sin(x)[1],
    "exponential": lambda x, eighths: exact_math.exp_of_negative(x),
    "power": lambda x, eighths: exact_math.root_power(x, eighths),
}
compiled = {name: njit(error_model="numpy")(function) for name, function in FUNCTIONS.items()}
cosine, sine, exponential = (partial(compiled[name], eighths=8) for name in ("cosine", "sine", "exponential"))
power = compiled["power"]


def in_lanes(function, lanes):
    @njit(error_model="numpy")
    def loop(x, eighths, out):
        row = rows(doubles(lanes), lanes, None)
        for n in range(0, x.size, lanes):
            write(function(read(row, address(x), n, 1), eighths), address(out), n, 1)

    return loop


def loops_of(lanes):
    inner = {name: njit(error_model="numpy", forceinline=True)(f) for name, f in FUNCTIONS.items()}
    return {name: in_lanes(function, lanes) for name, function in inner.items()}


@pytest.fixture(scope="module")
def loops():
    return loops_of(LANES)


@pytest.fixture(scope="module")
def alone():
    return loops_of(1)


@given(st.floats(-1e4, 1e4) | st.integers(-6000, 6000).map(lambda n: n * math.pi / 4))
@settings(deadline=None, max_examples=1000)
def test_cosine_and_sine(angle):
    with mpmath.workprec(120):
        assert abs(mpmath.cos(angle) - cosine(angle)) < 2e-16
        assert abs(mpmath.sin(angle) - sine(angle)) < 2e-16


@given(st.floats(LOWEST_EXPONENT, 0) | st.floats(-1e-3, 0))
@settings(deadline=None, max_examples=1000)
def test_exponential(x):
    with mpmath.workprec(120):
        assert abs(exponential(x) / mpmath.exp(x) - 1) < 1e-13


@given(st.floats(-1e-14, -1e-300) | st.floats(-100, 0), st.floats(0, 10))
@settings(deadline=None, max_examples=300)
def test_the_exponential_falls_towards_its_floor(x, step):
    assert exponential(x - step) <= exponential(x) * (1 + 1e-13) <= 1 + 1e-13
    assert exponential(0.0) == 1
    assert exponential(-1e9) == exponential(LOWEST_EXPONENT)


@given(st.floats(1e-12, 10), st.sampled_from(EIGHTHS))
@settings(deadline=None, max_examples=1000)
def test_powers(d, eighths):
    with mpmath.workprec(120):
        assert abs(power(d, eighths) / mpmath.mpf(d) ** (mpmath.mpf(eighths) / 8) - 1) < 1e-15


@pytest.mark.parametrize("eighths", EIGHTHS)
def test_no_power_above_the_ground(eighths):
    assert [power(d, eighths) for d in (0.0, -0.0, -1.0)] == [0, 0, 0]


def test_what_is_not_a_number_stays_so():
    for x in (math.nan, math.inf, -math.inf):
        assert np.isnan([cosine(x), sine(x)]).all()
    assert math.isnan(exponential(math.nan))
    assert all(math.isnan(power(math.nan, eighths)) for eighths in EIGHTHS)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_lane_has_the_bits_that_it_has_alone(loops, alone, name):
    low, high = {"exponential": (-50, 0), "power": (-0.1, 1)}.get(name, (-1e4, 1e4))
    x, (out, one) = np.random.default_rng(0).uniform(low, high, 1000), np.empty((2, 1000))
    x[0] = -0.0
    for eighths in EIGHTHS if name == "power" else (8,):
        loops[name](x, eighths, out)
        alone[name](x, eighths, one)
        np.testing.assert_array_equal(out.view(np.int64), one.view(np.int64))
        plain = np.array([compiled[name](v, eighths) for v in x])  # which is not fused
        np.testing.assert_allclose(out, plain, rtol=1e-15, atol=2e-16)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 assembly")
@pytest.mark.parametrize(
    ("name", "operation"),
    [("sine", "vfn?madd[0-9]+pd"), ("exponential", "vfn?madd[0-9]+pd"), ("power", "v?sqrtpd")],
)
def test_lanes_are_vector_code(loops, name, operation):
    if "vf" in operation and not get_host_cpu_features().get("fma"):
        pytest.skip("a processor without fused operations")
    loops[name](np.zeros(8), 12, np.zeros(8))
    text = "".join(loops[name].inspect_asm().values())
    assert re.search(rf"\b{operation}\s", text)
