"""The search on problems whose answer is known, and on tiny budgets of the real one."""

import os
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from hoof_env.errors import DataFileError, HoofEnvError, OutputError
from research.identify.command import load_start
from research.identify.leg import LEVEL, NAMES
from research.identify.minimax import Rating
from research.identify.objective import Standing
from research.identify.resume import open_state, processes
from research.identify.search import (
    CLEAR,
    SAMPLES,
    TOE_SCALES,
    Job,
    LegProblem,
    Phase,
    Result,
    elite,
    plan,
    run_job,
    search,
)  # fmt: skip
from tests.legs import FIRST_FIT
from tests.research.commands import kill_when

PHASE = Phase("around", jobs=3, evaluations=400, sigmas=(0.02, 0.05))
MINIMAX = replace(PHASE, name="descend", method="minimax", elite=6, jobs=2, sigmas=(0.002, 0.01))
TINY = (
    PHASE,
    replace(MINIMAX, evaluations=300),
    replace(MINIMAX, name="both", evaluations=60, paper_solver=True),
)


class Valley:
    """A slightly curved valley in 24 dimensions; within 1e-3 of its bottom, at 1, all is within the bars."""

    def objective(self, samples, both, by_toe=False):
        return self

    def around(self, x, samples, rng):
        return float(rng.choice((0.0, 0.3))) * rng.standard_normal(24)

    def inward(self, x, samples):
        return 2 * x

    def outward(self, y, samples):
        return y / 2

    def cost(self, y):
        return float(((y / 2 - 1) ** 2).sum())

    def rate(self, y):
        x = y / 2
        return Rating(np.array([x[0] - 1, x[1] - x[0] ** 2, *(x[2:] - 1)]), np.array([-1.0]), {})

    def standing(self, x):
        return Standing(bool(np.abs(x - 1).max() < 1e-3), float(1e3 * (x[0] - 1)), "in words")

    def merit(self, x, both):
        return self.cost(2 * x)

    def confirm(self, x):
        return True


@pytest.fixture(scope="module")
def leg():
    choice, x = load_start(FIRST_FIT, 1.375)
    return LegProblem(choice), x


def plain(result):
    """All but the wall time."""
    return replace(result, seconds=0.0)


def result(job_id, root, exact, both=99.0, confirmed=False):
    x = (0.0,) * 24
    return Result(job_id, "around", root, x, 100, 1.0, exact, both, "words", confirmed)


# --- one job ---------------------------------------------------------------------------------------------


def test_a_job_of_cma_es_finds_the_bottom_and_says_how():
    done = run_job(Valley(), Job(0, 2, PHASE, 1, 40_000, (0.0,) * 24))
    np.testing.assert_allclose(done.x, 1, atol=1e-2)
    assert (done.id, done.root, done.phase) == ("000-02", "000-02", "around")
    assert done.evaluations <= 40_020


def test_a_job_of_descents_finds_the_same_bottom_and_keeps_its_root():
    done = run_job(Valley(), Job(1, 0, MINIMAX, 1, 3000, (0.0,) * 24, "000-00"))
    np.testing.assert_allclose(done.x, 1, atol=1e-3)
    assert done.root == "000-00"
    assert 3000 <= done.evaluations < 9000


def test_a_job_repeats_itself_and_others_differ():
    jobs = [Job(*place, PHASE, seed, 200, (0.0,) * 24) for *place, seed in [(0, 0, 0)] * 2 + [(1, 0, 0)]]
    jobs += [Job(0, 1, PHASE, 0, 200, (0.0,) * 24), Job(0, 0, PHASE, 1, 200, (0.0,) * 24)]
    np.random.standard_normal(5)  # noqa: NPY002  (the global generator plays no part)
    first, again, *others = (run_job(Valley(), job).x for job in jobs)
    assert first == again
    assert all(other != first for other in others)


def test_a_job_ends_at_the_bar():
    done = run_job(Valley(), Job(0, 0, replace(MINIMAX, ends_at_bar=True), 0, 20_000, (0.0,) * 24, "000-00"))
    assert done.evaluations < 20_000
    assert abs(Valley().standing(np.array(done.x)).error) <= CLEAR
    assert done.confirmed


def test_a_leg_keeps_its_ground_level_through_a_search_by_touch_down(leg):
    problem, x = leg[0], np.array(leg[1])
    y = problem.inward(x, SAMPLES)
    assert [NAMES[i] for i in np.flatnonzero(y != x)] == ["hip_height", "walk.swing_offset"]
    assert TOE_SCALES[LEVEL] == 0.1
    np.testing.assert_allclose(problem.outward(y, SAMPLES), x, atol=1e-6)
    cost = problem.objective(SAMPLES, False, True).cost(y)
    assert cost == pytest.approx(problem.objective(SAMPLES, False).cost(x), rel=1e-3)
    high = x.copy()
    high[LEVEL] += 1.0  # a toe in the air is put down
    lower = problem.outward(problem.inward(high, SAMPLES), SAMPLES)
    assert lower[LEVEL] < high[LEVEL] - 0.5


# --- rounds ----------------------------------------------------------------------------------------------


def test_the_elite_is_the_best_result_of_each_of_the_best_starts():
    results = [
        result("000-00", "000-00", 5.0, both=40.0),
        result("000-01", "000-01", 3.0, both=9.0),
        result("001-00", "000-01", 2.0, both=8.0),
        result("001-01", "000-00", 4.0, both=30.0),
        result("002-00", "002-00", 50.0, both=60.0),
    ]
    phase = replace(PHASE, elite=2)
    assert [one.root for one in elite(phase, results)] == ["000-01", "000-00"]
    assert len(elite(replace(phase, elite=9), results)) == 3
    both = replace(phase, name="both", paper_solver=True, below=10.0)
    assert [one.root for one in elite(both, results)] == ["000-01", "000-00"]
    assert [one.root for one in elite(replace(both, below=2.5), results)] == ["000-01"]
    assert plan(3, replace(both, below=1.0), (), results, 0, 10_000) == []
    results.append(replace(results[0], phase="both", both=1.0))
    assert [one.root for one in elite(replace(both, below=1.0), results)] == ["000-00"]


