"""Collect legs that all meet the published numbers, far apart: what those numbers leave open.

    python -m research.identify.ensemble --preset identified --both --out runs/ensemble

The region of legs that fit is thin and bent: a leg that is moved at random and then repaired hardly ever
comes back to it. So an attempt pushes a leg inside it, as far in a given direction as it goes, with the rows
and demands as limits (`minimax.descend` with the push as its only row and everything else as a demand). What
it starts from depends on earlier rounds alone, as in `search`.

The ensemble of a preset lies in `ensembles` beside this file. A member is the content of a preset file, with
how well it fits:

    {"provenance": ..., "units": ..., "ground": {"exponent": ...},
     "bar": {"exact": 0.97, "paper": 0.99},
     "members": [{"geometry": ..., "gaits": ..., "errors": {"exact": ..., "paper": ...}, "short": {}}, ...]}

Errors are those of the worst row, in units of its own bar; with the paper's solver the walking inelastic
rows, which are ill-conditioned, do not count. "short" names the demands on plausibility that a leg misses.
All legs share the preset's ground.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hoof_env.errors import HoofEnvError, ParameterError, check_number
from hoof_env.ground.contact import Ground, load_ground, write_ground
from research.identify.command import check_counts, check_extras, load_start, provenance, run_command
from research.identify.confirm import COUNTED, confirm
from research.identify.leg import BODY, Vector, to_preset
from research.identify.minimax import Rate, Rating, descend
from research.identify.objective import INSIDE, MISSED_ROW
from research.identify.resume import (
    Run,
    State,
    digest_of,
    open_state,
    processes,
    read_json,
    versions,
    write_json,
)
from research.identify.search import CLEAR, TOE_SCALES, LegProblem

HOPS = (0.002, 0.005, 0.01, 0.03)  # in scales, between descents of a start that is outside the bar
TRIES = 12  # descents at most of such a start, with each solver
REACH = 0.5  # how far a push wants to go, in a search's scales: further than it ever gets
FIRM = 100.0  # what a shortage of one costs a push, in scales: enough that none is worth its while

SAMPLES, FINE = 801, 2001
"""Instants a revolution, and those at which the demands on a member are checked. At the bar 401 are up to
0.02 bars wrong, 801 up to 0.003."""


@dataclass(frozen=True)
class Aim:
    """What a member must meet: rows and demands of a problem; the largest error of a row, in units of its own
    bar; and whether the paper's solver counts too, all rows but the ill-conditioned. `steps`: of a push."""

    problem: LegProblem
    bar: float
    both: bool
    steps: int = 30

    @property
    def penalty(self) -> float:
        """Of a shortage of one [bars], so that a merit within the bar leaves no demand short."""
        return self.bar / INSIDE

    def rate(self, both: bool) -> Rate:
        return self.problem.objective(SAMPLES, both, by_toe=True).rate

    def runs(self, y: Vector) -> bool:
        """Whether the paper's solver comes through both cycles; near a dead point it may not."""
        x = self.problem.outward(y, SAMPLES)
        rows = self.problem.objective(SAMPLES, False).rows(x, paper_solver=True)
        return bool(np.abs(rows).max() < MISSED_ROW)


@dataclass(frozen=True)
class Task:
    """An attempt to be made: its place, which with the seed makes its random numbers; the leg y that it goes
    on from, x for the start; and the direction of the push, a unit vector in a search's scales, empty for the
    start."""

    round: int
    index: int
    seed: int
    y: tuple[float, ...]
    direction: tuple[float, ...] = ()

    @property
    def id(self) -> str:
        return f"{self.round:04d}-{self.index:02d}"


@dataclass(frozen=True)
class Attempt:
    """What a `Task` came to. Its merit is the largest error [bars] and what shortages cost; `MISSED_ROW` if
    the paper's solver cannot simulate the leg."""

    id: str
    y: tuple[float, ...]
    merit: float


@dataclass(frozen=True)
class Verdict:
    """What the full system says of an attempt: the content of a preset file, empty if the leg does not turn;
    largest errors by solver [bars]; shortages by demand; and in words why the leg is no member."""

    preset: Mapping[str, Any]
    errors: Mapping[str, float]
    short: Mapping[str, float]
    reasons: tuple[str, ...]


def attempt(task: Task, aim: Aim) -> Attempt:
    if task.direction:
        y = _push(task, aim)
    else:
        y = aim.problem.inward(np.array(task.y), SAMPLES)
        for both in (False, True) if aim.both else (False,):
            y = _enter(task, both, y, aim)
    merit = aim.rate(aim.both)(y).merit(aim.penalty) if aim.runs(y) else MISSED_ROW
    return Attempt(task.id, tuple(y.tolist()), merit)


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
    """The leg that a push ends with, or that it goes on from where the new one is not within the bar."""
    rate, origin, limit = aim.rate(aim.both), np.array(task.y), CLEAR * aim.bar
    direction = np.array(task.direction) / TOE_SCALES

    def missing(y: Vector) -> Rating:
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


ROUND = 8  # attempts; more processes than that have nothing to do
ALONG_ONE = 0.6  # part of the pushes along a single coordinate of the leg; the rest go along all at random
FROM_EDGE = 0.6  # part of the pushes from the leg that is furthest in their direction; the rest from any leg


class Collection(NamedTuple):
    """Members, confirmed by the full system, each the furthest from those before it; all attempts, the start
    first; and by id the verdicts of members and of legs within the bar by kinematics that are none."""

    members: list[Attempt]
    attempts: list[Attempt]
    verdicts: dict[str, Verdict]


