"""The search on problems whose answer is known, and on tiny budgets of the real one."""

import os
import pickle
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from hoof_env.errors import DataFileError, HoofEnvError, OutputError
from research.identify.candidate import names
from research.identify.command import load_start
from research.identify.job import CLEAR, run_job
from research.identify.minimax import Rating
from research.identify.problem import LegProblem
from research.identify.records import Job, Result, Standing
from research.identify.schedule import COLD, FROM_PRESET, Phase, rounds
from research.identify.search import elite, plan, search
from research.identify.state import open_state
from research.identify.targets import load_targets
from research.identify.workers import Workers

PHASE = Phase(
    "around",
    "given",
    jobs=3,
    evaluations=400,
    sigmas=(0.02, 0.05),
    populations=(8, 12),
    tries=5,
    by_toe=False,
)
MINIMAX = replace(PHASE, name="descend", method="minimax", start="best", jobs=2, sigmas=(0.002, 0.01))
TINY = (
    replace(PHASE, by_toe=True),
    replace(MINIMAX, by_toe=True, evaluations=300),
    replace(PHASE, name="both", start="best", jobs=2, evaluations=60, by_toe=True, paper_solver=True),
)


class Bowl:
    """A valley with its bottom at (1, 1, 1); within 1e-3 of it every row of two is within its bar."""

    def given(self, rng, phase):
        return {"side": 1}, float(rng.choice(phase.spreads)) * rng.standard_normal(3)

    def cold(self, rng, phase):
        return {"side": int(rng.choice([-1, 1]))}, rng.standard_normal(3)

    def scales(self, choice, phase):
        return np.ones(3)

    def inward(self, choice, x, phase):
        return 2 * x if phase.by_toe else x

    def outward(self, choice, y, phase):
        return y / 2 if phase.by_toe else y

    calls = 0

    def cost(self, choice, phase):
        def cost(y):
            self.calls += 1
            x = self.outward(choice, y, phase)
            return float((x[0] - 1) ** 2 + 100 * ((x[1:] - x[:-1] ** 2) ** 2).sum())

        return cost

    def rate(self, choice, phase):
        def rate(y):
            self.calls += 1
            x = self.outward(choice, y, phase)
            return Rating(np.array([x[0] - 1, *(x[1:] - x[:-1] ** 2)]), np.array([-1.0]), {})

        return rate

    def standing(self, choice, x, paper_solver):
        within = int(np.abs(x - 1).max() < 1e-3)
        return Standing(1 + within, 2, "x", float(1e3 * (x[0] - 1)), 0.0)

    def rank(self, choice, x):
        cost = self.cost(choice, PHASE)(x)
        return cost, cost

    def confirm(self, choice, x):
        return True


class Silent:
    """A monitor that keeps what it is told."""

    def __init__(self):
        self.results = []

    def planned(self, jobs):
        pass

    def running(self, progress):
        pass

    def finished(self, result):
        self.results.append(result)


class Killed(Exception):
    pass


def ignore(_):
    pass


@pytest.fixture(scope="module")
def leg():
    return LegProblem(load_targets(), "walks", load_start("first_fit"))


def found(result):
    """All but the wall time."""
    return replace(result, seconds=0.0)


def result(job_id, root, exact, full=None, confirmed=False):
    standing = Standing(1, 2, "walk.duty", 1.5, 0.0)
    return Result(
        job_id, "around", "given", root, {}, 0.1, 8, 100, 1.0, "evaluations spent", [1.0],
        exact, exact, full, standing, None, confirmed,
    )  # fmt: skip


# --- one job ---------------------------------------------------------------------------------------------


def test_a_job_finds_the_bottom_of_a_valley_and_says_how():
    done = run_job(Bowl(), Job(0, 2, PHASE, 1, 20_000), None, ignore, ignore)
    np.testing.assert_allclose(done.x, 1, atol=1e-2)
    assert (done.id, done.root, done.phase, done.start) == ("000-02", "000-02", "around", "given")
    assert done.sigma in PHASE.sigmas
    assert done.population in PHASE.populations
    assert done.evaluations <= 20_012


def test_a_job_repeats_itself_and_others_differ():
    jobs = [Job(0, 0, PHASE, 0, 200), Job(0, 0, PHASE, 0, 200)]
    jobs += [Job(1, 0, PHASE, 0, 200), Job(0, 1, PHASE, 0, 200), Job(0, 0, PHASE, 1, 200)]
    first, again, *others = (run_job(Bowl(), job, None, ignore, ignore).x for job in jobs)
    assert first == again
    assert all(other != first for other in others)


