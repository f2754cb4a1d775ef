"""The functions of the crank angle in polynomials: good everywhere, fitted once, also if the crank rocks."""

import json
import pickle

import mpmath
import numpy as np
import pytest

from hoof_env.ground.contact import Ground
from hoof_env.leg import profile as profile_module
from hoof_env.leg.assembly import transmission_margin
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.profile import (
    CELLS,
    DERIVATIVE_ERROR,
    FUNCTIONS,
    SLOPED,
    LegProfile,
    functions,
    leg_profile,
)
from hoof_env.paper_solver.solver import ConstrainedLeg
from tests.legs import FIRST_FIT, PRESETS

LEG = load_geometry(FIRST_FIT)
SHORT = {"CF": 0.8 * LEG.lengths["CF"]}
IDENTIFIED = load_geometry("identified")
ROCKER = LEG.replace(lengths=SHORT, full_turn=False)


def errors(profile, theta):
    """Of values and derivatives, over the largest ones."""
    found, exact = profile(theta), functions(profile.geometry, theta)
    return [(np.abs(a - b).max(0) / np.abs(b).max(0)).max() for a, b in zip(found, exact, strict=True)]


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_it_is_the_closed_form(preset):
    profile = leg_profile(load_geometry(preset))
    value, slope = errors(profile, np.random.default_rng(0).uniform(-10, 10, 5000))
    assert value < 1e-11
    assert slope < 2 * profile.derivative_error < 2 * DERIVATIVE_ERROR


@pytest.mark.parametrize(("link", "longer"), [("PB", 1.04), ("EF", 1.1)])
def test_a_leg_nearer_to_a_dead_point_has_more_cells(link, longer):
    profile = LegProfile(IDENTIFIED.replace(lengths={link: longer * IDENTIFIED.lengths[link]}))
    value, slope = errors(profile, np.random.default_rng(0).uniform(-10, 10, 5000))
    assert profile.cells > leg_profile(IDENTIFIED).cells
    assert value < 1e-11
    assert slope < 2 * profile.derivative_error < 2 * DERIVATIVE_ERROR


@pytest.mark.parametrize("longer", [1.0, 1.01, 1.02, 1.04])
def test_the_number_of_cells_is_the_smallest_that_is_good_enough(longer):
    """Every smaller number is fitted in full, where the profile fits a sample of its cells first."""
    leg = IDENTIFIED.replace(lengths={"PB": longer * IDENTIFIED.lengths["PB"]})
    chosen = LegProfile(leg)
    smaller = [LegProfile(leg, cells) for cells in CELLS if cells <= chosen.cells]
    assert [profile.derivative_error < DERIVATIVE_ERROR for profile in smaller[:-1]] == [False] * (
        len(smaller) - 1
    )
    np.testing.assert_array_equal(chosen.table, smaller[-1].table)


def test_a_sample_tells_that_cells_are_too_large(monkeypatch):
    fitted, fit = [], profile_module._fit
    monkeypatch.setattr(
        profile_module,
        "_fit",
        lambda leg, chosen, cells: fitted.append((len(chosen), cells)) or fit(leg, chosen, cells),
    )
    assert LegProfile(IDENTIFIED).cells == 1280
    assert fitted == [(64, 1024), (80, 1280), (1280, 1280)]


@pytest.mark.parametrize(("far", "bound"), [(1e6, 1e-9), (1e9, 1e-6)])
def test_a_crank_that_has_turned_far_is_as_good_as_its_angle(far, bound):
    theta = np.linspace(0, 2 * np.pi, 1000) + np.round(far / (2 * np.pi)) * (2 * np.pi)
    with mpmath.workdps(40):
        back = np.array([float(x - np.round(x / (2 * np.pi)) * 2 * mpmath.pi) for x in theta.tolist()])
    assert np.abs(leg_profile(LEG)(theta)[0] - functions(LEG, back)[0]).max() < bound


def test_legs_that_are_equal_share_it():
    assert leg_profile(LEG) is leg_profile(LEG.replace())
    assert leg_profile(LEG) is not leg_profile(LEG.replace(linear_density=2.0))
    finer = leg_profile(LEG).with_cells(2048)
    assert finer is leg_profile(LEG).with_cells(2048)
    assert finer.cells == 2048


def test_a_leg_that_cannot_turn_may_be_asked_for():
    assert not ROCKER.full_turn
    assert ROCKER != LEG
    assert Geometry.from_dict(json.loads(json.dumps(ROCKER.to_dict()))) == ROCKER
    assert pickle.loads(pickle.dumps(ROCKER)) == ROCKER
    assert "full_turn" not in LEG.to_dict()
    assert transmission_margin(ROCKER) == 0.0


def test_of_a_crank_that_rocks_it_knows_where_the_links_have_a_place():
    profile, theta = LegProfile(ROCKER), np.linspace(0, 2 * np.pi, 7200)
    has_place = np.isfinite(functions(ROCKER, theta)[0]).all(1)
    known = np.isfinite(profile(theta)[0])
    assert (known.all(1) == known.any(1)).all()
    assert not (known[:, 0] & ~has_place).any()
    lost = np.degrees(np.ptp(theta[has_place & ~known[:, 0] & (theta < np.pi)]))
    assert 0 < lost < 1.5  # beside the end, where derivatives grow without bound
    value, slope = errors(profile, theta[known[:, 0]])
    assert value < 1e-11
    assert slope < 2 * DERIVATIVE_ERROR
    assert profile.derivative_error <= DERIVATIVE_ERROR


def test_the_papers_solver_takes_a_leg_that_turns_but_need_not():
    ConstrainedLeg(LEG.replace(full_turn=False), Ground())


@pytest.mark.parametrize("leg", [LEG, ROCKER], ids=["turns", "rocks"])
def test_no_angles_have_no_values(leg):
    value, slope = leg_profile(leg)(np.empty(0))
    assert value.shape == (0, FUNCTIONS)
    assert slope.shape == (0, SLOPED)
