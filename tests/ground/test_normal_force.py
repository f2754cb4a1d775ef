"""Normal laws against what they claim: the rebound of a free impact, no pull, no energy from nowhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hoof_env.ground.laws import (
    FACTORS,
    NORMAL_LAWS,
    damping,
    exact,
    restitution_of_damping_ratio,
    restitution_of_factor,
)
from tests.ground.plain_laws import normal_force

# Golden: restitution that a free impact returns, by law and nominal cr; from a table computed with another
# program, whose ODE solutions for n = 1, 1.5 and 2 agreed with it. None: the damping has no bound there.
RESTITUTION = {
    "lankarani-nikravesh": {0: 0.663, 0.1: 0.665, 0.3: 0.684, 0.5: 0.725, 0.7: 0.796, 0.8: 0.847, 0.9: 0.913},
    "hunt-crossley": {0: 0.488, 0.1: 0.516, 0.3: 0.581, 0.5: 0.663, 0.7: 0.768, 0.8: 0.833, 0.9: 0.909},
    "flores": {0: None, 0.1: 0.069, 0.3: 0.256, 0.5: 0.470, 0.7: 0.683, 0.8: 0.789, 0.9: 0.894},
    "gonthier": {0: None, 0.1: 0.101, 0.3: 0.304, 0.5: 0.488, 0.7: 0.670, 0.8: 0.768, 0.9: 0.876},
    "hu-guo": {0: None, 0.1: 0.074, 0.3: 0.271, 0.5: 0.488, 0.7: 0.697, 0.8: 0.799, 0.9: 0.900},
}
# Golden, same table: the factor that returns cr exactly
EXACT_FACTOR = {0.1: 9.998, 0.3: 3.087, 0.5: 1.433, 0.7: 0.635, 0.8: 0.373, 0.9: 0.1665}

REFERENCE_MASS = 80.0

impacts = st.fixed_dictionaries(
    {
        "stiffness": st.floats(1e3, 1e6),
        "mass": st.floats(0.1, 200.0),
        "exponent": st.floats(1.0, 3.0),
        "speed": st.floats(0.01, 10.0),
    }
)


def rebound(law, cr, stiffness, mass, exponent, speed, reference_mass=REFERENCE_MASS):
    """Speed after a free impact over speed before, by integrating the force that the kernel gives."""
    chi, dashpot = damping(law, cr, stiffness, reference_mass)
    elastic = (exponent + 1) * mass * speed**2 / (2 * stiffness)
    depth = elastic ** (1 / (exponent + 1))

    def motion(_, state):
        penetration, rate = state[0] * depth, state[1] * speed
        force = normal_force(penetration, rate, speed, stiffness, exponent, chi, dashpot)
        return rate / speed, -force * depth / (mass * speed**2)

    def leaves(_, state):
        return state[0]

    leaves.terminal, leaves.direction = True, -1
    accuracy = {"rtol": 1e-9, "atol": 1e-12, "max_step": 0.2 if cr > 0.2 else np.inf}
    path = solve_ivp(motion, (0, 1e4), (0.0, 1.0), events=leaves, **accuracy)
    assert path.status == 1
    return -path.y[1, -1]


@pytest.mark.parametrize(
    ("law", "cr"),
    [(law, cr) for law in FACTORS for cr in (0.0, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 1.0)
     if cr > 0 or RESTITUTION.get(law, {}).get(0)],
)  # fmt: skip
@given(impact=impacts)
@settings(deadline=None, max_examples=3)
def test_a_free_impact_returns_what_the_factor_says(law, cr, impact):
    chi, _ = damping(law, cr, impact["stiffness"], REFERENCE_MASS)
    assert rebound(law, cr, **impact) == pytest.approx(restitution_of_factor(chi), abs=1e-5)


@pytest.mark.parametrize(
    ("law", "cr"), [(law, cr) for law in RESTITUTION for cr in RESTITUTION[law] if RESTITUTION[law][cr]]
)
def test_restitution_of_the_published_laws(law, cr):
    chi, _ = damping(law, cr, 2e4, REFERENCE_MASS)
    assert restitution_of_factor(chi) == pytest.approx(RESTITUTION[law][cr], abs=6e-4)


@pytest.mark.parametrize(("cr", "factor"), EXACT_FACTOR.items())
def test_the_exact_factor(cr, factor):
    assert exact(cr) == pytest.approx(factor, rel=5e-4)
    assert restitution_of_factor(exact(cr)) == pytest.approx(cr, abs=1e-12)


@given(cr=st.floats(0.05, 1.0), impact=impacts)
@settings(deadline=None, max_examples=15)
def test_the_exact_law_returns_cr_and_kelvin_voigt_at_its_reference_mass(cr, impact):
    assert rebound("exact", cr, **impact) == pytest.approx(cr, abs=1e-5)
    impact = {**impact, "exponent": 1.0}
    assert rebound("kelvin-voigt", cr, **impact, reference_mass=impact["mass"]) == pytest.approx(cr, abs=1e-5)


def test_kelvin_voigt_returns_another_restitution_at_another_mass():
    light, heavy = (
        rebound("kelvin-voigt", 0.5, stiffness=2e4, mass=mass, exponent=1.0, speed=1.0)
        for mass in (20.0, 320.0)
    )
    assert light < 0.5 < heavy


def test_the_restitution_of_a_damping_ratio_has_no_seam():
    for seam in (1.0, np.sqrt(0.5)):
        below, at, above = (restitution_of_damping_ratio(seam + step) for step in (-1e-7, 0.0, 1e-7))
        assert below == pytest.approx(at, rel=1e-6)
        assert above == pytest.approx(at, rel=1e-6)


@pytest.mark.parametrize("law", NORMAL_LAWS)
@given(
    cr=st.floats(0.01, 1.0), d=st.floats(-1.0, 1.0), rate=st.floats(-50.0, 50.0), v0=st.floats(1e-4, 10.0),
    exponent=st.floats(1.0, 3.0),
)  # fmt: skip
@settings(deadline=None, max_examples=40)
def test_the_ground_never_pulls_and_acts_inside_only(law, cr, d, rate, v0, exponent):
    force = normal_force(d, rate, v0, 2e4, exponent, *damping(law, cr, 2e4, REFERENCE_MASS))
    assert force >= 0
    assert d > 0 or force == 0


@pytest.mark.parametrize("law", NORMAL_LAWS)
@given(
    cr=st.floats(0.01, 1.0), depths=st.lists(st.floats(0.0, 0.1), min_size=2, max_size=5),
    v0=st.floats(1e-3, 5.0), period=st.floats(0.05, 2.0), exponent=st.floats(1.0, 3.0),
)  # fmt: skip
@settings(deadline=None, max_examples=20)
def test_a_closed_loop_gives_no_energy(law, cr, depths, v0, period, exponent):
    """Work on the ground around a closed path in penetration: none if it is elastic, else never negative."""
    phase = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    waves = [a * np.sin((k + 1) * phase + k) for k, a in enumerate(depths)]
    slopes = [a * (k + 1) * np.cos((k + 1) * phase + k) for k, a in enumerate(depths)]
    path, rate = np.sum(waves, axis=0) + 0.02, np.sum(slopes, axis=0) * 2 * np.pi / period
    for restitution in (1.0, cr):
        chi, dashpot = damping(law, restitution, 2e4, REFERENCE_MASS)
        power = [
            normal_force(d, r, v0, 2e4, exponent, chi, dashpot) * r for d, r in zip(path, rate, strict=True)
        ]
        scale = np.mean(np.abs(power)) + 1e-12
        if restitution == 1.0:
            assert abs(np.mean(power)) < 1e-4 * scale
        assert np.mean(power) > -1e-4 * scale


@pytest.mark.parametrize("law", FACTORS)
@pytest.mark.parametrize("rate", [-5.0, 0.0, 5.0])
def test_the_force_starts_from_nothing(law, rate):
    chi, dashpot = damping(law, 0.3, 2e4, REFERENCE_MASS)
    assert normal_force(0.0, rate, 0.5, 2e4, 1.5, chi, dashpot) == 0.0
    assert normal_force(1e-8, rate, 0.5, 2e4, 1.5, chi, dashpot) < 1e-5


def test_the_elastic_force_is_the_spring_alone():
    assert {damping(law, 1.0, 2e4, REFERENCE_MASS) for law in NORMAL_LAWS} == {(0.0, 0.0)}
    assert normal_force(0.04, -3.0, 0.1, 2e4, 1.5, 0.0, 0.0) == pytest.approx(2e4 * 0.04**1.5)
