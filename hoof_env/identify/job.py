"""One CMA-ES run: where it starts, how it goes on after a checkpoint, and what it found."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hoof_env.identify.records import Array, Job, Problem, Progress, Result, Standing
from hoof_env.identify.schedule import Phase

CHECKPOINT_EVERY = 10.0
"""Seconds between two checkpoints of a job."""
CLEAR = 0.95
"""Largest error with which a job ends at the bar [bars], so that the judge, who samples finer, agrees."""
TELL_EVERY = 0.5
"""Seconds between two reports of a job's progress."""


class _Normal:
    """`randn` for cma from a generator of the job's own, which its checkpoint contains."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def __call__(self, *shape: int) -> Array:
        return self.rng.standard_normal(shape)


@dataclass
class _Run:
    """A started job: all that a checkpoint contains."""

    es: Any
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
    phase, es = job.phase, run.es
    cost = problem.cost(run.choice, phase)
    before, began = run.seconds, time.monotonic()
    saved = told = began
    judged = np.inf
    while True:
        met = False
        if phase.ends_at_bar and es.best.f < judged:
            standing = _standing(problem, run, phase)
            judged, met = es.best.f, standing.met and abs(standing.error) <= CLEAR
        now = time.monotonic()
        run.seconds = before + now - began
        if now - told > TELL_EVERY and es.countevals:
            standing = _standing(problem, run, phase)
            tell(Progress(job.id, int(es.countevals), float(es.best.f), standing))
            told = now
        stop = _stop(job, es, met)
        if stop:
            break
        if now - saved > every:
            save(pickle.dumps(run))
            saved = now
        points = es.ask()
        es.tell(points, [cost(x) for x in points])
    return _result(problem, job, run, stop)


def _start(problem: Problem, job: Job) -> _Run:
    import cma

    phase, rng = job.phase, np.random.default_rng([job.seed, job.round, job.index])
    sigma, population = float(rng.choice(phase.sigmas)), int(rng.choice(phase.populations))
    root = job.id
    if phase.start == "cold":
        choice, x = problem.cold(rng, phase)
        y = problem.inward(choice, x, phase)
    elif phase.start == "given":
        choice, x = problem.given()
        step = sigma * float(rng.choice(phase.spreads)) * problem.scales(choice, phase)
        y = problem.inward(choice, x, phase)
        y = y + step * rng.standard_normal(y.size)
    else:
        best = 0 if rng.random() < phase.favour else int(rng.integers(len(job.parents)))
        parent = job.parents[best]
        choice, root = parent.choice, parent.root
        y = problem.inward(choice, np.array(parent.x), phase)
    options = {
        "verbose": -9,
        "seed": np.nan,  # draws come from `randn` alone
        "randn": _Normal(rng),
        "popsize": population,
        "tolfun": 1e-5,
        "CMA_stds": problem.scales(choice, phase),
        "signals_filename": "",
    }
    return _Run(cma.CMAEvolutionStrategy(y, sigma, options), choice, root, sigma, population)


def _standing(problem: Problem, run: _Run, phase: Phase) -> Standing:
    """Of the best candidate so far."""
    x = problem.outward(run.choice, run.es.best.x, phase)
    return problem.standing(run.choice, x, phase.paper_solver)


def _stop(job: Job, es: Any, met: bool) -> str:
    """Why a job ends now, or ""."""
    if es.countevals >= job.evaluations:
        return "evaluations spent"
    if met:
        return "bar reached"
    for evaluations, cost in job.phase.give_up:
        if es.countevals >= evaluations and es.best.f > cost:
            return f"cost above {cost:g} after {evaluations} evaluations"
    return ", ".join(es.stop())


def _result(problem: Problem, job: Job, run: _Run, stop: str) -> Result:
    began = time.monotonic()
    x = problem.outward(run.choice, np.array(run.es.best.x), job.phase)
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
        evaluations=int(run.es.countevals),
        seconds=run.seconds + time.monotonic() - began,
        stop=stop,
        x=x.tolist(),
        cost=float(run.es.best.f),
        exact=exact,
        full=full,
        standing=problem.standing(run.choice, x, False),
        both=both,
        confirmed=confirmed,
    )
