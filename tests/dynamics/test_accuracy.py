"""Bars of accuracy: crank angle after 2 s of walking, order of the schemes, what is kept in flight."""

import numpy as np
import pytest

from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import ParameterError
from tests.dynamics.crank_accuracy import BARRED, BARS, DURATION, PATH, PHASES, Case, read_references
from tests.dynamics.horse_accuracy import converged, fly, ground_account, stiff

PRESETS = ("first_fit", "identified")


@pytest.fixture(scope="module")
def references():
    return read_references()


@pytest.mark.parametrize("ground", ["natural", "elastic"])
@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("scheme", BARS)
def test_the_crank_angle_on_the_ground_meets_its_bar(references, preset, ground, scheme):
    case = Case(preset, "walk", ground)
    error = case.errors(scheme, references[case])
    worst, median = BARS[scheme]
    assert error.max() < worst
    assert np.median(error) < median
    assert error.min() < error.max() / 2  # not all the same phase


def test_a_late_approach_speed_would_miss_it(references):
    case = Case("first_fit", "walk", "natural")
    late = case.errors("rk3", references[case], approach="sampled")
    assert np.median(late) > BARS["rk3"][0]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_in_the_air_each_scheme_has_its_order(references, scheme):
    case = Case("identified", "walk", "air")
    coarse, fine = (np.median(case.errors(scheme, references[case], step)) for step in (4e-3, 2e-3))
    assert -0.3 < np.log2(coarse / fine) - SCHEMES[scheme].order < 0.7


def test_on_the_ground_the_higher_schemes_are_of_second_order_or_better(references):
    case = Case("identified", "walk", "natural")
    for scheme in ("midpoint", "rk3", "rk4"):
        coarse, fine = (np.median(case.errors(scheme, references[case], step)) for step in (2e-3, 2.5e-4))
        assert np.log2(coarse / fine) / 3 > 1.7


def test_the_kept_references_are_those_of_the_present_code(references):
    assert set(references) == set(BARRED)
    case = Case("first_fit", "walk", "natural")
    end = case.crank(pieces=24).run(PHASES[5], [0.0, DURATION])[0][-1]
    assert end == pytest.approx(references[case][5], abs=1e-8)


def test_a_changed_leg_asks_for_new_references(tmp_path):
    (tmp_path / "old.json").write_text(
        PATH.read_text(encoding="utf-8").replace('"fingerprint": "', '"fingerprint": "0'), encoding="utf-8"
    )
    with pytest.raises(ParameterError, match="it has changed, run python -m tests"):
        read_references(tmp_path / "old.json")


def test_flight_keeps_momentum_to_round_off_and_energy_to_the_order():
    for scheme, energy in (("semi_implicit_euler", 0.05), ("midpoint", 3e-4), ("rk3", 3e-5), ("rk4", 3e-6)):
        kept = fly("identified", scheme, 1e-3, seconds=0.3)
        assert kept.closure < 1e-12
        assert kept.momentum < 1e-12
        assert kept.spin < 1e-11
        assert kept.energy < energy


def test_the_energy_account_closes_on_the_ground():
    errors = [ground_account("identified", "midpoint", step, seconds=1.0) for step in (2e-3, 1e-3)]
    assert errors[1] < 5e-6
    assert errors[1] < errors[0] / 3


def test_on_stiff_ground_the_chosen_substeps_follow_and_too_few_warn():
    expected = converged("identified")
    for scheme, step in (("midpoint", 5e-3), ("semi_implicit_euler", 1e-3)):
        chosen, one = (stiff("identified", scheme, step, substeps, expected) for substeps in (None, 1))
        assert chosen.substeps > 1
        assert not chosen.warned
        assert chosen.trunk[0] < 5e-5
        assert f"substeps={chosen.substeps}" in one.warned
        assert one.trunk[0] > 5 * chosen.trunk[0]
