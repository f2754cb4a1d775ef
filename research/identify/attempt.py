"""One attempt at a further member of an ensemble: a push through the region of legs that fit, and a verdict.

That region is thin and bent: at the bar a dozen rows are at their limits at once, and a leg that is moved at
random and then repaired hardly ever comes back to it. So a leg is pushed inside it instead, as far in a given
direction as it goes, by sequential linear programming with the rows and demands as limits (`minimax.descend`
with the push as its only row and everything else as a demand).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.confirm import confirm
from research.identify.job import CLEAR
from research.identify.leg import Choice, Vector, to_preset
from research.identify.measure import MISSED_ROW
from research.identify.minimax import Rate, Rating, descend
from research.identify.objective import INSIDE
from research.identify.problem import TOE_SCALES, LegProblem

SOLVERS = ("exact", "paper")

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

SAMPLES, FINE = 801, 2001
"""Instants a revolution, and those at which the demands on a member are checked. At the bar 401 are up to
0.02 bars wrong, 801 up to 0.003."""


@dataclass(frozen=True)
class Aim:
    """What a member must meet.

    Attributes:
        problem: rows and demands.
        bar: largest error of a row, in units of its own bar.
        both: the paper's solver counts too, all rows but the ill-conditioned.
        steps: of a push, at most.
    """

    problem: LegProblem
    bar: float
    both: bool
    steps: int = STEPS

    @property
    def penalty(self) -> float:
        """Of a shortage of one [bars]: a merit within the bar leaves no demand short, since `Objective.rate`
        asks for `INSIDE` more than they do."""
        return self.bar / INSIDE

    def rate(self, choice: Choice, both: bool) -> Rate:
        """Rating of y, with the exact solver alone or with both."""
        return self.problem.objective(choice, SAMPLES, both, by_toe=True).rate

    def runs(self, choice: Choice, y: Vector) -> bool:
        """Whether the paper's solver comes through both cycles; near a dead point it may not."""
        x = self.problem.outward(choice, y, SAMPLES)
        rows = self.problem.objective(choice, SAMPLES, False).paper_rows(x)
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
    choice: Choice
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
    choice: Choice
    y: tuple[float, ...]
    merit: float
    evaluations: int
    seconds: float
    errors: Mapping[str, float]
    short: Mapping[str, float]
    untrue: tuple[str, ...] = ()

    def holds(self, aim: Aim) -> bool:
        """Whether the full system has found it a member."""
        return bool(self.errors) and not self.reasons(aim)

    def reasons(self, aim: Aim) -> list[str]:
        """Why the full system refuses it."""
        counted = {solver: self.errors[solver] for solver in (SOLVERS if aim.both else SOLVERS[:1])}
        errors = [f"{s} error of {error:.2f} bars" for s, error in counted.items() if error > aim.bar]
        return [*errors, *self.short, *self.untrue]

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Attempt:
        """Inverse of `dataclasses.asdict`; KeyError or TypeError for anything else."""
        choice = Choice.from_dict(data["choice"])
        return cls(**{**data, "choice": choice, "y": tuple(data["y"]), "untrue": tuple(data["untrue"])})

    def preset(self, aim: Aim) -> dict[str, Any]:
        """The content of a preset file.

        Raises:
            HoofEnvError: the leg does not turn, or a gait is beyond its limits.
        """
        return to_preset(self.x(aim), self.choice, "a candidate of an ensemble")

    def x(self, aim: Aim) -> Vector:
        return aim.problem.outward(self.choice, np.array(self.y), SAMPLES)


def attempt(task: Task, aim: Aim) -> Attempt:
    """Make an attempt; the same task and aim give the same result."""
    began, choice = time.monotonic(), task.choice
    if task.direction:
        y, spent = _push(task, aim)
    else:
        y, spent = aim.problem.inward(choice, np.array(task.y), SAMPLES), 0
        for both in (False, True) if aim.both else (False,):
            y, more = _enter(task, both, y, aim)
            spent += more
    merit = aim.rate(choice, aim.both)(y).merit(aim.penalty) if aim.runs(choice, y) else MISSED_ROW
    seconds = time.monotonic() - began
    return Attempt(task.id, task.origin, task.start, choice, tuple(y.tolist()), merit, spent, seconds, {}, {})


def _enter(task: Task, both: bool, y: Vector, aim: Aim) -> tuple[Vector, int]:
    """Descents from y, then from beside the best so far, until one is within the bar."""
    rate, rng = aim.rate(task.choice, both), np.random.default_rng([task.seed, task.round, task.index])
    lowest, goal, spent, start = rate(y).merit(aim.penalty), CLEAR * aim.bar, 1, y
    if not aim.runs(task.choice, y):
        lowest = np.inf
    for _ in range(TRIES):
        if lowest <= goal:
            break
        end = descend(rate, start, TOE_SCALES, penalty=aim.penalty, central=True, goal=goal)
        spent += end.evaluations
        merit = end.rating.merit(aim.penalty)
        if merit < lowest and aim.runs(task.choice, end.y):
            y, lowest = end.y, merit
        start = y + float(rng.choice(HOPS)) * TOE_SCALES * rng.standard_normal(y.size)
    return y, spent


def _push(task: Task, aim: Aim) -> tuple[Vector, int]:
    """The leg that a push ends with; that which it goes on from unless the new one is within the bar."""
    rate, origin, limit = aim.rate(task.choice, aim.both), np.array(task.y), CLEAR * aim.bar
    direction = np.array(task.direction) / TOE_SCALES

    def missing(y: Vector) -> Rating:
        """What is still missing to `REACH` from the origin, limited by rows and demands."""
        rating = rate(y)
        errors = [rating.rows, -rating.rows, *rating.peaks.values()]
        limits = np.concatenate([*(error - limit for error in errors), rating.demands])
        return Rating(np.array([REACH - (y - origin) @ direction]), limits, {})

    end = descend(missing, origin, TOE_SCALES, penalty=FIRM, central=True, iterations=aim.steps)
    within = rate(end.y).merit(aim.penalty) <= aim.bar and aim.runs(task.choice, end.y)
    return end.y if within else origin, end.evaluations


def judge(made: Attempt, aim: Aim) -> Attempt:
    """The same with the verdict of the full system, and of demands sampled finely."""
    problem = aim.problem
    short = problem.objective(made.choice, FINE, aim.both).plausibility(made.x(aim))
    try:
        verdict = confirm(made.preset(aim), problem.targets, problem.walk, problem.beta)
    except HoofEnvError as error:  # a dead point between two samples, a gait beyond its limits
        missed = dict.fromkeys(SOLVERS, MISSED_ROW)
        return replace(made, errors=missed, short=short, untrue=(f"cannot be simulated: {error}",))
    counted = verdict.counted if aim.both else verdict.counted[:1]
    untrue = tuple(f"{claim} ({solver})" for claim, solver in verdict.untrue if solver in counted)
    return replace(made, errors=dict(zip(SOLVERS, verdict.errors, strict=True)), short=short, untrue=untrue)
