"""A scaled leg is a similar one: lengths go with the factor, moments and inertias with mass and length."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.kinematics import pose
from hoof_env.leg.profile import by_name, functions
from tests.legs import FIRST_FIT, PRESETS

LEG = load_geometry(FIRST_FIT)
OWN = LEG.replace(masses=tuple(np.linspace(3, 0.2, 14)))
THETA = np.linspace(0, 2 * np.pi, 50)

LENGTHS = ("toe_x", "toe_y", "heel_x", "heel_y")
FIRST_MOMENTS = ("first_moment_x", "first_moment_y", "moment_slope_x", "moment_slope_y")
INERTIAS = ("crank_inertia", "coupling", "frame_inertia", "frame_inertia_slope")


def profile(leg):
    return by_name(functions(leg, THETA)[0])


def near(found, expected):
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


@given(factor=st.floats(0.05, 20), density=st.none() | st.floats(0.01, 100), leg=st.sampled_from([LEG, OWN]))
@settings(deadline=None, max_examples=25)
def test_lengths_moments_and_inertias_are_similar(factor, density, leg):
    scaled = leg.scaled(factor, density)
    near(scaled.body_lengths, factor * leg.body_lengths)
    assert scaled.hip_height == factor * leg.hip_height
    near(pose(scaled, 0.7).points, factor * pose(leg, 0.7).points)

    same_masses = leg if density is None else LEG.replace(linear_density=density)
    mass = scaled.mass / same_masses.mass
    assert mass == pytest.approx(factor)
    near(scaled.body_masses, mass * same_masses.body_masses)
    near(scaled.body_inertias, mass * factor**2 * same_masses.body_inertias)
    found, before = profile(scaled), profile(same_masses)
    for names, ratio in ((LENGTHS, factor), (FIRST_MOMENTS, mass * factor), (INERTIAS, mass * factor**2)):
        for name in names:
            near(found[name], ratio * before[name])


@given(one=st.floats(0.2, 5), two=st.floats(0.2, 5))
@settings(deadline=None, max_examples=10)
def test_factors_multiply(one, two):
    twice, once = OWN.scaled(one).scaled(two), OWN.scaled(one * two)
    near(twice.body_lengths, once.body_lengths)
    near(twice.body_masses, once.body_masses)
    assert twice.pivot == pytest.approx(once.pivot)


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_a_factor_of_one_changes_no_bit(preset):
    leg = load_geometry(preset)
    same = leg.scaled(1)
    assert same == leg
    assert same.provenance == f"{leg.provenance} Scaled by 1."
    assert (same.body_masses == leg.body_masses).all()
    assert (same.body_inertias == leg.body_inertias).all()


def test_the_printed_inertia_knows_no_mass():
    leg = LEG.replace(inertia="paper")
    near(leg.scaled(0.5, 3.0).body_inertias, 0.5 * leg.body_inertias)


def test_a_leg_that_rocks_still_rocks():
    rocker = LEG.replace(lengths={"CF": 0.8 * LEG.lengths["CF"]}, full_turn=False)
    assert not rocker.scaled(2.0).full_turn


def test_it_is_saved_and_read(tmp_path):
    leg = OWN.scaled(0.3)
    leg.save(tmp_path / "leg.json")
    assert load_geometry(tmp_path / "leg.json") == leg
    assert Geometry.from_dict(leg.to_dict()).provenance == leg.provenance
