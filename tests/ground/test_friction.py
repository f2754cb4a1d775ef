"""Friction opposes sliding, is bounded by mu_k times the normal force and never gives energy; a lane has the
bits that it has alone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.ground import laws
from hoof_env.ground.laws import AMBROSIO, FRICTION_LAWS, TANH, THRELFALL
from hoof_env.simd import Matrix, loop, read, write
from hoof_env.simd.compile import Kernel
from tests.ground.plain_laws import friction_coefficient, friction_force
from tests.oracle import laws as oracle

KINETIC, SLOW, FAST = 0.4, 1e-3, 1e-2
LAWS = (AMBROSIO, THRELFALL, TANH)
some_law = st.sampled_from(LAWS)


def part(speed, law):
    """Of the kinetic coefficient."""
    return friction_coefficient(speed, law, 1.0, SLOW, FAST)


def test_the_laws_have_the_numbers_that_records_have():
    assert [FRICTION_LAWS[law] for law in LAWS] == ["ambrosio", "threlfall", "tanh"]


@given(
    law=some_law, v=st.floats(-20, 20) | st.floats(-0.02, 0.02) | st.just(0.0), normal=st.floats(0, 1e4),
    mu=st.floats(0, 3), slow=st.floats(0, 0.01),
)  # fmt: skip
@settings(deadline=None, max_examples=500)
def test_friction_follows_its_law_opposes_sliding_within_its_bound_and_is_odd(law, v, normal, mu, slow):
    force = friction_force(v, normal, law, mu, slow, slow + 0.02)
    assert force * v <= 0
    assert abs(force) <= mu * normal * (1 + 1e-15)
    assert friction_force(-v, normal, law, mu, slow, slow + 0.02) == -force
    found, expected = (
        coefficient(abs(v), law, 1.0, slow, slow + 0.02)
        for coefficient in (friction_coefficient, oracle.friction_coefficient)
    )
    assert found == pytest.approx(expected, rel=0, abs=1e-13)


@given(law=some_law, a=st.floats(0, 0.05), b=st.floats(0, 0.05))
@settings(deadline=None, max_examples=100)
def test_it_grows_with_speed(law, a, b):
    assert part(min(a, b), law) <= part(max(a, b), law)


@pytest.mark.parametrize("law", LAWS)
def test_it_begins_at_rest_and_has_no_jump(law):
    parts = np.array([part(v, law) for v in np.linspace(0, 0.03, 30001)])
    assert parts[0] == friction_force(0.0, 1e3, law, KINETIC, SLOW, FAST) == 0
    assert np.abs(np.diff(parts)).max() < 3 * 1e-6 / (FAST - SLOW) * 1.2
    assert math.isnan(part(math.nan, law))


@pytest.mark.parametrize(
    ("law", "speed", "expected"),
    [
        (AMBROSIO, 0.5 * SLOW, 0), (AMBROSIO, SLOW, 0), (AMBROSIO, 0.5 * (SLOW + FAST), 0.5),
        (AMBROSIO, FAST, 1), (AMBROSIO, 3.0, 1),
        (THRELFALL, FAST / 2, 1 - np.exp(-1.5)), (THRELFALL, FAST, 1 - np.exp(-3)),  # 0.95, and stays there
        (THRELFALL, 5.0, 1 - np.exp(-3)), (TANH, FAST, np.tanh(1)),
    ],
)  # fmt: skip
def test_regimes(law, speed, expected):
    assert part(speed, law) == pytest.approx(expected, abs=1e-12)


def in_lanes(lanes, law):
    """A kernel that fills its second array from its first."""

    def fill(speed, out):
        for n in loop(0, speed.shape[0], lanes):
            write(laws.friction_part(read(speed.first, n, 1, lanes), law, SLOW, FAST), out.first, n, 1)

    return Kernel(fill, [Matrix, Matrix])


@pytest.mark.parametrize("law", LAWS)
def test_a_lane_has_the_bits_that_it_has_alone(law):
    speed = np.abs(np.random.default_rng(0).normal(scale=0.02, size=1000))
    together, alone = np.empty((2, 1000))
    for lanes, out in ((8, together), (1, alone)):
        in_lanes(lanes, law)(speed, out)
    np.testing.assert_array_equal(together.view(np.int64), alone.view(np.int64))
    plain = [part(v, law) for v in speed.tolist()]  # which is not fused
    np.testing.assert_allclose(together, plain, rtol=0, atol=1e-13)
