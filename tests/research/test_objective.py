"""The objective against the judge, `hoof_env.paper`: rows and claims in both solvers, and what it costs."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hoof_env.paper.measure import measure_stance
from hoof_env.paper.reproduce import run_cycle
from hoof_env.paper.rows import CONDITIONS, ILL_CONDITIONED, compare, load_published
from hoof_env.paper.shapes import PROMINENCE, find_peaks, half_impulses, sole_velocity, step_length
from research.identify.confirm import COUNTED
from research.identify.demands import DEMANDS, MEASURED
from research.identify.features import prominences
from research.identify.leg import LEVEL, NAMES, OFFSET, encode, to_preset
from research.identify.objective import MISSED_ROW, Objective
from tests.legs import FIRST_FIT

CHOICE, FIRST = encode(FIRST_FIT)
PUBLISHED = load_published()
LEGS = ("first_fit", "perturbed")


def vector(leg):
    """first_fit, or a leg near it with every number off."""
    off = np.random.default_rng(4).normal(0, 0.003, FIRST.size)
    return FIRST if leg == "first_fit" else FIRST + off


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    """A function: traces by (gait, condition) and rows by id of a leg with a solver, from the simulation."""
    folder: Path = tmp_path_factory.mktemp("presets")

    @cache
    def judge(leg, solver):
        file = folder / f"{leg}.json"
        file.write_text(json.dumps(to_preset(vector(leg), CHOICE, "a test")))
        traces = {
            (gait, condition): run_cycle(gait, COUNTED[solver], restitution=restitution, preset=str(file))
            for gait in ("walk", "run")
            for condition, restitution in CONDITIONS.items()
        }
        stances = {key: measure_stance(trace) for key, trace in traces.items()}
        return traces, stances, {row["id"]: row for row in compare(PUBLISHED, stances, COUNTED[solver])}

    return judge


@cache
def objective(**settings):
    return Objective(CHOICE, **settings)


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("solver", ["exact", "paper"])
def test_every_row_is_the_judges_to_a_twentieth_of_its_bar(judged, leg, solver):
    _, _, rows = judged(leg, solver)
    search = objective()
    errors = search.rows(vector(leg), paper_solver=solver == "paper")
    assert len(search.row_ids) == sum(row.bar.limit is not None for row in PUBLISHED.rows)
    for name, error in zip(search.row_ids, errors, strict=True):
        expected = rows[name]["error"] / PUBLISHED.row(name).bar.limit
        assert error == pytest.approx(expected, abs=0.05), name


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("solver", ["exact", "paper"])
def test_the_features_behind_the_claims_are_the_judges(judged, leg, solver):
    traces, stances, _ = judged(leg, solver)
    found = objective().measured(vector(leg), paper_solver=solver == "paper")
    for gait in ("walk", "run"):
        trace, stance = traces[gait, "elastic"], stances[gait, "elastic"]
        get = {name.split(".")[1]: value for name, value in found.items() if name.startswith(gait)}
        assert get["toe_after_heel_in"] == pytest.approx(stance.toe[0][0] - stance.heel[0][0], abs=3e-4)
        assert get["toe_after_heel_out"] == pytest.approx(stance.toe[-1][1] - stance.heel[-1][1], abs=3e-4)
        assert get["extra_entries"] == len(stance.toe) + len(stance.heel) - 2
        assert get["start_depth"] == pytest.approx(
            max(trace["toe_penetration"][0], trace["heel_penetration"][0]), abs=1e-6
        )
        assert get["step"] == pytest.approx(step_length(trace, stance)[0], abs=2e-3)
        heel = float(-np.interp(stance.end, trace["time"], trace["heel_penetration"]))
        assert get["heel_gap"] == pytest.approx(heel, abs=2e-3)
        for part, (along, up) in zip(("push_1", "push_2"), half_impulses(trace, stance), strict=True):
            assert get[part] == pytest.approx(along / up, abs=0.02)
        assert (get["swept_0"] > 0.5) == (sole_velocity(trace) < -0.3)
        for condition in CONDITIONS:
            peaks = find_peaks(traces[gait, condition]["normal"])
            if (gait, condition) != ("walk", "inelastic"):
                assert (get[f"second_{condition}"] >= PROMINENCE) == (len(peaks) >= 2)
    walk, times = traces["walk", "elastic"], stances["walk", "elastic"]
    assert found["walk.double"] == pytest.approx(times.double[1] - times.double[0], abs=3e-4)
    both = (walk["time"] >= times.double[0]) & (walk["time"] <= times.double[1])
    flattest = np.abs(np.degrees(walk["hoof_angle"][both])).min()
    assert found["walk.flattest"] == pytest.approx(flattest, abs=0.5)
    one, two = find_peaks(walk["normal"])
    assert found["walk.third_peak"] < PROMINENCE
    apart = min(times.middle - walk["time"][one], walk["time"][two] - times.middle)
    assert found["walk.peaks_apart"] == pytest.approx(apart, abs=1e-3)
    dip = one + np.argmin(walk["normal"][one:two])
    support = min(walk["toe_penetration"][dip], walk["heel_penetration"][dip])
    assert found["walk.dip_support"] == pytest.approx(support, abs=1e-3)
    late, soon = (traces["run", c]["time"][np.argmax(traces["run", c]["normal"])] for c in CONDITIONS)
    assert found["run.peak_gap"] == pytest.approx(late - soon, abs=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_prominences_are_those_of_the_judge(seed):
    """A sum of bumps; the second and third peak count exactly where `find_peaks` counts them."""
    rng, t = np.random.default_rng(seed), np.linspace(0, 1, 301)
    force = sum(
        rng.uniform(0.2, 1) * np.clip(1 - np.abs(t - rng.uniform(0.2, 0.8)) / rng.uniform(0.04, 0.2), 0, None)
        for _ in range(rng.integers(1, 6))
    )
    second, third, one, two = prominences(force)
    peaks = find_peaks(force)
    assert [second >= PROMINENCE, third >= PROMINENCE] == [len(peaks) >= 2, len(peaks) >= 3]
    if len(peaks) == 2:
        assert [one, two] == peaks


def test_more_samples_change_nothing():
    coarse, fine = (Objective(CHOICE, samples=n).rows(FIRST) for n in (201, 2001))
    np.testing.assert_allclose(coarse, fine, atol=0.05)


def test_the_cost_is_what_its_parts_say():
    """The cost written out: dead zone, quadratic turning linear."""
    rows = np.clip(np.abs(objective().rows(FIRST)) - 0.6, 0, None)
    short = np.array([*objective().plausibility(FIRST).values()])
    expected = (rows**2 / (1 + rows / 2)).sum() + (short**2 / (1 + short / 2) + 0.3 * short).sum()
    assert objective().cost(FIRST) == pytest.approx(expected, rel=1e-12)


def test_a_standing_counts_the_rows_of_both_solvers():
    search = objective(paper_solver=True)
    kept = ~np.isin(search.row_ids, ILL_CONDITIONED)
    errors = np.abs([*search.rows(FIRST), *search.rows(FIRST, paper_solver=True)[kept]])
    met, error, words = search.standing(FIRST)
    assert not met
    assert abs(error) == pytest.approx(errors.max())
    assert words.startswith(f"{(errors <= 1).sum()} of {errors.size} rows within their bars, worst ")
    assert words.endswith(f"plausibility short by {sum(search.plausibility(FIRST).values()):.2g}")


def test_it_repeats_bit_for_bit():
    one, two = (Objective(CHOICE, paper_solver=True) for _ in range(2))
    costs = [s.rate(x).merit(2.0) for x in (FIRST, vector("perturbed"), FIRST) for s in (one, two)]
    assert costs[0] == costs[1] == costs[4] == costs[5]
    assert costs[2] == costs[3] != costs[0]


@pytest.mark.parametrize(
    ("name", "change", "short"),
    [
        ("hip_height", 1.8, {"hip_high"}), ("hip_height", 1.1, {"hip_low"}),
        ("log IJ", np.log(0.04), {"sole_short"}), ("log IJ", np.log(0.4), {"sole_long"}),
        ("log BD", np.log(0.05), {"lengths"}), ("run.swing_sin", -1.1, {"run.limits"}),
        ("log OP", np.log(2.0), {"assembles", "transmission"}),
        ("hip_height", 5.0, {"walk.both_touch", "run.both_touch", "walk.heel_first"}),
        ("hip_height", 0.9, {"joints", "walk.starts_in_air"}),
        ("run.swing_sin", 0.3, {"run.step", "run.turns"}),
    ],
)  # fmt: skip
def test_a_demand_not_met_is_named(name, change, short):
    x = FIRST.copy()
    x[NAMES.index(name)] = change
    before, after = objective().plausibility(FIRST), objective().plausibility(x)
    assert short <= after.keys()
    assert all(after[demand] > before.get(demand, 0.0) for demand in short)


def test_level_and_offset_may_be_given_by_the_toes_touch_down():
    x = FIRST.copy()
    while objective().measured(x)["walk.missing"] != 0 or objective().measured(x)["walk.double"] < 0.05:
        x[LEVEL] -= 0.01
    by_toe = objective(by_toe=True)
    y = objective().to_touch_down(x)
    assert 0 < y[LEVEL] < 0.6
    assert 0.001 < np.exp(y[OFFSET]) < 3
    np.testing.assert_array_equal(np.delete(y, [LEVEL, OFFSET]), np.delete(x, [LEVEL, OFFSET]))
    np.testing.assert_allclose(by_toe.from_touch_down(y), x, rtol=1e-5)
    np.testing.assert_allclose(by_toe.rows(y), objective().rows(x), atol=1e-2)
    slower = y.copy()
    slower[LEVEL], slower[OFFSET] = y[LEVEL] + 0.01, y[OFFSET] - 0.5
    fine = {"choice": CHOICE, "samples": 1001}
    found = Objective(**fine).measured(Objective(**fine, by_toe=True).from_touch_down(slower))
    if not found["walk.extra_entries"]:  # else the speed measured is that of the last entry
        np.testing.assert_allclose(found["walk.toe_speed"], np.exp(slower[OFFSET]), rtol=1e-3)
    toe_down = found["walk.contact_start"] + max(found["walk.toe_after_heel_in"], 0.0)
    np.testing.assert_allclose(toe_down, slower[LEVEL], atol=1e-5)


def test_a_leg_in_the_air_has_no_rows_and_is_put_down_by_a_search():
    x = FIRST.copy()
    x[LEVEL] = 5.0
    assert objective().to_touch_down(x)[[LEVEL, OFFSET]].tolist() == [0.35, -3.0]
    for paper_solver in (False, True):
        assert (objective().rows(x, paper_solver=paper_solver) == MISSED_ROW).all()
    assert np.isfinite(objective(paper_solver=True).cost(x))


def test_the_demands_ask_for_what_the_claims_do():
    for demand in DEMANDS:
        assert demand.measured in MEASURED
        assert demand.scale > 0
        assert demand.why
    assert objective().measured(FIRST)["walk.push_1"] < 0  # first_fit's walk brakes first
    assert objective().plausibility(FIRST)["walk.forward_1"] > 0


def test_any_vector_has_a_finite_cost_and_rating():
    rng = np.random.default_rng(7)
    for toe, heel, travel in (("I", "J", 1), ("J", "I", -1)):
        signs = tuple(rng.choice([-1, 1], 6).tolist())
        search = Objective(replace(CHOICE, assembly=signs, toe=toe, heel=heel, travel=travel))
        for _ in range(50):
            x = FIRST * rng.normal(1, 1, FIRST.size)
            assert np.isfinite(search.cost(x))
            assert np.isfinite(search.rate(x).merit(2.0))
