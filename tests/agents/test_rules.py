"""When figures of a gait count: one rule for the judges, the map of gaits and the canter."""

import numpy as np
import pytest

from agents import canter, gait_map, judge
from agents.rules import MAX_ERROR, MAX_FALLS, MAX_SLIP, TURNS, rejection_reason
from hoof_env.tasks.horse_gaits import PAIRS

GOOD = {"fell": 0.0, "speed_ratio": 1.0, "stride_over_hip": gait_map.stride_at(0.5), "lag": 0.25} | {
    f"{name}_{pair}": value for pair in PAIRS for name, value in (("slip", 0.05), ("stances_per_turn", 1.0))
}

BAD = {
    "fell": (MAX_FALLS + 0.01, np.nan),
    "speed_ratio": (1 + MAX_ERROR + 0.01, 1 - MAX_ERROR - 0.01, np.nan),
    **{f"slip_{pair}": (MAX_SLIP, np.nan) for pair in PAIRS},
    **{f"stances_per_turn_{pair}": (TURNS[0] - 0.01, TURNS[1] + 0.01, np.nan) for pair in PAIRS},
}
"""Figures that reject a gait, each alone."""


def counted(figures):
    """Say what each of those who judge says of figures."""
    return {
        not judge.rejection_reason(figures, PAIRS),
        canter.counts(figures),
        gait_map.stands(figures, "walk", 0.5),
    }


def test_all_agree_on_a_gait_that_counts():
    assert counted(GOOD) == {True}
    assert counted(GOOD | {"fell": MAX_FALLS, "stances_per_turn_fore": TURNS[1]}) == {True}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in BAD.items() for value in values]
)
def test_all_agree_on_a_gait_that_does_not(name, value):
    assert counted(GOOD | {name: value}) == {False}


def test_a_pair_is_judged_by_its_own_hooves_and_speeds_give_their_ratio():
    figures = {**GOOD, "slip_fore": 0.2, "speed": 2.0, "reached": 1.0}
    del figures["speed_ratio"]
    assert rejection_reason(figures, ["hind"]) == "0.50 of the commanded speed"
    assert rejection_reason(figures, ["fore"]) == "0.50 of the commanded speed, fore hooves slip 0.20 m"