def test_a_job_of_descents_finds_the_same_bottom():
    start = result("000-00", "000-00", 3.0)
    parents = (replace(start, x=[0.0, 0.0, 0.0]).parent,)
    done = run_job(Bowl(), Job(1, 0, MINIMAX, 1, 3000, parents), None, ignore, ignore)
    np.testing.assert_allclose(done.x, 1, atol=1e-3)
    assert done.root == "000-00"
    assert 3000 <= done.evaluations < 6000


@pytest.mark.parametrize("kills", [1, 3])
@pytest.mark.parametrize(("phase", "steps"), [(PHASE, 20), (MINIMAX, 6)], ids=["cma", "minimax"])
def test_a_job_that_was_killed_goes_on_to_the_same_result_bit_for_bit(kills, phase, steps):
    parents = (replace(result("000-00", "000-00", 3.0), x=[0.0, 0.0, 0.0]).parent,)
    job = Job(0, 0, phase, 3, 4000 if phase is PHASE else 1200, parents)
    whole = run_job(Bowl(), job, None, ignore, ignore)
    checkpoint = None
    for _ in range(kills):
        saved = []

        def save(content, saved=saved):
            saved.append(content)
            if len(saved) == steps:
                raise Killed

        with pytest.raises(Killed):
            run_job(Bowl(), job, checkpoint, save, ignore, every=-1)
        checkpoint = saved[-2]  # the last may not have been written
    np.random.standard_normal(5)  # noqa: NPY002  (the global generator plays no part)
    problem = Bowl()
    assert found(run_job(problem, job, checkpoint, ignore, ignore)) == found(whole)
    spared = pickle.loads(checkpoint).method.evaluations
    assert spared > 50 * kills
    assert problem.calls <= whole.evaluations - spared + 1  # it did not begin anew


def test_a_hopeless_job_gives_up_and_a_finished_one_ends():
    hopeless = replace(PHASE, give_up=((100, 1e-9),))
    done = run_job(Bowl(), Job(0, 0, hopeless, 0, 4000), None, ignore, ignore)
    assert done.stop == "cost above 1e-09 after 100 evaluations"
    assert 100 <= done.evaluations < 120
    ending = replace(PHASE, ends_at_bar=True)
    done = run_job(Bowl(), Job(0, 0, ending, 0, 20_000), None, ignore, ignore)
    assert done.stop == "bar reached"
    assert done.standing.met
    assert abs(done.standing.error) <= CLEAR
    assert done.confirmed


def test_a_result_is_in_plain_coordinates_whatever_a_phase_searches_in():
    done = run_job(Bowl(), Job(0, 0, replace(PHASE, by_toe=True), 1, 20_000), None, ignore, ignore)
    np.testing.assert_allclose(done.x, 1, atol=1e-2)
    assert done.exact == done.cost


def test_a_leg_keeps_its_ground_level_through_a_search_by_touch_down(leg):
    choice, x = leg.start[0].to_dict(), np.array(leg.start[1])
    phase = replace(PHASE, by_toe=True, samples=401)
    y = leg.inward(choice, x, phase)
    level, offset = np.flatnonzero(y != x)
    assert names(leg.start[0])[offset] == "walk.swing_offset"
    assert leg.scales(choice, phase)[level] != leg.scales(choice, PHASE)[level]
    np.testing.assert_allclose(leg.outward(choice, y, phase), x, atol=1e-6)
    assert leg.cost(choice, phase)(y) == pytest.approx(
        leg.cost(choice, replace(PHASE, samples=401))(x), rel=1e-3
    )
    high = x.copy()
    high[level] += 1.0  # a toe in the air is put down
    lower = leg.outward(choice, leg.inward(choice, high, phase), phase)
    assert lower[level] < high[level] - 0.5


def test_a_result_survives_json():
    done = run_job(Bowl(), Job(0, 0, PHASE, 0, 100), None, ignore, ignore)
    assert Result.from_dict(done.to_dict()) == done
    assert Result.from_dict(result("000-00", "000-00", 1.0).to_dict()).both is None


# --- rounds ----------------------------------------------------------------------------------------------


