"""Paths of the linkage and of the hoof are those of the product; and what is read off a cycle."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env.leg.geometry import load_geometry, tables
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS
from research.identify.features import FEATURES, Cycle, measure_gait
from research.identify.leg import NUMBER, encode
from research.identify.measure import leg_paths, swing_hoof
from research.identify.objective import Objective
from tests.legs import FIRST_FIT

GEOMETRY = load_geometry(FIRST_FIT)
SETUP = Objective(encode(FIRST_FIT)[0])._setup


def paths(n=9, **longer):
    """Every point over a revolution, its rates, miss and transmission; some lengths may be longer."""
    values = tables(GEOMETRY)[1]
    values[2, 1] += longer.get("PF", 0.0)
    z, dz = np.zeros((2, len(POINTS), n), np.complex128)
    return z, dz, *leg_paths(GEOMETRY.lengths["OP"], complex(*GEOMETRY.pivot), values, z, dz)


def test_the_paths_are_those_of_the_product():
    z, dz, miss, transmission = paths()
    assert miss <= 0
    assert transmission >= GEOMETRY.transmission_margin - 1e-9
    mirror = np.array([GEOMETRY.travel, 1.0])
    for k, theta in enumerate(np.linspace(0, 2 * np.pi, 9)):
        there = pose(GEOMETRY, theta, 1.0)
        np.testing.assert_allclose(
            np.stack([z[:, k].real, z[:, k].imag], 1) * mirror, there.points, atol=1e-12
        )
        rates = np.stack([dz[:, k].real, dz[:, k].imag], 1) * mirror
        np.testing.assert_allclose(rates, there.point_velocities, atol=1e-8)


def test_the_hoof_swings_as_in_the_product():
    z, dz, _, _ = paths()
    gait = np.array([3.0, 0.4, -0.3, 0.2])
    at, velocity, ankle = *np.zeros((2, 2, 9), np.complex128), np.zeros(9)
    lowest = swing_hoof(z, dz, gait, SETUP, at, velocity, ankle)
    others = []
    for k, theta in enumerate(np.linspace(0, 2 * np.pi, 9)):
        phi = gait[1] + gait[2] * np.sin(theta) + gait[3] * np.cos(theta)
        rate = 3.0 * (gait[2] * np.cos(theta) - gait[3] * np.sin(theta))
        there = pose(GEOMETRY, theta, 3.0, frame=FrameMotion(phi, rate))
        for i, corner in enumerate((SETUP.toe, SETUP.heel)):
            assert at[i, k] == pytest.approx(complex(*there.points[corner]), abs=1e-10)
            assert velocity[i, k] == pytest.approx(complex(*there.point_velocities[corner]), abs=1e-8)
        assert ankle[k] == pytest.approx(there.point("G")[1], abs=1e-10)
        others += [there.point(name)[1] for name in POINTS if NUMBER[name] not in (SETUP.toe, SETUP.heel)]
    assert lowest == pytest.approx(min(others), abs=1e-10)


def test_a_leg_that_does_not_close_misses():
    z, dz, miss, _ = paths(PF=3.0)
    assert miss > 0.01
    assert np.isfinite(z).all()
    assert np.isfinite(dz).all()


def measured(at, velocity, out):
    cycle = Cycle(at, velocity, np.ones(101), 0.0, 0.01, False, 2e4, 1.5)
    return measure_gait(cycle, np.zeros((6, 101)), out)


def test_points_that_begin_in_the_ground_and_have_no_whole_contact_have_no_stance():
    """The toe leaves and comes back, the heel leaves: neither has a first contact before its last."""
    t = np.linspace(0, 1, 101)
    at = 1j * np.array([(t - 0.1) * (0.3 - t), t - 0.5])
    velocity = 1j * np.array([0.4 - 2 * t, np.ones_like(t)])
    out = np.full(1, np.nan, FEATURES)
    assert not measured(at, velocity, out[0])
    assert np.isnan(out["contact_start"][0])
    assert out["start_depth"][0] == pytest.approx(0.5)
    whole = 1j * np.array([0.01 - (t - 0.3) * (0.6 - t), 0.02 - (t - 0.3) * (0.6 - t)])  # the same way, once
    rates = 1j * np.array([2 * t - 0.9, 2 * t - 0.9])
    assert measured(whole, rates, out[0])
    assert 0.3 < out["contact_start"][0] < out["contact_end"][0] < 0.6
