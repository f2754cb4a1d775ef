"""One job of a search: where it starts, how it goes on, and what it finds."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from research.identify.leg import Choice, Vector
from research.identify.minimax import Rating, descend
from research.identify.problem import PENALTY, SAMPLES, TOE_SCALES, LegProblem
from research.identify.schedule import Phase

CLEAR = 0.995
"""Largest error with which a job ends at the bar [bars], so that the judge, who samples finer, agrees."""


@dataclass(frozen=True)
class Result:
    """What a job found.

    Attributes:
        id: round and index. phase: its name.
        root: id of the independent start that it goes back to.
        choice, x: the best leg, see `leg`.
        evaluations, seconds: spent. stop: why it ended.
        exact, both: merit [bars] with the exact solver alone and with both.
        standing: in words, with both solvers once the leg meets every bar with the exact one.
        confirmed: the full system finds every bar met and every claim true.
    """

    id: str
    phase: str
    root: str
    choice: Choice
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
        return cls(**{**data, "choice": Choice.from_dict(data["choice"]), "x": tuple(data["x"])})

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True)
class Job:
    """A job: its place in the search, the search's seed, what it may spend and what it may start from."""

    round: int
    index: int
    phase: Phase
    seed: int
    evaluations: int
    parents: tuple[Result, ...] = ()

    @property
    def id(self) -> str:
        return f"{self.round:03d}-{self.index:02d}"


class _CmaEs:
    """A generation of CMA-ES at a time, on `Objective.cost`."""

    def __init__(self, y: Vector, sigma: float, population: int, rng: np.random.Generator) -> None:
        import cma

        options = {
            "verbose": -9,
            "seed": np.nan,  # draws come from `randn` alone
            "randn": lambda *shape: rng.standard_normal(shape),
            "popsize": population,
            "tolfun": 1e-5,
            "CMA_stds": TOE_SCALES,
            "signals_filename": "",
        }
        self.es: Any = cma.CMAEvolutionStrategy(y, sigma, options)
        self.best, self.value, self.evaluations = y, np.inf, 0

    def advance(self, cost: Callable[[Vector], float]) -> None:
        points = [np.ascontiguousarray(point) for point in self.es.ask()]  # kernels know one type
        self.es.tell(points, [cost(point) for point in points])
        self.best, self.value = np.array(self.es.best.x), float(self.es.best.f)
        self.evaluations = int(self.es.countevals)

    def ended(self) -> str:
        """Why it cannot go on, or ""."""
        return ", ".join(self.es.stop())


class _Hops:
    """A descent at a time, on `Objective.rate`: from the start, then from beside the best so far."""

    def __init__(self, y: Vector, sigmas: tuple[float, ...], rng: np.random.Generator) -> None:
        self.sigmas, self.rng = sigmas, rng
        self.best, self.value, self.evaluations = y, np.inf, 0

    def advance(self, rate: Callable[[Vector], Rating]) -> None:
        hop = float(self.rng.choice(self.sigmas)) if self.evaluations else 0.0
        start = self.best + hop * TOE_SCALES * self.rng.standard_normal(self.best.size)
        central = bool(self.rng.integers(2))
        end = descend(rate, start, TOE_SCALES, penalty=PENALTY, central=central)
        self.evaluations += end.evaluations
        if (value := end.rating.merit(PENALTY)) < self.value:
            self.best, self.value = end.y, value

    def ended(self) -> str:
        return ""


def run_job(problem: LegProblem, job: Job) -> Result:
    """Run a job; the same job gives the same result, bit for bit."""
    began, phase, rng = time.monotonic(), job.phase, np.random.default_rng([job.seed, job.round, job.index])
    sigma = float(rng.choice(phase.sigmas))
    if phase.start == "best":
        parent = job.parents[job.index % len(job.parents)]
        choice, root = parent.choice, parent.root
        y = problem.inward(choice, np.array(parent.x), phase.samples)
    else:
        (choice, y), root = problem.begin(rng, phase), job.id
    objective = problem.objective(choice, phase.samples, phase.paper_solver, True)
    method: Any
    if phase.method == "cma":
        method, evaluate = _CmaEs(y, sigma, phase.population, rng), objective.cost
    else:
        method, evaluate = _Hops(y, phase.sigmas, rng), objective.rate
    judged, stop = np.inf, ""
    while not stop:
        met = False
        if phase.ends_at_bar and method.value < judged:
            x = problem.outward(choice, method.best, phase.samples)
            standing = problem.objective(choice, SAMPLES, phase.paper_solver).standing(x)
            judged, met = method.value, standing.met and abs(standing.error) <= CLEAR
        if method.evaluations >= job.evaluations:
            stop = "evaluations spent"
        else:
            stop = "bar reached" if met else method.ended()
        if not stop:
            method.advance(evaluate)
    x = problem.outward(choice, method.best, phase.samples)
    exact, both = (problem.objective(choice, SAMPLES, both).standing(x) for both in (False, True))
    return Result(
        id=job.id,
        phase=phase.name,
        root=root,
        choice=choice,
        x=tuple(x.tolist()),
        evaluations=method.evaluations,
        seconds=time.monotonic() - began,
        stop=stop,
        exact=problem.merit(choice, x, False),
        both=problem.merit(choice, x, True),
        standing=str(both if exact.met else exact),
        confirmed=both.met and problem.confirm(choice, x),
    )