def test_phases_come_round_and_round():
    order = [phase.name for _, phase in zip(range(10), (p for _, p in rounds(FROM_PRESET)), strict=False)]
    once = ["around", "settle", "descend", "polish", "polish", "polish", "both solvers", "both solvers"]
    assert order == [*once, "around", "settle"]
    assert COLD[0].start == "cold"


def test_the_elite_is_the_best_result_of_each_of_the_best_starts():
    results = [
        result("000-00", "000-00", 5.0),
        result("000-01", "000-01", 3.0, full=9.0),
        result("001-00", "000-01", 2.0, full=8.0),
        result("001-01", "000-00", 4.0, full=30.0),
        result("002-00", "002-00", 50.0, full=60.0),
    ]
    phase = replace(PHASE, start="best", elite=2)
    assert [parent.root for parent in elite(phase, results)] == ["000-01", "000-00"]
    assert len(elite(replace(phase, elite=9), results)) == 3
    both = replace(phase, name="both", paper_solver=True, below=10.0)
    assert [parent.root for parent in elite(both, results)] == ["000-01", "000-00"]
    assert [parent.root for parent in elite(replace(both, below=2.5), results)] == ["000-01"]
    assert plan(3, replace(both, below=1.0), results, 0, 10_000) == []
    results.append(replace(results[0], phase="both", full=1.0))
    assert [p.root for p in elite(replace(both, below=1.0), results)] == ["000-00"]


def test_the_budget_is_shared_and_the_papers_solver_weighs_more():
    assert [job.evaluations for job in plan(0, PHASE, [], 0, 10_000)] == [400] * 3
    assert [job.evaluations for job in plan(0, PHASE, [], 0, 300)] == [100] * 3
    both = replace(PHASE, paper_solver=True)
    assert [job.evaluations for job in plan(0, both, [], 0, 3600)] == [3600 // 3 // both.weight] * 3


def run(problem, out, workers=2, phases=TINY, budget=6000, resume=False, **options):
    state = open_state(out, {"a": 1}, "digest", resume=resume)
    monitor = Silent()
    outcome = search(problem, phases, state, monitor, seed=5, budget=budget, workers=workers, **options)
    assert sorted(r.id for r in monitor.results) == sorted(r.id for r in outcome.results)
    return outcome


@pytest.fixture(scope="module")
def whole(leg, tmp_path_factory):
    return run(leg, tmp_path_factory.mktemp("whole"), workers=1)


def test_a_search_spends_its_budget_and_refines_its_best(whole):
    assert whole.spent >= 6000
    assert whole.winner is None
    by_phase = {phase.name: [r for r in whole.results if r.phase == phase.name] for phase in TINY}
    assert all(by_phase.values())
    best = min(r.exact for r in by_phase["around"][:3])
    assert min(r.exact for r in by_phase["descend"]) < best
    assert {r.root for r in by_phase["descend"]} <= {r.id for r in by_phase["around"]}


def test_the_number_of_processes_changes_nothing(leg, whole, tmp_path):
    other = run(leg, tmp_path, workers=2)
    assert list(map(found, other.results)) == list(map(found, whole.results))
    assert other.spent == whole.spent


SCRIPT = """
import sys
from pathlib import Path
from test_search import *
if __name__ == "__main__":
    problem = LegProblem(load_targets(), "walks", load_start("first_fit"))
    run(problem, Path(sys.argv[1]), workers=1, every=0.02)
"""


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups")
def test_a_search_that_was_killed_goes_on_to_the_same_result(leg, whole, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    path = os.pathsep.join([os.path.dirname(__file__), *sys.path])
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "out")],
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,
    )
    state = tmp_path / "out" / "state"
    deadline = time.monotonic() + 300
    while not list(state.glob("job-*.pickle")):
        assert process.poll() is None, "ended before its first checkpoint"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.kill()
    process.wait()
    while True:  # its workers end by themselves
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            break
        assert time.monotonic() < deadline, "a worker outlived its parent"
        time.sleep(0.05)
    assert len(list(state.glob("job-*.json"))) < len(whole.results)
    resumed = run(leg, tmp_path / "out", workers=1, resume=True)
    assert list(map(found, resumed.results)) == list(map(found, whole.results))


