"""Elementary functions against arbitrary precision, and their bits alone against those in a loop."""

import math
import platform
import re

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from hoof_env.simd import math as exact_math
from hoof_env.simd import read, rows, write
from hoof_env.simd.math import LOWEST_EXPONENT
from hoof_env.simd.memory import address, doubles

EIGHTHS = range(8, 25)
LANES = 8


@njit(error_model="numpy")
def cos_sin(angle):
    return exact_math.cos_sin(angle)


@njit(error_model="numpy")
def exp_of_negative(x):
    return exact_math.exp_of_negative(x)


@njit(error_model="numpy")
def root_power(d, eighths):
    return exact_math.root_power(d, eighths)


@njit(error_model="numpy")
def turn_lanes(angle, cosine, sine):
    row = rows(doubles(LANES), LANES, None)
    for n in range(0, angle.size, LANES):
        c, s = exact_math.cos_sin(read(row, address(angle), n, 1))
        write(c, address(cosine), n, 1)
        write(s, address(sine), n, 1)


@njit(error_model="numpy")
def decay_lanes(x, out):
    row = rows(doubles(LANES), LANES, None)
    for n in range(0, x.size, LANES):
        write(exact_math.exp_of_negative(read(row, address(x), n, 1)), address(out), n, 1)


@njit(error_model="numpy")
def power_lanes(depth, eighths, out):
    row = rows(doubles(LANES), LANES, None)
    for n in range(0, depth.size, LANES):
        write(exact_math.root_power(read(row, address(depth), n, 1), eighths), address(out), n, 1)


def bits(values):
    return np.ascontiguousarray(values, dtype=float).view(np.int64)


@given(st.floats(-1e4, 1e4) | st.integers(-6000, 6000).map(lambda n: n * math.pi / 4))
@settings(deadline=None, max_examples=1000)
def test_cosine_and_sine(angle):
    cosine, sine = cos_sin(angle)
    with mpmath.workprec(120):
        assert abs(mpmath.cos(angle) - cosine) < 2e-16
        assert abs(mpmath.sin(angle) - sine) < 2e-16


@given(st.floats(LOWEST_EXPONENT, 0) | st.floats(-1e-3, 0))
@settings(deadline=None, max_examples=1000)
def test_exponential(x):
    with mpmath.workprec(120):
        assert abs(exp_of_negative(x) / mpmath.exp(x) - 1) < 1e-13


@given(st.floats(-1e-14, -1e-300) | st.floats(-100, 0), st.floats(0, 10))
@settings(deadline=None, max_examples=300)
def test_the_exponential_falls_towards_its_floor(x, step):
    assert exp_of_negative(x - step) <= exp_of_negative(x) * (1 + 1e-13) <= 1 + 1e-13
    assert exp_of_negative(0.0) == 1
    assert exp_of_negative(-1e9) == exp_of_negative(LOWEST_EXPONENT)


@given(st.floats(1e-12, 10), st.sampled_from(EIGHTHS))
@settings(deadline=None, max_examples=1000)
def test_powers(d, eighths):
    with mpmath.workprec(120):
        assert abs(root_power(d, eighths) / mpmath.mpf(d) ** (mpmath.mpf(eighths) / 8) - 1) < 1e-15


@pytest.mark.parametrize("eighths", EIGHTHS)
def test_no_power_above_the_ground(eighths):
    assert [root_power(d, eighths) for d in (0.0, -0.0, -1.0)] == [0, 0, 0]


def test_what_is_not_a_number_stays_so():
    for x in (math.nan, math.inf, -math.inf):
        assert np.isnan(cos_sin(x)).all()
    assert math.isnan(exp_of_negative(math.nan))
    assert all(math.isnan(root_power(math.nan, eighths)) for eighths in EIGHTHS)


@pytest.mark.parametrize("lanes", [8, 64, 1000])
def test_a_lane_has_the_bits_that_it_has_alone(lanes):
    rng = np.random.default_rng(lanes)
    angle, x = rng.uniform(-1e4, 1e4, lanes), rng.uniform(-50, 0, lanes)
    angle[0], x[0] = -0.0, -0.0
    cosine, sine, out = np.empty((3, lanes))
    turn_lanes(angle, cosine, sine)
    alone = np.array([cos_sin(v) for v in angle])
    np.testing.assert_array_equal(bits(cosine), bits(alone[:, 0]))
    np.testing.assert_array_equal(bits(sine), bits(alone[:, 1]))
    decay_lanes(x, out)
    np.testing.assert_array_equal(bits(out), bits([exp_of_negative(v) for v in x]))
    depth = rng.uniform(-0.1, 1, lanes)
    for eighths in EIGHTHS:
        power_lanes(depth, eighths, out)
        np.testing.assert_array_equal(bits(out), bits([root_power(v, eighths) for v in depth]))


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 assembly")
def test_lanes_are_vector_code_without_fused_operations():
    turn_lanes(*np.zeros((3, 8)))
    decay_lanes(*np.zeros((2, 8)))
    depth, out = np.zeros((2, 8))
    power_lanes(depth, 12, out)
    for loop, operation in ((turn_lanes, "addpd"), (decay_lanes, "mulpd"), (power_lanes, "sqrtpd")):
        text = "".join(loop.inspect_asm().values())
        assert re.search(rf"\bv?{operation}\s", text), f"{loop.__name__}: no {operation}"
        assert not re.search(r"\bvfn?m(add|sub)", text)
