"""Links weigh what a horse's limb weighs: the published masses, from the hip to the hoof."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.gait import load_gait
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.limb_masses import carriers, segment_masses, trunk_mass, with_limb_masses
from tests.legs import FIRST_FIT, PRESETS
from tests.linkage import BODY_LENGTHS

LEG = load_geometry(FIRST_FIT)

PUBLISHED = {"fore": [20.1, 6.7, 1.59, 0.73, 1.08], "hind": [18.6, 8.3, 2.84, 0.89, 0.99]}
"""Golden: Buchner and others 1997, Table 1, for 538 kg [kg]."""


@pytest.mark.parametrize("limb", PUBLISHED)
def test_segments_are_the_published_ones(limb):
    assert list(segment_masses(limb, 538.0).values()) == pytest.approx(PUBLISHED[limb])


@given(limb=st.sampled_from(list(PUBLISHED)), body_mass=st.floats(20, 1000), size=st.floats(0.1, 2))
@settings(deadline=None, max_examples=20)
def test_masses_of_links_sum_to_the_published_ones(limb, body_mass, size):
    leg = LEG.scaled(size)
    given_masses = with_limb_masses(leg, limb, body_mass)
    assert given_masses.mass == pytest.approx(sum(PUBLISHED[limb]) * body_mass / 538)
    assert given_masses == leg.replace(masses=given_masses.masses)  # and nothing else has changed
    by_link = dict(zip(BODY_LENGTHS, given_masses.masses, strict=True))
    for links, mass in zip(carriers(), PUBLISHED[limb], strict=True):
        densities = [by_link[name] / leg.lengths[name] for name in links]
        assert densities == pytest.approx([densities[0]] * len(links))
        assert sum(by_link[name] for name in links) == pytest.approx(mass * body_mass / 538)


def test_every_link_carries_one_segment():
    assert sorted(name for links in carriers() for name in links) == sorted(BODY_LENGTHS)


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_segments_follow_each_other_from_hip_to_ground(preset):
    """By the mean heights of the links' centres in the walk: the highest link of a segment lies below the
    lowest of the segment before it."""
    leg, gait = load_geometry(preset), load_gait("walk", preset)
    heights = []
    for theta in np.linspace(0, 2 * np.pi, 200, endpoint=False):
        phi = gait.swing_offset + gait.swing_sin * np.sin(theta) + gait.swing_cos * np.cos(theta)
        at = pose(leg, theta, frame=FrameMotion(phi=phi, position=(0.0, leg.hip_height)))
        heights.append(at.centres[:, 1])
    height = dict(zip(BODY_LENGTHS, np.mean(heights, 0), strict=True))
    for upper, lower in pairwise(carriers()):
        assert min(height[name] for name in upper) > max(height[name] for name in lower)


def test_trunk_and_limbs_are_the_animal():
    limbs = 2 * sum(sum(PUBLISHED[limb]) for limb in PUBLISHED)
    assert trunk_mass(538.0) == pytest.approx(538 - limbs)
    assert trunk_mass(538.0) > 352 + 23.1 + 26.8  # trunk, head and neck
    legs = 2 * sum(with_limb_masses(LEG, limb).mass for limb in PUBLISHED)
    assert trunk_mass() + legs == pytest.approx(475.0)


def test_it_says_whose_masses_it_has():
    leg = with_limb_masses(LEG, "hind", body_mass=500)
    assert leg.provenance.startswith(LEG.provenance)
    assert "hind limb of a horse of 500 kg (Buchner" in leg.provenance
    assert leg.name == LEG.name
