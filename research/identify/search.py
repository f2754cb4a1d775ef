"""Rounds of jobs. What a job starts from depends on earlier rounds alone, so that the number of processes,
a kill and a resumption change nothing in what is found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from research.identify.job import CHECKPOINT_EVERY
from research.identify.records import Job, Parent, Problem, Progress, Result
from research.identify.schedule import Phase, Schedule, rounds
from research.identify.state import State
from research.identify.workers import Workers


class Monitor(Protocol):
    """Who looks on."""

    def planned(self, jobs: list[Job]) -> None: ...

    def running(self, progress: Progress) -> None: ...

    def finished(self, result: Result) -> None: ...


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
    problem: Problem,
    schedule: Schedule,
    state: State,
    monitor: Monitor,
    *,
    seed: int,
    budget: int,
    workers: int = 2,
    keep_going: bool = False,
    every: float = CHECKPOINT_EVERY,
) -> Outcome:
    """Run or resume a search until a candidate is confirmed or the budget is spent.

    Args:
        budget: evaluations, one with the paper's solver by its weight; the last round may exceed it a little.
        workers: processes.
        keep_going: spend the whole budget; no job ends at the bar, and the winner is the best.
        every: seconds between two checkpoints of a job.

    Raises:
        HoofEnvError: a damaged file, a folder that cannot be written, a job that failed.
    """
    results: list[Result] = []
    spent = 0
    with Workers(problem, state, workers, every) as processes:
        for number, phase in rounds(schedule):
            if spent >= budget:
                break
            if keep_going:
                phase = replace(phase, ends_at_bar=False)
            jobs = plan(number, phase, results, seed, budget - spent)
            if not jobs:
                continue
            monitor.planned(jobs)
            found = {job.id: result for job in jobs if (result := state.result(job.id))}
            last = min((job.index for job in jobs if _ends(found.get(job.id), keep_going)), default=len(jobs))

            def done(result: Result, found: dict[str, Result] = found) -> bool:
                found[result.id] = result
                monitor.finished(result)
                return _ends(result, keep_going)

            for result in found.values():
                monitor.finished(result)
            missing = [job for job in jobs if job.id not in found and job.index < last]
            processes.run(missing, monitor.running, done)
            for job in jobs:
                if job.id not in found:
                    continue
                results.append(found[job.id])
                spent += phase.weight * found[job.id].evaluations
                if _ends(found[job.id], keep_going):
                    return Outcome(tuple(results), found[job.id], spent)
    confirmed = [result for result in results if result.confirmed]
    return Outcome(tuple(results), min(confirmed, key=lambda r: r.full or 0.0, default=None), spent)


def _ends(result: Result | None, keep_going: bool) -> bool:
    return result is not None and result.confirmed and not keep_going


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


def elite(phase: Phase, results: list[Result]) -> tuple[Parent, ...]:
    """The best result of each of the best independent starts, best first, by the phase's solvers."""
    ranked = []
    for result in results:
        merit = result.full if phase.paper_solver else result.exact
        if merit is not None and (result.exact < phase.below or result.phase == phase.name):
            ranked.append((merit, result.parent))
    ranked.sort(key=lambda pair: pair[0])
    best: dict[str, Parent] = {}
    for _, parent in ranked:
        best.setdefault(parent.root, parent)
    return tuple(best.values())[: phase.elite]
