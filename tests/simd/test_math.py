"""Elementary functions against arbitrary precision, and their bits alone against their bits in a loop."""

import math
import platform
import re

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite.binding import get_host_cpu_features

from hoof_env.simd import Matrix, loop, read, write
from hoof_env.simd import math as exact_math
from hoof_env.simd.compile import kernel
from hoof_env.simd.math import MIN_EXPONENT
from tests.simd.assembly import assembly_of

EIGHTHS = range(8, 25)
LANES = 8


FUNCTIONS = {  # of lanes
    "cosine": lambda x: exact_math.cos_sin(x)[0],
    "sine": lambda x: exact_math.cos_sin(x)[1],
    "exponential": exact_math.exp_of_negative,
    "tanh": exact_math.tanh,
    **{f"power {eighths}": lambda x, k=eighths: exact_math.root_power(x, k) for eighths in EIGHTHS},
}


def in_lanes(function, lanes):
    @kernel
    def work(x: Matrix, out: Matrix) -> None:
        for n in loop(0, x.shape[0], lanes):
            write(function(read(x.first, n, 1, lanes)), out.first, n, 1)

    return work


alone = {name: in_lanes(function, 1) for name, function in FUNCTIONS.items()}
side_by_side = {name: in_lanes(function, LANES) for name, function in FUNCTIONS.items()}


def value(name, x):
    """A function of one number, in one lane."""
    given, found = np.array([x]), np.empty(1)
    alone[name](given, found)
    return float(found[0])


def cosine(x):
    return value("cosine", x)


def sine(x):
    return value("sine", x)


def exponential(x):
    return value("exponential", x)


def power(x, eighths):
    return value(f"power {eighths}", x)


@given(st.floats(-1e4, 1e4) | st.integers(-6000, 6000).map(lambda n: n * math.pi / 4))
@settings(deadline=None, max_examples=1000)
def test_cosine_and_sine(angle):
    with mpmath.workprec(120):
        assert abs(mpmath.cos(angle) - cosine(angle)) < 2e-16
        assert abs(mpmath.sin(angle) - sine(angle)) < 2e-16


@given(st.floats(MIN_EXPONENT, 0) | st.floats(-1e-3, 0))
@settings(deadline=None, max_examples=1000)
def test_exponential(x):
    with mpmath.workprec(120):
        assert abs(exponential(x) / mpmath.exp(x) - 1) < 1e-13


@given(st.floats(-30, 30) | st.floats(-1e-3, 1e-3))
@settings(deadline=None, max_examples=500)
def test_hyperbolic_tangent(x):
    with mpmath.workprec(120):
        assert abs(mpmath.tanh(x) - value("tanh", x)) < 1e-13
    assert value("tanh", -x) == -value("tanh", x)


@given(st.floats(-1e-14, -1e-300) | st.floats(-100, 0), st.floats(0, 10))
@settings(deadline=None, max_examples=300)
def test_the_exponential_falls_towards_its_floor(x, step):
    assert exponential(x - step) <= exponential(x) * (1 + 1e-13) <= 1 + 1e-13
    assert exponential(0.0) == 1
    assert exponential(-1e9) == exponential(MIN_EXPONENT)


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
    assert math.isnan(value("tanh", math.nan))
    assert all(math.isnan(power(math.nan, eighths)) for eighths in EIGHTHS)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_lane_has_the_bits_that_it_has_alone(name):
    low, high = {"exponential": (-50, 0), "tanh": (-25, 25)}.get(name, (-1e4, 1e4))
    low, high = (-0.1, 1) if "power" in name else (low, high)
    x, (out, one) = np.random.default_rng(0).uniform(low, high, 1000), np.empty((2, 1000))
    x[:5] = -0.0, 0.0, np.nan, np.inf, -np.inf
    side_by_side[name](x, out)
    alone[name](x, one)
    np.testing.assert_array_equal(out.view(np.int64), one.view(np.int64))
    few = np.empty(96)
    side_by_side[name].run_now(x[:96], few)
    np.testing.assert_array_equal(few, out[:96])
    plain = {
        "cosine": np.cos, "sine": np.sin, "tanh": np.tanh,
        "exponential": lambda x: np.exp(np.maximum(x, -40)),
    }.get(name) or (lambda x: np.maximum(x, 0.0) ** (int(name.split()[1]) / 8))  # fmt: skip
    with np.errstate(invalid="ignore"):
        np.testing.assert_allclose(out[5:], plain(x[5:]), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", ["exponential", "power 11"])
def test_ordinary_floats_are_taken_too(name):
    """Their products are rounded before they enter a sum."""
    for x in np.random.default_rng(1).uniform(-1, 0 if name == "exponential" else 1, 50).tolist():
        assert FUNCTIONS[name](x) == pytest.approx(value(name, x), rel=1e-14, abs=1e-300)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 assembly")
@pytest.mark.parametrize(
    ("name", "operation"),
    [("sine", "vfn?m(add|sub)[0-9]+pd"), ("exponential", "vfn?m(add|sub)[0-9]+pd"), ("power 12", "v?sqrtpd")],
)
def test_lanes_are_vector_code(name, operation):
    if "vf" in operation and not get_host_cpu_features().get("fma"):
        pytest.skip("a processor without fused operations")
    text = assembly_of(side_by_side[name])
    assert re.search(rf"\b{operation}\s", text)
    assert not re.search(r"\bv?(mul|add|sub|sqrt)sd\s", text)
