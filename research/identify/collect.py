"""Collecting an ensemble: rounds of attempts from the legs found so far, kept as files and resumable.

What an attempt starts from depends on earlier rounds alone, so that the number of processes, a kill and a
resumption change nothing in what is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.attempt import Aim, Attempt, Task, Verdict, attempt, judge
from research.identify.leg import BODY, Vector
from research.identify.processes import Run, processes
from research.identify.state import State

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
        aim: what a member must meet.
        state: where finished attempts lie.
        say: takes a line for each round.
        size: members wanted; there may be fewer.
        attempts: beside the starts; the last round is made whole.
        workers: processes.

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
