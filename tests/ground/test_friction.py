"""Friction opposes sliding, is bounded by mu_k times the normal force and never gives energy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.ground.laws import FRICTION_LAWS
from tests.ground.compiled_laws import friction_coefficient, friction_force

KINETIC, SLOW, FAST = 0.4, 1e-3, 1e-2
laws = st.sampled_from(range(len(FRICTION_LAWS)))
speeds = st.floats(-20, 20) | st.floats(-0.02, 0.02)


@given(law=laws, v=speeds, normal=st.floats(0, 1e4), mu=st.floats(0, 3), slow=st.floats(0, 0.01))
@settings(deadline=None, max_examples=200)
def test_it_opposes_sliding_within_its_bound_and_is_odd(law, v, normal, mu, slow):
    force = friction_force(v, normal, law, mu, slow, slow + 0.02)
    assert force * v <= 0
    assert abs(force) <= mu * normal * (1 + 1e-15)
    assert friction_force(-v, normal, law, mu, slow, slow + 0.02) == -force


@given(law=laws, a=st.floats(0, 0.05), b=st.floats(0, 0.05))
@settings(deadline=None, max_examples=100)
def test_it_grows_with_speed(law, a, b):
    slower, faster = (friction_coefficient(v, law, KINETIC, SLOW, FAST) for v in sorted((a, b)))
    assert slower <= faster


@pytest.mark.parametrize("law", range(len(FRICTION_LAWS)))
def test_it_has_no_jump(law):
    speeds = np.linspace(0, 0.03, 30001)
    mu = np.array([friction_coefficient(v, law, KINETIC, SLOW, FAST) for v in speeds])
    assert mu[0] == 0
    assert np.abs(np.diff(mu)).max() < 3 * KINETIC * 1e-6 / (FAST - SLOW) * 1.2


def test_the_three_regimes_of_ambrosio():
    law = FRICTION_LAWS.index("ambrosio")
    for speed, part in (
        (0.0, 0),
        (0.5 * SLOW, 0),
        (SLOW, 0),
        (0.5 * (SLOW + FAST), 0.5),
        (FAST, 1),
        (3.0, 1),
    ):
        assert friction_coefficient(speed, law, KINETIC, SLOW, FAST) == pytest.approx(
            part * KINETIC, abs=1e-12
        )
    assert friction_force(2.0, 100.0, law, KINETIC, SLOW, FAST) == pytest.approx(-40.0)


def test_threlfall_and_tanh():
    law = FRICTION_LAWS.index("threlfall")
    assert friction_coefficient(FAST / 2, law, KINETIC, SLOW, FAST) == pytest.approx(
        KINETIC * (1 - np.exp(-1.5))
    )
    # above its threshold Threlfall's coefficient stays at 0.95 mu_k
    assert friction_coefficient(FAST, law, KINETIC, SLOW, FAST) == pytest.approx(0.95 * KINETIC, rel=1e-3)
    assert friction_coefficient(5.0, law, KINETIC, SLOW, FAST) == friction_coefficient(
        FAST, law, KINETIC, SLOW, FAST
    )
    law = FRICTION_LAWS.index("tanh")
    assert friction_coefficient(FAST, law, KINETIC, SLOW, FAST) == pytest.approx(KINETIC * np.tanh(1))


def test_a_resting_point_feels_none():
    for law in range(len(FRICTION_LAWS)):
        assert friction_force(0.0, 1e3, law, KINETIC, SLOW, FAST) == 0.0