def test_a_confirmed_candidate_ends_the_search_the_same_way_with_any_number_of_processes(tmp_path):
    outcomes = []
    for number in (0, 1):
        state = open_state(tmp_path / str(number), {}, "digest", resume=False)
        for index in (1, 2) if number else ():  # as if later jobs had been faster
            state.finish(result(f"000-{index:02d}", f"000-{index:02d}", 1.0, 1.0, confirmed=True))
        if not number:
            state.finish(result("000-01", "000-01", 1.0, 1.0, confirmed=True))
        state.finish(result("000-00", "000-00", 2.0))
        outcomes.append(search(Bowl(), (PHASE,), state, Silent(), seed=0, budget=10_000))
    assert outcomes[0] == outcomes[1]
    assert outcomes[0].winner.id == "000-01"
    assert [r.id for r in outcomes[0].results] == ["000-00", "000-01"]


# --- what goes wrong -------------------------------------------------------------------------------------


def test_a_process_that_dies_is_one_error_that_names_the_way_on(leg, tmp_path):
    state = open_state(tmp_path, {}, "digest", resume=False)
    long = Job(0, 0, replace(PHASE, populations=(8,)), 0, 10**9)
    with Workers(leg, state, 1, 10.0) as workers:

        def tell(_):
            os.kill(workers._workers[0][0].pid, signal.SIGTERM)

        with pytest.raises(HoofEnvError, match=r"a process died while it ran job 000-00 .*--resume"):
            workers.run([long], tell, lambda _: False)


def test_an_error_in_a_job_comes_out_of_it(tmp_path):
    state = open_state(tmp_path, {}, "digest", resume=False)
    coldless = LegProblem(load_targets(), "walks", None)
    with Workers(coldless, state, 1, 10.0) as workers, pytest.raises(HoofEnvError, match="cold starts only"):
        workers.run([Job(0, 0, PHASE, 0, 100)], ignore, lambda _: False)


def test_a_search_is_not_begun_over_another_nor_resumed_from_nothing(tmp_path):
    with pytest.raises(DataFileError, match="holds no search to resume; leave out --resume"):
        open_state(tmp_path / "new", {}, "d", resume=True)
    assert not (tmp_path / "new").exists()
    open_state(tmp_path, {"seed": 0}, "d", resume=False)
    with pytest.raises(OutputError, match=r"already holds a search or what one found; name another folder"):
        open_state(tmp_path, {"seed": 0}, "d", resume=False)


def test_a_folder_with_an_impossible_name_is_an_error_of_ours(tmp_path):
    for resume, error in [(False, OutputError), (True, HoofEnvError)]:
        with pytest.raises(error, match="cannot write to"):
            open_state(tmp_path / ("a" * 300), {}, "d", resume=resume)


def test_a_search_for_something_else_is_not_resumed(tmp_path):
    open_state(tmp_path, {"seed": 0, "walk": "walks"}, "d", resume=False)
    before = (tmp_path / "state" / "problem.json").read_bytes()
    with pytest.raises(DataFileError, match=r"another search: seed is 0 there and 1 here; name another"):
        open_state(tmp_path, {"seed": 1, "walk": "walks"}, "d", resume=True)
    assert (tmp_path / "state" / "problem.json").read_bytes() == before


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"problem": "digest", "result": {"id": 3}}'])
def test_a_damaged_job_is_named(tmp_path, content):
    state = open_state(tmp_path, {}, "digest", resume=False)
    path = tmp_path / "state" / "job-000-01.json"
    path.write_text(content)
    with pytest.raises(DataFileError, match=r"job-000-01\.json is damaged; delete it to repeat job 000-01"):
        state.result("000-01")
    assert path.read_text() == content


def test_a_damaged_checkpoint_and_files_of_another_search_are_named(tmp_path):
    state = open_state(tmp_path, {}, "digest", resume=False)
    state.save("000-00", pickle.dumps(1))
    assert pickle.loads(state.load("000-00")) == 1
    (tmp_path / "state" / "job-000-00.pickle").write_bytes(b"digest\nnot a pickle")
    with pytest.raises(DataFileError, match=r"job-000-00\.pickle is damaged"):
        state.load("000-00")
    other = replace(state, digest="other")
    with pytest.raises(DataFileError, match=r"belongs to another search \(expected other, got 'digest'\)"):
        other.load("000-00")
    state.finish(result("000-00", "000-00", 1.0))
    assert state.load("000-00") is None
    with pytest.raises(DataFileError, match="belongs to another search"):
        other.result("000-00")
    (tmp_path / "state" / "problem.json").write_text("{")
    with pytest.raises(DataFileError, match=r"problem\.json is damaged; nothing can be resumed"):
        open_state(tmp_path, {}, "digest", resume=True)
