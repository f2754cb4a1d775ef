"""One attempt at a further member of an ensemble: a push through the region of legs that fit, and a verdict.

That region is thin and bent: at the bar a dozen rows are at their limits at once, and a leg that is moved at
random and then repaired hardly ever comes back to it. So a leg is pushed inside it instead, as far in a given
direction as it goes, by sequential linear programming with the rows and demands as limits (`minimax.descend`
with the push as its only row and everything else as a demand).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hoof_env.errors import HoofEnvError
from hoof_env.paper.rows import severity
from research.identify.candidate import Choice, to_preset
from research.identify.confirm import JUDGED, confirm
from research.identify.ensemble import SOLVERS
from research.identify.evaluate import MISSED_ROW
from research.identify.job import CLEAR
from research.identify.minimax import Rate, Rating, descend
from research.identify.objective import INSIDE
from research.identify.problem import LegProblem
from research.identify.records import Array
from research.identify.schedule import Phase
from research.identify.targets import Targets

HOPS = (0.002, 0.005, 0.01, 0.03)
"""Sizes of the hops, in a search's scales, between descents of a start that is outside the bar."""

TRIES = 12
"""Descents at most of such a start, with each solver."""

REACH = 0.5
"""How far a push wants to go, in a search's scales: further than it ever gets."""

FIRM = 100.0
"""What a shortage of one costs a push, in scales: enough that none is worth its while."""

STEPS = 30
"""Steps of a push at most."""

PHASE = Phase("ensemble", "given", jobs=1, evaluations=0, sigmas=(), samples=801)
"""How coordinates are to be read. At the bar 401 samples are up to 0.02 bars wrong, these up to 0.003."""

FINE = 2001
"""Instants a revolution at which the demands on a member are checked."""


@dataclass(frozen=True)
class Aim:
    """What a member must meet.

    Attributes:
        targets: the rows. walk: "walks" or "brakes".
        bar: largest error of a row, in units of its own bar.
        both: the paper's solver counts too, all rows but the ill-conditioned.
        beta: of the paper's solver, "printed" or "probable".
        steps: of a push, at most.
    """

    targets: Targets
    walk: str
    bar: float
    both: bool
    beta: str = "probable"
    steps: int = STEPS

    @property
    def penalty(self) -> float:
        """Of a shortage of one [bars]: a merit within the bar leaves no demand short, since `Objective.rate`
        asks for `INSIDE` more than they do."""
        return self.bar / INSIDE

    def problem(self) -> LegProblem:
        return LegProblem(self.targets, self.walk, None, self.beta)

    def rate(self, choice: Mapping[str, Any], both: bool) -> Rate:
        """Rating of y, with the exact solver alone or with both."""
        legs = Choice.from_dict(choice)
        return self.problem().objective(legs, PHASE.samples, both, by_toe=True).rate

    def runs(self, choice: Mapping[str, Any], y: Array) -> bool:
        """Whether the paper's solver comes through both cycles; near a dead point it may not."""
        problem, legs = self.problem(), Choice.from_dict(choice)
        rows = problem.objective(legs, PHASE.samples, False).paper_rows(
            problem.outward(dict(choice), y, PHASE)
        )
        return bool(np.abs(rows).max() < MISSED_ROW)


@dataclass(frozen=True)
class Task:
    """An attempt to be made.

    Attributes:
        round, index: its place. seed: of its random numbers, with its place.
        origin, start: the attempt that it goes on from, and the start behind that; the same for a start.
        choice, y: the leg that it goes on from, y as a search by touch-down has it; for a start x.
        direction: unit vector, shape as y, in a search's scales; empty for a start.
    """

    round: int
    index: int
    seed: int
    origin: str
    start: str
    choice: Mapping[str, Any]
    y: tuple[float, ...]
    direction: tuple[float, ...] = ()

    @property
    def id(self) -> str:
        return f"{self.round:04d}-{self.index:02d}"


@dataclass(frozen=True)
class Attempt:
    """A made attempt; see `Task`.

    Attributes:
        merit: largest error [bars] and what shortages cost, see `Aim.penalty`; `MISSED_ROW` if the paper's
            solver cannot simulate the leg. evaluations, seconds: spent.
        errors: by solver, the largest error of a row [bars], by the full system; empty before its verdict.
        short: demands that fall short, by name. untrue: claims that the full system finds untrue, of the
            solvers that count.
    """

    id: str
    origin: str
    start: str
    choice: Mapping[str, Any]
    y: tuple[float, ...]
    merit: float
    evaluations: int
    seconds: float
    errors: Mapping[str, float]
    short: Mapping[str, float]
    untrue: tuple[str, ...] = ()

    def holds(self, aim: Aim) -> bool:
        """Whether the full system has found it a member."""
        counted = [error for solver, error in self.errors.items() if aim.both or solver == "exact"]
        return bool(counted) and max(counted) <= aim.bar and not self.short and not self.untrue

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Attempt:
        """Inverse of `to_dict`; KeyError or TypeError for anything else."""
        return cls(**{**data, "y": tuple(data["y"]), "untrue": tuple(data["untrue"])})

    def preset(self, aim: Aim, provenance: str = "a candidate of an ensemble") -> dict[str, Any]:
        """The content of a preset file.

        Raises:
            HoofEnvError: the leg does not turn, or a gait is beyond its limits.
        """
        return to_preset(self.x(aim), Choice.from_dict(self.choice), provenance, "candidate")

    def x(self, aim: Aim) -> Array:
        return aim.problem().outward(dict(self.choice), np.array(self.y), PHASE)