def test_the_budget_is_shared_and_the_papers_solver_weighs_more():
    both = replace(PHASE, paper_solver=True)
    cases = ((PHASE, 10_000, 400), (PHASE, 300, 100), (both, 3600, 1200 // both.weight))
    for phase, left, each in cases:
        assert [job.evaluations for job in plan(0, phase, (), [], 0, left)] == [each] * 3


def begin(out, resume=False):
    return open_state(out, {"a": 1}, resume=resume, product="identified.json")


def run(leg, out, workers=1, resume=False):
    reported = []
    results = search(
        *leg, TINY, begin(out, resume), lambda phase, one: reported.append(one.id), seed=5, budget=6000,
        workers=workers,
    )  # fmt: skip
    assert sorted(reported) == sorted(one.id for one in results)
    return list(map(plain, results))


@pytest.fixture(scope="module")
def whole(leg, tmp_path_factory):
    return run(leg, tmp_path_factory.mktemp("whole"))


def test_a_search_spends_its_budget_and_refines_its_best(whole):
    weights = {phase.name: phase.weight for phase in TINY}
    assert sum(weights[one.phase] * one.evaluations for one in whole) >= 6000
    assert not whole[-1].confirmed
    by_phase = {name: [one for one in whole if one.phase == name] for name in weights}
    best = min(one.exact for one in by_phase["around"][:3])
    assert min(one.exact for one in by_phase["descend"]) < best
    assert {one.root for one in by_phase["descend"]} <= {one.id for one in by_phase["around"]}


def test_the_number_of_processes_changes_nothing(leg, whole, tmp_path):
    assert run(leg, tmp_path, workers=2) == whole


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups")
def test_a_search_that_was_killed_goes_on_to_the_same_result(leg, whole, tmp_path):
    code = (
        "from pathlib import Path",
        "choice, x = load_start(FIRST_FIT, 1.375)",
        f"run((LegProblem(choice), x), Path({str(tmp_path)!r}), workers=2)",
    )
    kept = kill_when(code, "test_search", tmp_path, "state/job-*.json", 2)
    assert len(kept) < len(whole)
    assert run(leg, tmp_path, resume=True) == whole
    assert all(file.read_bytes() == content for file, content in kept.items())


def test_a_confirmed_candidate_ends_the_search_whichever_jobs_were_faster(tmp_path):
    state = begin(tmp_path)
    for index in (2, 1, 0):
        state.save(result(f"000-0{index}", "000-01", 1.0, 1.0, confirmed=index > 0))
    results = search(Valley(), (), (PHASE,), state, lambda *_: None, seed=0, budget=10_000)
    assert [one.id for one in results] == ["000-00", "000-01"]


# --- what goes wrong -------------------------------------------------------------------------------------


def test_a_process_that_dies_is_one_error_that_names_the_way_on():
    with processes(2) as run, pytest.raises(HoofEnvError, match=r"a process died .*--resume"):
        list(run(os._exit, [1]))


def test_an_error_in_a_job_comes_out_of_it(leg):
    wrong = Job(0, 0, replace(PHASE, samples=3), 0, 100, leg[1])
    with processes(2) as run, pytest.raises(HoofEnvError, match="samples: expected"):
        list(run(partial(run_job, leg[0]), [wrong]))


def test_a_search_is_not_begun_over_another_nor_resumed_from_nothing(tmp_path):
    with pytest.raises(DataFileError, match="holds no search to resume; leave out --resume"):
        begin(tmp_path / "new", resume=True)
    assert not (tmp_path / "new").exists()
    begin(tmp_path)
    with pytest.raises(OutputError, match=r"already holds a search or what one found; name another folder"):
        begin(tmp_path)


def test_a_folder_with_an_impossible_name_is_an_error_of_ours(tmp_path):
    for resume in (False, True):
        with pytest.raises(OutputError, match="cannot write to"):
            begin(tmp_path / ("a" * 300), resume)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"problem": "digest", "content": {"id": 3}}'])
def test_a_damaged_job_is_named(tmp_path, content):
    state = begin(tmp_path)
    path = tmp_path / "state" / "job-000-01.json"
    path.write_text(content)
    with pytest.raises(DataFileError, match=r"job-000-01\.json is damaged; delete it to repeat job-000-01"):
        state.load("000-01", Result)
    assert path.read_text() == content


def test_files_of_another_search_and_a_damaged_problem_are_named(tmp_path):
    state = begin(tmp_path)
    one = result("000-00", "000-00", 1.0)
    state.save(one)
    assert state.load("000-00", Result) == one
    with pytest.raises(DataFileError, match=r"belongs to another search \(expected other, got '"):
        replace(state, digest="other").load("000-00", Result)
    with pytest.raises(DataFileError, match=r"another search: a is 1 there and 2 here; name another"):
        open_state(tmp_path, {"a": 2}, resume=True, product="identified.json")
    for content, message in (("{", "damaged; nothing can be resumed"), ("[]", "another search: a is None")):
        (tmp_path / "state" / "problem.json").write_text(content)
        with pytest.raises(DataFileError, match=message):
            begin(tmp_path, resume=True)
