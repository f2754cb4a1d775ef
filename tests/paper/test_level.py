"""Three rows depend on micrometres of a fitted ground level; the remaining rows do not."""

import pytest

from hoof_env.paper.level import SHIFTS, compare_levels, level_line
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.reproduce import GAITS, stances_at
from hoof_env.paper.rows import CONDITIONS, EXACT, NOT_DETERMINABLE


@pytest.fixture(scope="module")
def levels(reproduction):
    return {entry["id"]: entry for entry in reproduction.levels}


def test_three_rows_move_by_many_bars_within_a_tenth_of_a_millimetre_and_the_others_by_half_a_bar(levels):
    assert len(levels) == 22
    for name, entry in levels.items():
        assert entry["determinable"] is (name not in NOT_DETERMINABLE)
        assert entry["moved"] > 8 if name in NOT_DETERMINABLE else entry["moved"] < 0.5


def test_they_leave_their_bars_within_tens_of_micrometres_on_both_sides(levels):
    for name in NOT_DETERMINABLE:
        for shift, within in zip(levels[name]["shifts_um"], levels[name]["within_bar"], strict=True):
            assert within is False or abs(shift) < 50, (name, shift)
    assert not levels["walk.mean_inelastic"]["within_bar"][SHIFTS.index(1e-5)]


def test_a_shift_of_the_ground_is_one_of_all_penetrations(reproduction):
    """Under a fixed trunk ground that rises lengthens the stance and moves nothing else."""
    geometry = reproduction.geometry
    higher = stances_at(geometry.hip_height - 1e-4)
    for gait in GAITS:
        for condition in CONDITIONS:
            before = measure_stance(reproduction.traces[gait, condition, EXACT])
            after = higher[gait, condition]
            assert after.start < before.start
            assert after.end > before.end
            assert after.period == before.period


def test_no_shift_moves_nothing(reproduction):
    here = {
        (gait, condition): measure_stance(reproduction.traces[gait, condition, EXACT])
        for gait in GAITS
        for condition in CONDITIONS
    }
    entries = compare_levels(reproduction.published, reproduction.rows, {0.0: here})
    assert all(entry["moved"] == 0 and entry["determinable"] for entry in entries)
    assert "no row moves by a bar; the other 22 rows by 0.00 bars at most" in level_line(entries)