def attempt(task: Task, aim: Aim) -> Attempt:
    """Make an attempt; the same task and aim give the same result."""
    began = time.monotonic()
    problem, choice, rate = aim.problem(), dict(task.choice), aim.rate(task.choice, aim.both)
    scales = problem.scales(choice, PHASE)
    if task.direction:
        y, spent = _push(task, rate, scales, aim)
    else:
        y, spent = problem.inward(choice, np.array(task.y), PHASE), 0
        for both in (False, True) if aim.both else (False,):
            y, more = _enter(task, both, y, scales, aim)
            spent += more
    merit = rate(y).merit(aim.penalty) if aim.runs(choice, y) else MISSED_ROW
    seconds = time.monotonic() - began
    origin = (task.id, task.origin, task.start, task.choice)
    return Attempt(*origin, tuple(y.tolist()), merit, spent, seconds, {}, {})


def _enter(task: Task, both: bool, y: Array, scales: Array, aim: Aim) -> tuple[Array, int]:
    """Descents from y, then from beside the best so far, until one is within the bar."""
    rate, rng = aim.rate(task.choice, both), np.random.default_rng([task.seed, task.round, task.index])
    lowest, goal, spent, start = rate(y).merit(aim.penalty), CLEAR * aim.bar, 1, y
    if not aim.runs(task.choice, y):
        lowest = np.inf
    for _ in range(TRIES):
        if lowest <= goal:
            break
        found = descend(rate, start, scales, penalty=aim.penalty, central=True, goal=goal)
        spent += found.evaluations
        merit = found.rating.merit(aim.penalty)
        if merit < lowest and aim.runs(task.choice, found.y):
            y, lowest = found.y, merit
        start = y + float(rng.choice(HOPS)) * scales * rng.standard_normal(y.size)
    return y, spent


def _push(task: Task, rate: Rate, scales: Array, aim: Aim) -> tuple[Array, int]:
    """The leg that a push ends with; that which it goes on from unless the new one is within the bar."""
    y = np.array(task.y)
    pushed = _Pushed(rate, y, np.array(task.direction) / scales, CLEAR * aim.bar)
    found = descend(pushed, y, scales, penalty=FIRM, central=True, iterations=aim.steps)
    within = rate(found.y).merit(aim.penalty) <= aim.bar and aim.runs(task.choice, found.y)
    return found.y if within else y, found.evaluations


@dataclass(frozen=True)
class _Pushed:
    """A rating of what is still missing to `REACH` from y in a direction, limited by rows and demands."""

    rate: Rate
    y: Array
    direction: Array
    limit: float

    def __call__(self, y: Array) -> Rating:
        rating = self.rate(y)
        errors = [rating.rows, -rating.rows, *rating.peaks.values()]
        missing = REACH - (y - self.y) @ self.direction
        return Rating(
            np.array([missing]), np.concatenate([*(e - self.limit for e in errors), rating.demands]), {}
        )


def judge(made: Attempt, aim: Aim) -> Attempt:
    """The same with the verdict of the full system, and of demands sampled finely."""
    objective = aim.problem().objective(Choice.from_dict(made.choice), FINE, aim.both)
    shortages = zip(objective.demands, objective.plausibility(made.x(aim)).tolist(), strict=True)
    short = {name: shortage for name, shortage in shortages if shortage > 0}
    solvers = dict(zip(SOLVERS, JUDGED[aim.beta], strict=True))
    try:
        verdict = confirm(made.preset(aim), aim.targets, aim.walk, aim.beta)
    except HoofEnvError as error:  # a dead point between two samples, a gait beyond its limits
        missed = dict.fromkeys(SOLVERS, MISSED_ROW)
        return replace(made, errors=missed, short=short, untrue=(f"cannot be simulated: {error}",))
    run = verdict.reproduction
    errors = {
        name: max(
            (severity(r, run.published) for r in run.rows if r["solver"] == solver and not r["spared"]),
            default=MISSED_ROW,
        )
        for name, solver in solvers.items()
    }
    errors = {name: min(error, MISSED_ROW) for name, error in errors.items()}
    untrue = tuple(
        f"{claim} ({solver})" for claim, solver in verdict.untrue if aim.both or solver == solvers["exact"]
    )
    return replace(made, errors=errors, short=short, untrue=untrue)