def distance(one: Attempt, two: Attempt) -> float:
    """Root mean square difference of log lengths and pivot [-, m], some 0.02 where lengths differ by 2 %."""
    return float(np.sqrt(np.mean((_body(one) - _body(two)) ** 2)))


def _body(made: Attempt) -> Vector:
    return np.array(made.y[:BODY])


def collect(
    start: tuple[float, ...],
    aim: Aim,
    state: State,
    say: Callable[[str], None],
    *,
    size: int,
    attempts: int,
    seed: int = 0,
    workers: int = 2,
) -> Collection:
    """Bring the leg x `start` within the bar, make as many attempts, the last round whole, then choose at
    most `size` legs that are far apart; `say` takes a line for each round."""
    made: list[Attempt] = []
    inside: list[Attempt] = []
    rounds = -(-attempts // ROUND)
    with processes(workers) as run:
        for number in range(rounds + 1):
            if number:
                tasks = [_push_from(inside, number, index, seed) for index in range(ROUND)]
            else:
                tasks = [Task(0, 0, seed, start)]
            made += state.finish(tasks, partial(attempt, aim=aim), Attempt, run)
            inside = [one for one in made if one.merit <= aim.bar]
            say(f"round {number} of {rounds}: {len(inside)} of {len(made)} legs within {aim.bar:g} bars")
            if not inside:
                raise HoofEnvError(
                    f"the start does not come within {aim.bar:g} bars without a shortage, it has "
                    f"{made[0].merit:.3f}: expected a better start or a wider --bar"
                )
        members, verdicts = _choose(inside, aim, run, size)
    return Collection(members, made, verdicts)


def _push_from(inside: Sequence[Attempt], number: int, index: int, seed: int) -> Task:
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
    return Task(number, index, seed, parent.y, tuple(direction.tolist()))


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


def load_ensemble(preset: str) -> list[dict[str, Any]]:
    """The members of a preset's ensemble, as contents of preset files."""
    path = Path(__file__).with_name("ensembles") / f"{preset}.json"
    data = read_json(path, "take it from the repository again")
    about = {"provenance": f"a member of the ensemble of {preset}", "ground": data["ground"]}
    return [{**about, "geometry": one["geometry"], "gaits": one["gaits"]} for one in data["members"]]


def largest(errors: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The largest error of any member, by solver [bars]."""
    return {solver: max(error[solver] for error in errors) for solver in COUNTED}


def ensemble(
    out: Path,
    preset: str,
    size: int = 24,
    bar: float = 1.0,
    both: bool = False,
    seed: int = 0,
    attempts: int = 240,
    workers: int = 2,
    resume: bool = False,
) -> None:
    """Collect legs that fit the published numbers, far apart: what those leave open (needs 'identify').

    Args:
        out: folder for ensemble.json; made if need be. Its folder state holds what a killed collection is
            resumed from.
        preset: the leg to begin with, a name or a JSON file; all members stand on its ground.
        size: members wanted.
        bar: largest error of a row, in units of its own bar.
        both: rows count with the paper's solver too, all but the ill-conditioned.
        seed: the same seed and options find the same legs, with any number of workers.
        attempts: to find a further leg; the members are chosen among all that were found.
        workers: processes.
        resume: go on with a collection in this folder that was interrupted or killed.
    """
    check_extras()
    size, attempts, seed, workers = check_counts(size=size, attempts=attempts, seed=seed, workers=workers)
    bar = check_number("bar", bar, low=0, high=100, exclusive_low=True)
    ground = load_ground(preset)
    if ground.stiffness != Ground().stiffness:
        raise ParameterError(
            f"preset {preset}: expected a ground with the paper's stiffness, {Ground().stiffness:g} N/m^n, "
            f"got {ground.stiffness:g}"
        )
    choice, x = load_start(preset, ground.exponent)
    aim = Aim(LegProblem(choice), bar, both)
    about = {
        "start": f"{Path(preset).stem} ({digest_of([asdict(choice), x])})",
        "bar": bar,
        "both": both,
        "seed": seed,
        "attempts": attempts,
        "size": size,
        "versions": versions(),
    }
    say = partial(print, flush=True)
    state = open_state(out, about, resume=resume, product="ensemble.json")
    found = collect(x, aim, state, say, size=size, attempts=attempts, seed=seed, workers=workers)
    if not found.members:
        why = Counter(reason for verdict in found.verdicts.values() for reason in verdict.reasons)
        raise HoofEnvError(
            f"the full system refuses all legs within {bar:g} bars: {', '.join(why)}; expected a wider --bar"
        )
    members = []
    for one in found.members:
        verdict = found.verdicts[one.id]
        parts = {name: verdict.preset[name] for name in ("geometry", "gaits")}
        parts |= {"errors": verdict.errors, "short": verdict.short, "found": {"attempt": one.id}}
        members.append(parts)
    how = (
        "research.identify.ensemble: legs known to fit were pushed in random directions, along one length or "
        f"all, as far as the bar let them, {len(found.attempts) - 1} times; of all that fit, the "
        f"{len(members)} members are chosen far apart, so that extremes are more frequent among them than "
        "among all legs that fit, and their range is a lower limit of what the numbers leave open"
    )
    content = {
        "provenance": provenance(how, about),
        "units": "m, rad, rad/s, N/m^n; errors in bars",
        "ground": write_ground(ground),
        "bar": largest([member["errors"] for member in members]),
        "members": members,
    }
    refused = len(found.verdicts) - len(members)
    say(f"{len(members)} of {size} members; largest errors {content['bar']} [bars]; {refused} legs refused")
    say(f"{write_json(out, 'ensemble', content)} written")


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(ensemble, "research.identify.ensemble", arguments)


if __name__ == "__main__":
    sys.exit(main())
