"""Rounds of jobs. What a job starts from depends on earlier rounds alone, so that the number of processes,
a kill and a resumption change nothing in what is found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial

from research.identify.job import Job, Result, run_job
from research.identify.problem import LegProblem
from research.identify.processes import processes
from research.identify.schedule import Phase, Schedule, rounds
from research.identify.state import State


def search(
    problem: LegProblem,
    start: tuple[float, ...],
    schedule: Schedule,
    state: State,
    report: Callable[[Result, int], None],
    *,
    seed: int,
    budget: int,
    workers: int = 2,
) -> list[Result]:
    """Run or resume a search until a candidate is confirmed or the budget is spent.

    The results are in the order of the jobs; if the full system confirmed a candidate, it is the last.

    Args:
        start: x of the preset.
        report: called with each result and what it spent, by its weight.
        budget: evaluations, one with the paper's solver by its weight; the last round may exceed it a little.
        workers: processes.

    Raises:
        HoofEnvError: a damaged file, a folder that cannot be written, a job that failed.
    """
    results: list[Result] = []
    spent = 0
    with processes(workers) as run:
        for number, phase in rounds(schedule):
            if spent >= budget:
                break
            jobs = plan(number, phase, start, results, seed, budget - spent)
            done = {job.id: kept for job in jobs if (kept := state.load(f"job-{job.id}", Result.from_dict))}
            for result in done.values():
                report(result, phase.weight * result.evaluations)
            missing = [job for job in _needed(jobs, done) if job.id not in done]
            for result in run(partial(run_job, problem), missing):
                state.save(f"job-{result.id}", asdict(result))
                done[result.id] = result
                report(result, phase.weight * result.evaluations)
                if all(job.id in done for job in _needed(jobs, done)):
                    break
            for job in _needed(jobs, done):
                results.append(done[job.id])
                spent += phase.weight * done[job.id].evaluations
                if done[job.id].confirmed:
                    return results
    return results


def _needed(jobs: list[Job], done: dict[str, Result]) -> list[Job]:
    """The jobs up to the first that ends the search."""
    ends = (job.index for job in jobs if job.id in done and done[job.id].confirmed)
    return jobs[: min(ends, default=len(jobs)) + 1]


def plan(
    number: int, phase: Phase, start: tuple[float, ...], results: Sequence[Result], seed: int, left: int
) -> list[Job]:
    """The jobs of a round: none if it refines and there is nothing to refine.

    Args:
        number: of the round. results: of all earlier rounds. left: of the budget.
    """
    origins = [(result.x, result.root) for result in elite(phase, results)] if phase.elite else [(start, "")]
    evaluations = max(1, min(phase.evaluations, left // (phase.weight * phase.jobs)))
    return [
        Job(number, index, phase, seed, evaluations, *origins[index % len(origins)])
        for index in range(phase.jobs if origins else 0)
    ]


def elite(phase: Phase, results: Sequence[Result]) -> list[Result]:
    """The best result of each of the best independent starts, best first, by the phase's solvers."""
    ranked = [result for result in results if result.exact < phase.below or result.phase == phase.name]
    ranked.sort(key=lambda result: result.both if phase.paper_solver else result.exact)
    best: dict[str, Result] = {}
    for result in ranked:
        best.setdefault(result.root, result)
    return list(best.values())[: phase.elite]
