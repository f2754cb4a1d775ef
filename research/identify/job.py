"""One job: where it starts, how it goes on after a checkpoint, and what it found."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from research.identify.minimax import Rating, descend
from research.identify.records import Array, Job, Problem, Progress, Result, Standing
from research.identify.schedule import Phase

CHECKPOINT_EVERY = 10.0
"""Seconds between two checkpoints of a job."""
CLEAR = 0.995
"""Largest error with which a job ends at the bar [bars], so that the judge, who samples finer, agrees."""
TELL_EVERY = 0.5
"""Seconds between two reports of a job's progress."""
PENALTY = 2.0
"""What a shortage of one counts for in a minimax job [bars]."""


class _Method(Protocol):
    """How a job looks for better candidates; it pickles."""

    best: Array
    value: float
    evaluations: int

    def advance(self, evaluate: Any) -> None:
        """Go on a little."""

    def ended(self) -> str:
        """Why it cannot go on, or ""."""


class _Normal:
    """`randn` for cma from a generator of the job's own, which its checkpoint contains."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def __call__(self, *shape: int) -> Array:
        return self.rng.standard_normal(shape)


class _CmaEs:
    """A generation of CMA-ES at a time, on `Problem.cost`."""

    def __init__(
        self, y: Array, sigma: float, population: int, scales: Array, rng: np.random.Generator
    ) -> None:
        import cma

        options = {
            "verbose": -9,
            "seed": np.nan,  # draws come from `randn` alone
            "randn": _Normal(rng),
            "popsize": population,
            "tolfun": 1e-5,
            "CMA_stds": scales,
            "signals_filename": "",
        }
        self.es: Any = cma.CMAEvolutionStrategy(y, sigma, options)
        self.best, self.value, self.evaluations = y, np.inf, 0

    def advance(self, evaluate: Callable[[Array], float]) -> None:
        points = [
            np.ascontiguousarray(point) for point in self.es.ask()
        ]  # rows of one: kernels know one type
        self.es.tell(points, [evaluate(point) for point in points])
        self.best, self.value = np.array(self.es.best.x), float(self.es.best.f)
        self.evaluations = int(self.es.countevals)

    def ended(self) -> str:
        return ", ".join(self.es.stop())


class _Hops:
    """A descent at a time, on `Problem.rate`: from the start, then from beside the best so far."""

    def __init__(self, y: Array, sigmas: tuple[float, ...], scales: Array, rng: np.random.Generator) -> None:
        self.sigmas, self.scales, self.rng = sigmas, scales, rng
        self.best, self.value, self.evaluations = y, np.inf, 0

    def advance(self, evaluate: Callable[[Array], Rating]) -> None:
        hop = float(self.rng.choice(self.sigmas)) if self.evaluations else 0.0
        start = self.best + hop * self.scales * self.rng.standard_normal(self.best.size)
        central = bool(self.rng.integers(2))
        found = descend(evaluate, start, self.scales, penalty=PENALTY, central=central)
        self.evaluations += found.evaluations
        if (value := found.rating.merit(PENALTY)) < self.value:
            self.best, self.value = found.y, value

    def ended(self) -> str:
        return ""


@dataclass
class _Run:
    """A started job: all that a checkpoint contains."""

    method: _Method
    choice: dict[str, Any]
    root: str
    sigma: float
    population: int
    seconds: float = 0.0


def run_job(
    problem: Problem,
    job: Job,
    checkpoint: bytes | None,
    save: Callable[[bytes], None],
    tell: Callable[[Progress], None],
    every: float = CHECKPOINT_EVERY,
) -> Result:
    """Run a job, or the rest of it after a checkpoint; either way the result is the same, bit for bit.

    Args:
        save: called with a checkpoint every so many seconds.
        tell: called with the progress now and then.
        every: seconds between two checkpoints.
    """
    run: _Run = pickle.loads(checkpoint) if checkpoint is not None else _start(problem, job)
    phase, method = job.phase, run.method
    evaluate = (problem.rate if phase.method == "minimax" else problem.cost)(run.choice, phase)
    before, began = run.seconds, time.monotonic()
    saved = told = began
    judged = np.inf
    while True:
        met = False
        if phase.ends_at_bar and method.value < judged:
            standing = _standing(problem, run, phase)
            judged, met = method.value, standing.met and abs(standing.error) <= CLEAR
        now = time.monotonic()
        run.seconds = before + now - began
        if now - told > TELL_EVERY and method.evaluations:
            tell(Progress(job.id, method.evaluations, method.value, _standing(problem, run, phase)))
            told = now
        stop = _stop(job, method, met)
        if stop:
            break
        if now - saved > every:
            save(pickle.dumps(run))
            saved = now
        method.advance(evaluate)
    return _result(problem, job, run, stop)


def _start(problem: Problem, job: Job) -> _Run:
    phase, rng = job.phase, np.random.default_rng([job.seed, job.round, job.index])
    sigma, population = float(rng.choice(phase.sigmas)), int(rng.choice(phase.populations))
    root = job.id
    if phase.start == "cold":
        choice, y = problem.cold(rng, phase)
    elif phase.start == "given":
        choice, y = problem.given(rng, phase)
    else:
        parent = job.parents[job.index % len(job.parents)]
        choice, root = parent.choice, parent.root
        y = problem.inward(choice, np.array(parent.x), phase)
    scales = problem.scales(choice, phase)
    if phase.method == "minimax":
        return _Run(_Hops(y, phase.sigmas, scales, rng), choice, root, 0.0, 0)
    return _Run(_CmaEs(y, sigma, population, scales, rng), choice, root, sigma, population)


def _standing(problem: Problem, run: _Run, phase: Phase) -> Standing:
    """Of the best candidate so far."""
    x = problem.outward(run.choice, run.method.best, phase)
    return problem.standing(run.choice, x, phase.paper_solver)


def _stop(job: Job, method: _Method, met: bool) -> str:
    """Why a job ends now, or ""."""
    if method.evaluations >= job.evaluations:
        return "evaluations spent"
    if met:
        return "bar reached"
    for evaluations, value in job.phase.give_up:
        if method.evaluations >= evaluations and method.value > value:
            return f"cost above {value:g} after {evaluations} evaluations"
    return method.ended()


def _result(problem: Problem, job: Job, run: _Run, stop: str) -> Result:
    began = time.monotonic()
    x = problem.outward(run.choice, run.method.best, job.phase)
    exact, full = problem.rank(run.choice, x)
    both = None if full is None else problem.standing(run.choice, x, True)
    confirmed = both is not None and both.met and problem.confirm(run.choice, x)
    return Result(
        id=job.id,
        phase=job.phase.name,
        start=job.phase.start,
        root=run.root,
        choice=run.choice,
        sigma=run.sigma,
        population=run.population,
        evaluations=run.method.evaluations,
        seconds=run.seconds + time.monotonic() - began,
        stop=stop,
        x=x.tolist(),
        cost=run.method.value,
        exact=exact,
        full=full,
        standing=problem.standing(run.choice, x, False),
        both=both,
        confirmed=confirmed,
    )
