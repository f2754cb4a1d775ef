"""One job of a search: where it starts, how it goes on, and what it finds."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from research.identify.leg import Vector
from research.identify.minimax import Rating, descend
from research.identify.problem import PENALTY, SAMPLES, TOE_SCALES, LegProblem
from research.identify.schedule import Phase

CLEAR = 0.995
"""Largest error with which a job ends at the bar [bars], so that the judge, who samples finer, agrees."""

POPULATION = 20
"""Of CMA-ES."""


@dataclass(frozen=True)
class Result:
    """What a job found.

    Attributes:
        id: round and index. phase: its name.
        root: id of the independent start that it goes back to.
        x: the best leg, see `leg`.
        evaluations, seconds: spent. stop: why it ended.
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
    stop: str
    exact: float
    both: float
    standing: str
    confirmed: bool

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Result:
        """Inverse of `dataclasses.asdict`; KeyError or TypeError for anything else."""
        return cls(**{**data, "x": tuple(data["x"])})


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


class _CmaEs:
    """A generation of CMA-ES at a time, on `Objective.cost`."""

    def __init__(self, y: Vector, sigma: float, rng: np.random.Generator) -> None:
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
        self.es: Any = cma.CMAEvolutionStrategy(y, sigma, options)
        self.best, self.value, self.evaluations = y, np.inf, 0

    def advance(self, cost: Callable[[Vector], float]) -> str:
        """Go on a little; returns why it cannot go on further, or ""."""
        points = [np.ascontiguousarray(point) for point in self.es.ask()]  # kernels know one type
        self.es.tell(points, [cost(point) for point in points])
        self.best, self.value = np.array(self.es.best.x), float(self.es.best.f)
        self.evaluations = int(self.es.countevals)
        return ", ".join(self.es.stop())


class _Hops:
    """A descent at a time, on `Objective.rate`: from the start, then from beside the best so far."""

    def __init__(self, y: Vector, sigmas: tuple[float, ...], rng: np.random.Generator) -> None:
        self.sigmas, self.rng = sigmas, rng
        self.best, self.value, self.evaluations = y, np.inf, 0

    def advance(self, rate: Callable[[Vector], Rating]) -> str:
        """As `_CmaEs.advance`."""
        hop = float(self.rng.choice(self.sigmas)) if self.evaluations else 0.0
        start = self.best + hop * TOE_SCALES * self.rng.standard_normal(self.best.size)
        central = bool(self.rng.integers(2))
        end = descend(rate, start, TOE_SCALES, penalty=PENALTY, central=central)
        self.evaluations += end.evaluations
        if (value := end.rating.merit(PENALTY)) < self.value:
            self.best, self.value = end.y, value
        return ""


def run_job(problem: LegProblem, job: Job) -> Result:
    """Run a job; the same job gives the same result, bit for bit."""
    began, phase, rng = time.monotonic(), job.phase, np.random.default_rng([job.seed, job.round, job.index])
    sigma, x = float(rng.choice(phase.sigmas)), np.array(job.x)
    y = problem.inward(x, phase.samples) if job.root else problem.around(x, phase.samples, rng)
    objective = problem.objective(phase.samples, phase.paper_solver, True)
    method: Any = _CmaEs(y, sigma, rng) if phase.method == "cma" else _Hops(y, phase.sigmas, rng)
    evaluate = objective.cost if phase.method == "cma" else objective.rate
    judged, stop = np.inf, ""
    while not stop:
        stop = method.advance(evaluate)
        if phase.ends_at_bar and method.value < judged:
            judged = method.value
            x = problem.outward(method.best, phase.samples)
            standing = problem.objective(SAMPLES, phase.paper_solver).standing(x)
            if standing.met and abs(standing.error) <= CLEAR:
                stop = "bar reached"
        if method.evaluations >= job.evaluations:
            stop = "evaluations spent"
    x = problem.outward(method.best, phase.samples)
    exact, both = (problem.objective(SAMPLES, both).standing(x) for both in (False, True))
    return Result(
        id=job.id,
        phase=phase.name,
        root=job.root or job.id,
        x=tuple(x.tolist()),
        evaluations=method.evaluations,
        seconds=time.monotonic() - began,
        stop=stop,
        exact=problem.merit(x, False),
        both=problem.merit(x, True),
        standing=both.words if exact.met else exact.words,
        confirmed=both.met and problem.confirm(x),
    )
