"""The judge: the full system, and the best leg of a search under it."""

from dataclasses import replace

import numpy as np
import pytest

from hoof_env.leg.geometry import load_geometry, read_preset
from hoof_env.paper.reproduce import reproduce
from hoof_env.paper.rows import EXACT, PROBABLE, load_published
from research.identify.__main__ import best_leg
from research.identify.command import load_start
from research.identify.confirm import COUNTED, confirm
from research.identify.search import LegProblem, Result
from tests.legs import FIRST_FIT

ABOUT = {"start": "first_fit (0)", "seed": 0, "versions": {"cma": "4"}}


@pytest.fixture(scope="module")
def verdict():
    return confirm(read_preset(FIRST_FIT))


def test_the_full_system_is_the_judge(verdict):
    again = reproduce(preset=FIRST_FIT)
    assert [row["error"] for row in verdict.rows] == [row["error"] for row in again.rows]
    out = {(row["id"], row["solver"]) for row in again.rows if row["within_bar"] is False}
    assert set(verdict.outside) == {(row, solver) for row, solver in out if solver in COUNTED.values()}
    assert ("walk.direction", EXACT) in verdict.untrue
    assert not verdict.holds
    bars = {row.id: row.bar.limit for row in load_published().rows}
    off = [
        abs(row["error"]) / bars[row["id"]]
        for row in again.rows
        if row["solver"] == PROBABLE and not row["spared"]
    ]
    assert verdict.errors["paper"] == pytest.approx(max(off))


def test_the_best_leg_that_turns_becomes_a_preset():
    choice, x = load_start(FIRST_FIT, 1.375)
    problem = LegProblem(choice)
    first = Result("000-00", "around", "000-00", x, 500, 2.0, 8.0, 9.0, "words", False)
    stuck = replace(first, id="000-01", x=(1.0, *x[1:]), both=6.5)
    result, preset, _ = best_leg(problem, [first, stuck], ABOUT)
    assert result is first
    leg, given = load_geometry(preset), load_geometry(FIRST_FIT)
    assert leg.lengths == pytest.approx(dict(given.lengths), rel=1e-12)
    assert leg.provenance.startswith("Identified, not published: ")
    assert leg.provenance.endswith(
        "by research.identify, job 000-00. Settings: start first_fit (0), seed 0, cma 4."
    )
    assert best_leg(problem, [stuck], ABOUT) is None
    assert problem.confirm(np.array(stuck.x)) is False
