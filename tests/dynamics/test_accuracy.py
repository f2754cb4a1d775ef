"""Bars of accuracy: crank angle after 2 s of walking, and the order of the schemes."""

import numpy as np
import pytest

from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import ParameterError
from tests.dynamics.crank_accuracy import CASES, PATH, PHASES, Case, read_references

BARS = {"midpoint": (3e-5, 2e-5), "rk3": (1.5e-5, np.inf)}
"""Worst and median error on the ground at 1 ms [rad]."""


@pytest.fixture(scope="module")
def references():
    return read_references()


@pytest.mark.parametrize("case", [case for case in CASES if case.ground != "air"])
@pytest.mark.parametrize("scheme", BARS)
def test_the_crank_angle_on_the_ground_meets_its_bar(references, case, scheme):
    error = case.errors(scheme, references[case])
    worst, median = BARS[scheme]
    assert error.max() < worst
    assert np.median(error) < median
    assert error.min() < error.max() / 2  # not all the same phase


def test_a_late_approach_speed_would_miss_it(references):
    case = Case("first_fit", "natural")
    late = case.errors("rk3", references[case], approach="sampled")
    assert np.median(late) > BARS["rk3"][0]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_in_the_air_each_scheme_has_its_order(references, scheme):
    case = Case("identified", "air")
    coarse, fine = (np.median(case.errors(scheme, references[case], step)) for step in (4e-3, 2e-3))
    assert -0.3 < np.log2(coarse / fine) - SCHEMES[scheme].order < 0.7


@pytest.mark.parametrize("scheme", ["midpoint", "rk3", "rk4"])
def test_on_the_ground_the_higher_schemes_are_of_second_order_or_better(references, scheme):
    case = Case("identified", "natural")
    coarse, fine = (np.median(case.errors(scheme, references[case], step)) for step in (2e-3, 2.5e-4))
    assert np.log2(coarse / fine) / 3 > 1.7


def test_stored_references_agree_with_the_present_code(references):
    assert set(references) == set(CASES)
    case = Case("first_fit", "natural")
    assert case.end(PHASES[5], pieces=24) == pytest.approx(references[case][5], abs=1e-8)


def test_a_changed_leg_asks_for_new_references(tmp_path):
    (tmp_path / "old.json").write_text(
        PATH.read_text(encoding="utf-8").replace('"fingerprint": "', '"fingerprint": "0'), encoding="utf-8"
    )
    with pytest.raises(ParameterError, match="has changed, run python -m tests"):
        read_references(tmp_path / "old.json")
