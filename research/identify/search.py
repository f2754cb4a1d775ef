"""Rounds of jobs. What a job starts from depends on earlier rounds alone, so that the number of processes,
a kill and a resumption change nothing in what is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from research.identify.job import Job, Result, run_job
from research.identify.problem import LegProblem
from research.identify.processes import processes
from research.identify.schedule import Phase, Schedule, rounds
from research.identify.state import State


@dataclass(frozen=True)
class Outcome:
    """What a search found.

    Attributes:
        results: in the order of the jobs, up to the one that ended the search.
        winner: the first that the full system confirmed, or the best of those if it kept going, or None.
        spent: evaluations, those with the paper's solver by their weight.
    """

    results: tuple[Result, ...]
    winner: Result | None
    spent: int


def search(
    problem: LegProblem,
    schedule: Schedule,
    state: State,
    report: Callable[[Result, int], None],
    *,
    seed: int,
    budget: int,
    workers: int = 2,
    keep_going: bool = False,
) -> Outcome:
    """Run or resume a search until a candidate is confirmed or the budget is spent.

    Args:
        report: called with each result and what it spent, by its weight.
        budget: evaluations, one with the paper's solver by its weight; the last round may exceed it a little.
        workers: processes.
        keep_going: spend the whole budget; no job ends at the bar, and the winner is the best.

    Raises:
        HoofEnvError: a damaged file, a folder that cannot be written, a job that failed.
    """
    results: list[Result] = []
    spent = 0
    with processes(workers) as run:
        for number, phase in rounds(schedule):
            if spent >= budget:
                break
            phase = replace(phase, ends_at_bar=phase.ends_at_bar and not keep_going)
            jobs = plan(number, phase, results, seed, budget - spent)
            done = {job.id: there for job in jobs if (there := state.load(f"job-{job.id}", Result.from_dict))}
            for result in done.values():
                report(result, phase.weight * result.evaluations)
            missing = [job for job in _needed(jobs, done, keep_going) if job.id not in done]
            for result in run(partial(run_job, problem), missing):
                state.save(f"job-{result.id}", result.to_dict())
                done[result.id] = result
                report(result, phase.weight * result.evaluations)
                if all(job.id in done for job in _needed(jobs, done, keep_going)):
                    break
            for job in _needed(jobs, done, keep_going):
                results.append(done[job.id])
                spent += phase.weight * done[job.id].evaluations
                if done[job.id].confirmed and not keep_going:
                    return Outcome(tuple(results), done[job.id], spent)
    confirmed = [result for result in results if result.confirmed]
    return Outcome(tuple(results), min(confirmed, key=lambda r: r.both, default=None), spent)


def _needed(jobs: list[Job], done: dict[str, Result], keep_going: bool) -> list[Job]:
    """The jobs up to the first that ends the search."""
    ends = (job.index for job in jobs if job.id in done and done[job.id].confirmed and not keep_going)
    return jobs[: min(ends, default=len(jobs)) + 1]


def plan(number: int, phase: Phase, results: list[Result], seed: int, left: int) -> list[Job]:
    """The jobs of a round: none if it refines and there is nothing to refine.

    Args:
        number: of the round. results: of all earlier rounds. left: of the budget.
    """
    parents = elite(phase, results) if phase.start == "best" else ()
    if phase.start == "best" and not parents:
        return []
    evaluations = max(1, min(phase.evaluations, left // (phase.weight * phase.jobs)))
    return [Job(number, index, phase, seed, evaluations, parents) for index in range(phase.jobs)]


def elite(phase: Phase, results: list[Result]) -> tuple[Result, ...]:
    """The best result of each of the best independent starts, best first, by the phase's solvers."""
    ranked = [result for result in results if result.exact < phase.below or result.phase == phase.name]
    ranked.sort(key=lambda result: result.both if phase.paper_solver else result.exact)
    best: dict[str, Result] = {}
    for result in ranked:
        best.setdefault(result.root, result)
    return tuple(best.values())[: phase.elite]
