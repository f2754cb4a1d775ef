"""One attempt at a further member of an ensemble: a push through the region of legs that fit, and a verdict.

That region is thin and bent: at the bar a dozen rows are at their limits at once, and a leg that is moved at
random and then repaired hardly ever comes back to it. So a leg is pushed inside it instead, as far in a given
direction as it goes, by sequential linear programming with the rows and demands as limits (`minimax.descend`
with the push as its only row and everything else as a demand).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.confirm import COUNTED, confirm
from research.identify.job import CLEAR
from research.identify.leg import Vector, to_preset
from research.identify.minimax import Rate, Rating, descend
from research.identify.objective import INSIDE, MISSED_ROW
from research.identify.problem import TOE_SCALES, LegProblem

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

    def rate(self, both: bool) -> Rate:
        """Rating of y, with the exact solver alone or with both."""
        return self.problem.objective(SAMPLES, both, by_toe=True).rate

    def runs(self, y: Vector) -> bool:
        """Whether the paper's solver comes through both cycles; near a dead point it may not."""
        rows = self.problem.objective(SAMPLES, False).paper_rows(self.problem.outward(y, SAMPLES))
        return bool(np.abs(rows).max() < MISSED_ROW)


@dataclass(frozen=True)
class Task:
    """An attempt to be made.

    Attributes:
        round, index: its place.
        seed: of its random numbers, with its place.
        start: name of the start that it goes back to.
        y: the leg that it goes on from, as a search by touch-down has it; for a start x.
        direction: unit vector, shape as y, in a search's scales; empty for a start.
    """

    round: int
    index: int
    seed: int
    start: str
    y: tuple[float, ...]
    direction: tuple[float, ...] = ()

    @property
    def id(self) -> str:
        return f"{self.round:04d}-{self.index:02d}"


@dataclass(frozen=True)
class Attempt:
    """A made attempt; see `Task`. Its merit is the largest error [bars] and what shortages cost, see
    `Aim.penalty`; `MISSED_ROW` if the paper's solver cannot simulate the leg."""

    id: str
    start: str
    y: tuple[float, ...]
    merit: float


@dataclass(frozen=True)
class Verdict:
    """What the full system says of an attempt.

    Attributes:
        preset: the leg, content of a preset file; empty if it does not turn.
        errors: by solver, the largest error of a row [bars].
        short: demands that fall short, by name.
        reasons: why it is no member, in words; empty for a member.
    """

    preset: Mapping[str, Any]
    errors: Mapping[str, float]
    short: Mapping[str, float]
    reasons: tuple[str, ...]


def attempt(task: Task, aim: Aim) -> Attempt:
    """Make an attempt; the same task and aim give the same result."""
    if task.direction:
        y = _push(task, aim)
    else:
        y = aim.problem.inward(np.array(task.y), SAMPLES)
        for both in (False, True) if aim.both else (False,):
            y = _enter(task, both, y, aim)
    merit = aim.rate(aim.both)(y).merit(aim.penalty) if aim.runs(y) else MISSED_ROW
    return Attempt(task.id, task.start, tuple(y.tolist()), merit)


def _enter(task: Task, both: bool, y: Vector, aim: Aim) -> Vector:
    """Descents from y, then from beside the best so far, until one is within the bar."""
    rate, rng = aim.rate(both), np.random.default_rng([task.seed, task.round, task.index])
    lowest, goal, start = rate(y).merit(aim.penalty) if aim.runs(y) else np.inf, CLEAR * aim.bar, y
    for _ in range(TRIES):
        if lowest <= goal:
            break
        end = descend(rate, start, TOE_SCALES, penalty=aim.penalty, central=True, goal=goal)
        merit = end.rating.merit(aim.penalty)
        if merit < lowest and aim.runs(end.y):
            y, lowest = end.y, merit
        start = y + float(rng.choice(HOPS)) * TOE_SCALES * rng.standard_normal(y.size)
    return y


def _push(task: Task, aim: Aim) -> Vector:
    """The leg that a push ends with; that which it goes on from unless the new one is within the bar."""
    rate, origin, limit = aim.rate(aim.both), np.array(task.y), CLEAR * aim.bar
    direction = np.array(task.direction) / TOE_SCALES

    def missing(y: Vector) -> Rating:
        """What is still missing to `REACH` from the origin, limited by rows and demands."""
        rating = rate(y)
        errors = [rating.rows, -rating.rows, *rating.peaks.values()]
        limits = np.concatenate([*(error - limit for error in errors), rating.demands])
        return Rating(np.array([REACH - (y - origin) @ direction]), limits, {})

    end = descend(missing, origin, TOE_SCALES, penalty=FIRM, central=True, iterations=aim.steps)
    within = rate(end.y).merit(aim.penalty) <= aim.bar and aim.runs(end.y)
    return end.y if within else origin


def judge(made: Attempt, aim: Aim) -> tuple[str, Verdict]:
    """Id and verdict of the full system, with demands sampled finely."""
    problem, x = aim.problem, aim.problem.outward(np.array(made.y), SAMPLES)
    short = problem.objective(FINE, aim.both).plausibility(x)
    try:
        preset = to_preset(x, problem.choice, "a candidate of an ensemble")
        run = confirm(preset)
    except HoofEnvError as error:  # a dead point between two samples, a gait beyond its limits
        return made.id, Verdict({}, {}, short, (f"cannot be simulated: {error}",))
    counted = [name for name in COUNTED if aim.both or name == "exact"]
    far = [f"{name} error of {run.errors[name]:.2f} bars" for name in counted if run.errors[name] > aim.bar]
    solvers = [COUNTED[name] for name in counted]
    untrue = [f"{claim} ({solver})" for claim, solver in run.untrue if solver in solvers]
    return made.id, Verdict(preset, run.errors, short, (*far, *short, *untrue))
