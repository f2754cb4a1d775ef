"""Collecting an ensemble: rounds of attempts from the legs found so far, kept as files and resumable.

The region of legs that fit is thin and bent: at the bar a dozen rows are at their limits at once, and a leg
that is moved at random and then repaired hardly ever comes back to it. So an attempt pushes a leg inside it,
as far in a given direction as it goes, by sequential linear programming with the rows and demands as limits
(`minimax.descend` with the push as its only row and everything else as a demand).

What an attempt starts from depends on earlier rounds alone, so that the number of processes, a kill and a
resumption change nothing in what is found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.confirm import COUNTED, confirm
from research.identify.leg import BODY, Vector, to_preset
from research.identify.minimax import Rate, Rating, descend
from research.identify.objective import INSIDE, MISSED_ROW
from research.identify.problem import TOE_SCALES, LegProblem
from research.identify.processes import Run, processes
from research.identify.search import CLEAR
from research.identify.state import State

HOPS = (0.002, 0.005, 0.01, 0.03)
"""Sizes of the hops, in a search's scales, between descents of a start that is outside the bar."""

TRIES = 12
"""Descents at most of such a start, with each solver."""

REACH = 0.5
"""How far a push wants to go, in a search's scales: further than it ever gets."""

FIRM = 100.0
"""What a shortage of one costs a push, in scales: enough that none is worth its while."""

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
    steps: int = 30

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
        x = self.problem.outward(y, SAMPLES)
        rows = self.problem.objective(SAMPLES, False).rows(x, paper_solver=True)
        return bool(np.abs(rows).max() < MISSED_ROW)


@dataclass(frozen=True)
class Task:
    """An attempt to be made: its place, which with the seed makes its random numbers; the name of the start
    that it goes back to; the leg y that it goes on from, for a start x; and the direction of the push, a unit
    vector in a search's scales, empty for a start."""

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
    """What the full system says of an attempt: the content of a preset file, empty if the leg does not turn;
    by solver the largest error of a row [bars]; shortages by name of the demand; and in words why the leg is
    no member, empty for a member."""

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


ROUND = 8
"""Attempts a round; more processes than that have nothing to do."""

ALONG_ONE = 0.6
"""Part of the pushes along a single coordinate of the leg; the rest go along all at random."""

FROM_EDGE = 0.6
"""Part of the pushes that go on from the leg that is furthest in their direction; the rest from any leg."""


@dataclass(frozen=True)
class Collection:
    """What was collected.

    Attributes:
        members: confirmed by the full system; the first that of the first start that has one, then each the
            furthest from those before it.
        attempts: all, those of the starts first.
        verdicts: of members, and of legs within the bar by kinematics that are none, by id.
    """

    members: tuple[Attempt, ...]
    attempts: tuple[Attempt, ...]
    verdicts: dict[str, Verdict]


def distance(one: Attempt, two: Attempt) -> float:
    """Root mean square difference of log lengths and pivot [-, m], some 0.02 where lengths differ by 2 %."""
    return float(np.sqrt(np.mean((_body(one) - _body(two)) ** 2)))


def _body(made: Attempt) -> Vector:
    return np.array(made.y[:BODY])


def collect(
    starts: dict[str, tuple[float, ...]],
    aim: Aim,
    state: State,
    say: Callable[[str], None],
    *,
    size: int,
    attempts: int,
    seed: int = 0,
    workers: int = 2,
) -> Collection:
    """Make attempts, then choose `size` legs within the bar that are far apart.

    Args:
        starts: legs x to begin with, by name; each is first brought within the bar, and may be a member.
        say: takes a line for each round.
        size: members wanted; there may be fewer.
        attempts: beside the starts; the last round is made whole.

    Raises:
        HoofEnvError: no start comes within the bar, a damaged file, a folder that cannot be written, or a
            process that died.
    """
    made: list[Attempt] = []
    inside: list[Attempt] = []
    rounds = -(-attempts // ROUND)
    with processes(workers) as run:
        for number in range(rounds + 1):
            if number:
                tasks = [_push_from(inside, number, index, seed) for index in range(ROUND)]
            else:
                tasks = [Task(0, i, seed, name, x) for i, (name, x) in enumerate(starts.items())]
            made += _round(tasks, aim, state, run)
            inside = [one for one in made if one.merit <= aim.bar]
            say(f"round {number} of {rounds}: {len(inside)} of {len(made)} legs within {aim.bar:g} bars")
            if not inside:
                nearest = min(one.merit for one in made)
                raise HoofEnvError(
                    f"no start comes within {aim.bar:g} bars without a shortage, the nearest has "
                    f"{nearest:.3f}: expected a better start or a wider --bar"
                )
        members, verdicts = _choose(inside, aim, run, size)
    return Collection(tuple(members), tuple(made), verdicts)


def _push_from(inside: Sequence[Attempt], number: int, index: int, seed: int) -> Task:
    """The next push: along one coordinate or all, from the leg that is furthest that way or from any."""
    rng = np.random.default_rng([seed, number, index])
    direction = rng.standard_normal(len(inside[0].y))
    if rng.random() < ALONG_ONE:
        one = int(rng.integers(BODY))
        direction = np.sign(direction[one]) * np.eye(direction.size)[one]
    direction /= np.linalg.norm(direction)
    if rng.random() < FROM_EDGE:
        parent = max(inside, key=lambda leg: (float(_body(leg) @ direction[:BODY]), leg.id))
    else:
        parent = inside[int(rng.integers(len(inside)))]
    return Task(number, index, seed, parent.start, parent.y, tuple(direction.tolist()))


def _round(tasks: Sequence[Task], aim: Aim, state: State, run: Run) -> list[Attempt]:
    """Make the attempts that are not yet in the folder; all of them in their order."""
    done = {t.id: kept for t in tasks if (kept := state.load(f"attempt-{t.id}", Attempt))}
    for made in run(partial(attempt, aim=aim), [task for task in tasks if task.id not in done]):
        state.save(f"attempt-{made.id}", made)
        done[made.id] = made
    return [done[task.id] for task in tasks]


def _choose(
    inside: Sequence[Attempt], aim: Aim, run: Run, size: int
) -> tuple[list[Attempt], dict[str, Verdict]]:
    """Members far apart, once the full system has seen all of them; one that it refuses another replaces."""
    verdicts: dict[str, Verdict] = {}
    while True:
        fit = [one for one in inside if one.id not in verdicts or not verdicts[one.id].reasons]
        members = _far_apart(fit, size)
        waiting = [one for one in members if one.id not in verdicts]
        if not waiting:
            return members, verdicts
        verdicts |= run(partial(judge, aim=aim), waiting)


def _far_apart(legs: Sequence[Attempt], size: int) -> list[Attempt]:
    """The first, then again and again the one that is furthest from all chosen; no leg twice."""
    if not legs:
        return []
    chosen, gaps = [legs[0]], np.array([distance(legs[0], leg) for leg in legs])
    while len(chosen) < size and gaps.max() > 0:
        chosen.append(legs[int(np.argmax(gaps))])
        gaps = np.minimum(gaps, [distance(chosen[-1], leg) for leg in legs])
    return chosen
