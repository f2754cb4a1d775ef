"""Friction for lanes is friction as it is, and a lane has the bits that it has alone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from hoof_env.ground import laws
from hoof_env.ground.laws import AMBROSIO, TANH, THRELFALL
from hoof_env.simd import read, rows, write
from hoof_env.simd.memory import address, doubles
from tests.oracle import laws as oracle

LAWS = (AMBROSIO, THRELFALL, TANH)


@njit(error_model="numpy")
def friction_part(speed, law, slow, fast):
    return laws.friction_part(speed, law, slow, fast)


def test_the_laws_have_the_numbers_that_records_have():
    assert [laws.FRICTION_LAWS[law] for law in LAWS] == ["ambrosio", "threlfall", "tanh"]


@given(speed=st.floats(0, 20) | st.floats(0, 0.02), law=st.sampled_from(LAWS), slow=st.floats(0, 0.01))
@settings(deadline=None, max_examples=500)
def test_friction_is_that_of_the_law(speed, law, slow):
    expected = oracle.friction_coefficient(speed, law, 1.0, slow, slow + 0.02)
    assert friction_part(speed, law, slow, slow + 0.02) == pytest.approx(expected, rel=0, abs=1e-13)


def test_what_is_not_a_number_stays_so():
    assert all(math.isnan(friction_part(math.nan, law, 1e-3, 1e-2)) for law in LAWS)


@njit(error_model="numpy")
def all_lanes(speed, law, out):
    row = rows(doubles(8), 8, None)
    for n in range(0, speed.size, 8):
        part = laws.friction_part(read(row, address(speed), n, 1), law, 1e-3, 1e-2)
        write(part, address(out), n, 1)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("count", [8, 64, 1000])
def test_a_lane_has_the_bits_that_it_has_alone(law, count):
    speed = np.abs(np.random.default_rng(count).normal(scale=0.02, size=count))
    together = np.empty(count)
    all_lanes(speed, law, together)
    alone = np.array([friction_part(v, law, 1e-3, 1e-2) for v in speed])
    np.testing.assert_array_equal(together.view(np.int64), alone.view(np.int64))
