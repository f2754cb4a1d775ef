"""A search: rounds of jobs, each of which goes down from a start of its own.

What a job starts from depends on earlier rounds alone, so that the number of processes, a kill and a
resumption change nothing in what is found.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.confirm import confirm
from research.identify.leg import SCALES, Choice, Vector, to_preset
from research.identify.minimax import Rating, descend
from research.identify.objective import Objective, with_toe
from research.identify.resume import State, processes

TOE_SCALES = with_toe(SCALES, 0.1, 0.3)  # of a search by touch-down
SPREADS = (0.0, 0.15, 0.3, 0.5)  # how far a start may lie from the preset, in scales
TRIES = 300  # random legs of which a start is the best
SAMPLES = 401  # instants a revolution with which candidates of all phases are compared
PENALTY = 2.0  # what a shortage of one counts for [bars]
CLEAR = 0.995  # largest error with which a job ends at the bar [bars]; the judge, who samples finer, agrees
POPULATION = 20  # of CMA-ES
PAPER_WEIGHT = 12  # evaluations that one with the paper's solver counts for: it takes that much longer


@dataclass(frozen=True)
class LegProblem:
    """What is searched: legs of one choice that meet the paper's rows. A search goes by touch-down, in
    coordinates y; see `Objective`."""

    choice: Choice

    def objective(self, samples: int, both: bool, by_toe: bool = False) -> Objective:
        return _objective(self.choice, samples, both, by_toe)

    def around(self, x: Vector, samples: int, rng: np.random.Generator) -> Vector:
        """A start y near x: the best of many."""
        y, spread = self.inward(x, samples), float(rng.choice(SPREADS))
        if not spread:
            return y
        tries = [y + spread * TOE_SCALES * rng.standard_normal(y.size) for _ in range(TRIES)]
        return min(tries, key=self.objective(samples, False, True).cost)

    def inward(self, x: Vector, samples: int) -> Vector:
        """The same candidate in the coordinates of a search."""
        return self.objective(samples, False).to_touch_down(x)

    def outward(self, y: Vector, samples: int) -> Vector:
        return self.objective(samples, False, True).from_touch_down(y)

    def merit(self, x: Vector, both: bool) -> float:
        """What compares candidates of different phases [bars]."""
        return self.objective(SAMPLES, both).rate(x).merit(PENALTY)

    def confirm(self, x: Vector) -> bool:
        try:
            return confirm(to_preset(x, self.choice, "a candidate of a search")).holds
        except HoofEnvError:  # a dead point between two samples, a gait beyond its limits
            return False


@lru_cache(maxsize=16)
def _objective(choice: Choice, samples: int, both: bool, by_toe: bool) -> Objective:
    return Objective(choice, samples=samples, paper_solver=both, by_toe=by_toe)


@dataclass(frozen=True)
class Phase:
    """One or more rounds of equal jobs, each from a start of its own.

    The `method` is "cma" (CMA-ES on the cost of all errors) or "minimax" (descents of the largest error, each
    from beside the best so far). Job i refines the best result of the i-th best of `elite` independent
    starts; with 0 it is such a start itself, from a leg around the preset.
    """

    name: str
    jobs: int  # a round
    evaluations: int  # at most, a job; a descent that has begun is finished
    sigmas: tuple[float, ...]  # one is drawn for a job of CMA-ES, or for each hop; in scales
    method: str = "cma"
    rounds: int = 1
    elite: int = 0
    below: float = float("inf")  # results of other phases further out, exact solver, are not refined [bars]
    samples: int = 101  # instants a revolution
    paper_solver: bool = False  # the objective contains the paper's solver too
    ends_at_bar: bool = False  # as soon as all rows are clear within their bars and nothing falls short

    @property
    def weight(self) -> int:
        return PAPER_WEIGHT if self.paper_solver else 1


@dataclass(frozen=True)
class Result:
    """What a job found: the best leg x; its merit [bars] with the exact solver alone and with both; in words
    where it stands, with both once it meets every bar with the exact one; and whether the full system finds
    every bar met and every claim true. `root`: id of the independent start that it goes back to."""

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


Progress = Iterator[tuple[Vector, float, int]]  # the best y so far, its value and the evaluations spent


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


BUDGET = 10_000_000  # evaluations of a search unless told otherwise; one takes some 0.1 ms

_DESCEND = Phase("descend", 8, 4_000, (0.003, 0.01, 0.03, 0.1), method="minimax", elite=8, samples=401)
_POLISH = replace(_DESCEND, name="polish", jobs=4, elite=2, rounds=3, evaluations=16_000, ends_at_bar=True)
_BOTH = replace(
    _POLISH, name="both solvers", rounds=2, evaluations=8_000, sigmas=(0.002, 0.005, 0.01, 0.02, 0.04),
    below=1.5, paper_solver=True,
)  # fmt: skip

SCHEDULE = (
    Phase("around", 24, 4_000, (0.1,)),
    Phase("settle", 8, 8_000, (0.05,), elite=8),
    _DESCEND,
    _POLISH,
    _BOTH,
)


def search(
    problem: LegProblem,
    start: tuple[float, ...],
    schedule: Sequence[Phase],
    state: State,
    report: Callable[[Phase, Result], None],
    *,
    seed: int,
    budget: int,
    workers: int = 2,
) -> list[Result]:
    """Run or resume a search from `start`, x of the preset, until a candidate is confirmed or the budget of
    evaluations, each by its phase's weight, is spent. The results are in the order of the jobs; a confirmed
    candidate is the last. `report` is called with each as it comes."""
    results: list[Result] = []
    spent = 0
    phases = itertools.chain.from_iterable(itertools.repeat(phase, phase.rounds) for phase in schedule)
    with processes(workers) as run:
        for number, phase in enumerate(itertools.cycle(phases)):
            if spent >= budget:
                break
            jobs = plan(number, phase, start, results, seed, budget - spent)
            for result in state.finish(jobs, partial(run_job, problem), Result, run, partial(report, phase)):
                results.append(result)
                spent += phase.weight * result.evaluations
                if result.confirmed:
                    return results
    return results


def plan(
    number: int, phase: Phase, start: tuple[float, ...], results: Sequence[Result], seed: int, left: int
) -> list[Job]:
    """The jobs of a round after these results, `left` of the budget: none where nothing is left to refine."""
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
