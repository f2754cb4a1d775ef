"""Rounds of jobs. What a job starts from depends on earlier rounds alone, so that the number of processes,
a kill and a resumption change nothing in what is found."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from research.identify.job import Job, Phase, Result, run_job
from research.identify.problem import LegProblem
from research.identify.processes import processes
from research.identify.state import State

BUDGET = 10_000_000
"""Evaluations of a search unless told otherwise; one takes some 0.1 ms."""

Schedule = tuple[Phase, ...]
"""Phases, run again and again until the bar is reached or the budget spent."""

_DESCEND = Phase("descend", 8, 4_000, (0.003, 0.01, 0.03, 0.1), method="minimax", elite=8, samples=401)
_POLISH = replace(
    _DESCEND, name="polish", jobs=4, elite=2, rounds=3, evaluations=16_000, ends_at_bar=True
)  # fmt: skip
_BOTH = replace(
    _POLISH, name="both solvers", rounds=2, evaluations=8_000, sigmas=(0.002, 0.005, 0.01, 0.02, 0.04),
    below=1.5, paper_solver=True,
)  # fmt: skip

SCHEDULE: Schedule = (
    Phase("around", 24, 4_000, (0.1,)),
    Phase("settle", 8, 8_000, (0.05,), elite=8),
    _DESCEND,
    _POLISH,
    _BOTH,
)


def rounds(schedule: Schedule) -> Iterator[tuple[int, Phase]]:
    """Endless: (number of the round, its phase)."""
    phases = itertools.chain.from_iterable(itertools.repeat(phase, phase.rounds) for phase in schedule)
    yield from enumerate(itertools.cycle(phases))


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
            done = {job.id: kept for job in jobs if (kept := state.load(f"job-{job.id}", Result))}
            for result in done.values():
                report(result, phase.weight * result.evaluations)
            missing = [job for job in _needed(jobs, done) if job.id not in done]
            for result in run(partial(run_job, problem), missing):
                state.save(f"job-{result.id}", result)
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
        number: of the round.
        results: of all earlier rounds.
        left: of the budget.
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
