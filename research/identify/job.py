"""One job of a search: where it starts, how it goes on, and what it finds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from research.identify.leg import Vector
from research.identify.minimax import Rating, descend
from research.identify.problem import PENALTY, SAMPLES, TOE_SCALES, LegProblem

CLEAR = 0.995
"""Largest error with which a job ends at the bar [bars], so that the judge, who samples finer, agrees."""

POPULATION = 20
"""Of CMA-ES."""


PAPER_WEIGHT = 12
"""How many evaluations one with the paper's solver counts for: it takes that much longer."""


@dataclass(frozen=True)
class Phase:
    """One or more rounds of equal jobs, each from a start of its own.

    Attributes:
        name: in reports.
        jobs, rounds: jobs a round, and rounds.
        evaluations: at most, a job; a descent that has begun is finished.
        sigmas: one is drawn for a job of CMA-ES, or for each hop between descents; in scales.
        method: "cma" (CMA-ES on the cost of all errors) or "minimax" (descents of the largest error, each
            from beside the best so far, see `minimax`).
        elite: how many independent starts are refined, job i from the best result of the i-th best of them;
            0: a job is an independent start, from a leg around the preset.
        below: results of other phases that are further out with the exact solver [bars] are not refined;
            without any left the phase is skipped.
        samples: instants a revolution.
        paper_solver: the objective contains the paper's solver too.
        ends_at_bar: a job ends as soon as all rows are clear within their bars and nothing falls short.
    """

    name: str
    jobs: int
    evaluations: int
    sigmas: tuple[float, ...]
    method: str = "cma"
    rounds: int = 1
    elite: int = 0
    below: float = float("inf")
    samples: int = 101
    paper_solver: bool = False
    ends_at_bar: bool = False

    @property
    def weight(self) -> int:
        """What an evaluation counts for."""
        return PAPER_WEIGHT if self.paper_solver else 1


@dataclass(frozen=True)
class Result:
    """What a job found.

    Attributes:
        id: round and index.
        phase: its name.
        root: id of the independent start that it goes back to.
        x: the best leg, see `leg`.
        evaluations, seconds: spent.
        exact, both: merit [bars] with the exact solver alone and with both.
        standing: in words, with both solvers once the leg meets every bar with the exact one.
        confirmed: the full system finds every bar met and every claim true.
    """

    id: str
    phase: str
    root: str
    x: tuple[float, ...]
    evaluations: int
    seconds: float
    exact: float
    both: float
    standing: str
    confirmed: bool


@dataclass(frozen=True)
class Job:
    """A job: its place in the search, the search's seed, what it may spend and where it starts: around x, or
    from what the job `root` came to."""

    round: int
    index: int
    phase: Phase
    seed: int
    evaluations: int
    x: tuple[float, ...]
    root: str = ""

    @property
    def id(self) -> str:
        return f"{self.round:03d}-{self.index:02d}"


Progress = Iterator[tuple[Vector, float, int]]
"""The best y so far, its value and the evaluations spent, again and again."""


def evolve(cost: Callable[[Vector], float], y: Vector, sigma: float, rng: np.random.Generator) -> Progress:
    """CMA-ES on `Objective.cost`, a generation at a time, until it has converged."""
    import cma

    options = {
        "verbose": -9,
        "seed": np.nan,  # draws come from `randn` alone
        "randn": lambda *shape: rng.standard_normal(shape),
        "popsize": POPULATION,
        "tolfun": 1e-5,
        "CMA_stds": TOE_SCALES,
        "signals_filename": "",
    }
    strategy = cma.CMAEvolutionStrategy(y, sigma, options)
    while not strategy.stop():
        points = [np.ascontiguousarray(point) for point in strategy.ask()]  # kernels know one type
        strategy.tell(points, [cost(point) for point in points])
        yield np.array(strategy.best.x), float(strategy.best.f), int(strategy.countevals)


def hop(
    rate: Callable[[Vector], Rating], y: Vector, sigmas: tuple[float, ...], rng: np.random.Generator
) -> Progress:
    """Descents of `Objective.rate`, one at a time: from y, then from beside the best so far."""
    value, spent = np.inf, 0
    while True:
        size = float(rng.choice(sigmas)) if spent else 0.0
        start = y + size * TOE_SCALES * rng.standard_normal(y.size)
        end = descend(rate, start, TOE_SCALES, penalty=PENALTY, central=bool(rng.integers(2)))
        spent += end.evaluations
        if end.rating.merit(PENALTY) < value:
            y, value = end.y, end.rating.merit(PENALTY)
        yield y, value, spent


def run_job(problem: LegProblem, job: Job) -> Result:
    """Run a job; the same job gives the same result, bit for bit."""
    began, phase, rng = time.monotonic(), job.phase, np.random.default_rng([job.seed, job.round, job.index])
    sigma, x = float(rng.choice(phase.sigmas)), np.array(job.x)
    y = problem.inward(x, phase.samples) if job.root else problem.around(x, phase.samples, rng)
    objective = problem.objective(phase.samples, phase.paper_solver, True)
    if phase.method == "cma":
        progress = evolve(objective.cost, y, sigma, rng)
    else:
        progress = hop(objective.rate, y, phase.sigmas, rng)
    judged, spent = np.inf, 0
    for y, value, spent in progress:
        if phase.ends_at_bar and value < judged:
            judged, x = value, problem.outward(y, phase.samples)
            standing = problem.objective(SAMPLES, phase.paper_solver).standing(x)
            if standing.met and abs(standing.error) <= CLEAR:
                break
        if spent >= job.evaluations:
            break
    x = problem.outward(y, phase.samples)
    exact, both = (problem.objective(SAMPLES, both).standing(x) for both in (False, True))
    return Result(
        id=job.id,
        phase=phase.name,
        root=job.root or job.id,
        x=tuple(x.tolist()),
        evaluations=spent,
        seconds=time.monotonic() - began,
        exact=problem.merit(x, False),
        both=problem.merit(x, True),
        standing=both.words if exact.met else exact.words,
        confirmed=both.met and problem.confirm(x),
    )
