"""Damping can only add force where the motion is prescribed, and takes speed where the trunk can move."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks import elasticity
from benchmarks.elasticity_runs import (
    GAITS,
    HELD,
    PAPER_LAW,
    RISES,
    SETUPS,
    balanced,
    delivered,
    free_mass,
    ground_of,
    landing,
    steady,
)
from benchmarks.pages import filled
from benchmarks.prescribed import contact_on
from hoof_env.ground.laws import FACTORS, NORMAL_LAWS


@pytest.fixture(scope="module")
def data():
    return json.loads(elasticity.DATA.read_text(encoding="utf-8"))


def landing_change(gait, trunk):
    return elasticity.change(*(landing(gait, trunk, ground_of(PAPER_LAW, cr)) for cr in (1.0, 0.0)))


@pytest.mark.parametrize("law", NORMAL_LAWS)
@pytest.mark.parametrize("gait", GAITS)
def test_in_a_prescribed_motion_damping_adds_force_at_every_instant_of_loading(gait, law):
    elastic = contact_on(gait, ground_of(PAPER_LAW, 1.0))
    for restitution in (0.75, 0.25, 0.0):
        damped = contact_on(gait, ground_of(law, restitution))
        inside = elastic.depth > 0.0
        loading = inside & (elastic.rate > 0.0)
        unloading = inside & (elastic.rate < 0.0)
        assert loading.sum() > 100
        assert (damped.force[loading] >= elastic.force[loading]).all()
        assert (damped.force[unloading] <= elastic.force[unloading]).all()
        assert damped.peak > elastic.peak


def test_the_paper_has_its_reductions_under_the_fixed_trunk():
    assert landing_change("run", SETUPS["fixed"]) == pytest.approx(-35.0, abs=1.0)
    assert landing_change("walk", SETUPS["fixed"]) == pytest.approx(-61.5, abs=1.0)


@pytest.mark.parametrize("gait", GAITS)
def test_nothing_is_left_of_them_under_the_suspended_trunk(gait):
    assert -6.0 < landing_change(gait, SETUPS["suspended"]) < 6.0
    # A higher floor of the approach speed needs fewer substeps, and no touch-down here is slower
    peaks = [steady(gait, SETUPS["suspended"], ground_of(PAPER_LAW, cr, 0.1)).peak for cr in (1.0, 0.0)]
    assert -6.0 < elasticity.change(*peaks) < 6.0


@pytest.mark.parametrize("gait", GAITS)
def test_elastic_ground_hits_a_free_trunk_harder(gait):
    assert landing_change(gait, SETUPS["free"]) > 10.0


@pytest.mark.parametrize("gait", GAITS)
def test_a_heavy_trunk_is_a_fixed_one(gait):
    fixed = landing_change(gait, SETUPS["fixed"])
    apart = [abs(landing_change(gait, balanced(mass)) - fixed) for mass in (1e2, 1e3, 1e4, 1e6)]
    assert apart == sorted(apart, reverse=True)
    assert apart[-1] < 0.1


def test_most_of_the_reduction_of_the_walk_is_gone_a_tenth_of_a_millimetre_away():
    def change(rise):
        peaks = [contact_on("walk", ground_of(PAPER_LAW, cr), rise).peak for cr in (1.0, 0.0)]
        return elasticity.change(*peaks)

    assert change(0.0) < -60.0
    assert min(change(rise) for rise in (-3e-4, 3e-4)) > -45.0
    assert np.median([change(rise) for rise in RISES]) == pytest.approx(-26.7, abs=1.0)


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("restitution", [1.0, 0.0])
def test_engine_and_prescribed_motion_agree_under_a_fixed_trunk(gait, restitution):
    ground = ground_of(PAPER_LAW, restitution)
    for rise in (0.0, 5e-4):
        simulated = landing(gait, SETUPS["fixed"], ground, rise)
        assert simulated == pytest.approx(contact_on(gait, ground, rise).peak, rel=2e-4)


@pytest.mark.parametrize("chi", [0.75, 3.0, 20.0])
def test_the_force_of_a_free_mass_follows_from_its_motion(chi):
    """Simulated for one mass, stiffness and speed; the formula needs none of them."""
    mass, stiffness, n, speed = 7.0, 3e4, 1.375, 0.8

    def force(depth, rate):
        return stiffness * np.maximum(depth, 0.0) ** n * (1 + chi * rate / speed)

    def peak(law):
        found = solve_ivp(
            lambda t, y: (y[1], -law(*y) / mass), (0, 0.2), (0, speed), rtol=1e-9, max_step=1e-4
        )
        return law(*found.y).max()

    elastic = peak(lambda depth, rate: stiffness * np.maximum(depth, 0.0) ** n)
    assert peak(force) / elastic == pytest.approx(free_mass(chi, n), rel=1e-3)


def test_the_paper_calls_ground_inelastic_that_returns_two_thirds():
    assert delivered(PAPER_LAW, 0.0) == pytest.approx(0.663, abs=1e-3)
    assert free_mass(FACTORS[PAPER_LAW](0.0), 1.375) == pytest.approx(0.914, abs=1e-3)


def test_the_page_has_the_tables_of_its_data(data):
    page = elasticity.PAGE.read_text(encoding="utf-8")
    assert filled(page, elasticity.tables(data)) == page


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("setup", SETUPS)
def test_the_data_agree_with_the_present_engine(data, gait, setup):
    for law, restitution in ((PAPER_LAW, 0.0), ("exact", 0.5), ("kelvin-voigt", 0.25)):
        row = elasticity.find(data["landings"], gait=gait, setup=setup, law=law, restitution=restitution)
        peak = landing(gait, SETUPS[setup], ground_of(law, restitution))
        assert peak == pytest.approx(row["peak"], rel=1e-6)


def test_mujoco_found_the_same_in_the_data(data):
    for row in data["mujoco"]["landings"]:
        for restitution in ("1", "0"):
            own = elasticity.find(
                data["landings"], gait=row["gait"], setup=row["setup"], law=PAPER_LAW, restitution=0.0
            )["elastic" if restitution == "1" else "peak"]
            assert row["peaks"][restitution] == pytest.approx(own, rel=1e-3)


def test_medians_are_given_where_the_level_decides(data):
    for row in data["landings"]:
        assert ("median" in row) == (
            row["setup"] in HELD or (row["law"] == PAPER_LAW and row["restitution"] == 0.0)
        )
