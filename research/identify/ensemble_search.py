"""Collecting an ensemble: rounds of attempts from the legs found so far, kept as files and resumable.

What an attempt starts from depends on earlier rounds alone, so that the number of processes, a kill and a
resumption change nothing in what is found.
"""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hoof_env.errors import DataFileError, HoofEnvError
from hoof_env.leg.linkage import LENGTHS
from research.identify.candidate import Choice
from research.identify.ensemble_attempt import Aim, Attempt, Task, attempt, judge
from research.identify.records import Array
from research.identify.state import State, read_json, write
from research.identify.workers import end_with_parent, quiet_start

ROUND = 8
"""Attempts a round; more processes than that have nothing to do."""

BODY = len(LENGTHS) + 2
"""So many first coordinates are the leg's own: log lengths and pivot. The ground level is not among them."""

ALONG_ONE = 0.6
"""Part of the pushes along a single coordinate of the leg; the rest go along all at random."""

FROM_EDGE = 0.6
"""Part of the pushes that go on from the leg that is furthest in their direction; the rest from any leg."""


@dataclass(frozen=True)
class Start:
    """A leg to begin with: its name, and see `candidate`."""

    name: str
    choice: Choice
    x: tuple[float, ...]


@dataclass(frozen=True)
class Collection:
    """What was collected.

    Attributes:
        members: confirmed by the full system; the first that of the first start that has one, then each the
            furthest from those before it.
        attempts: all, those of the starts first. refused: legs within the bar by kinematics that the full
            system was asked about and found no members.
    """

    members: tuple[Attempt, ...]
    attempts: tuple[Attempt, ...]
    refused: tuple[Attempt, ...]


def distance(one: Attempt, two: Attempt) -> float:
    """Root mean square difference of log lengths and pivot [-, m], some 0.02 where lengths differ by 2 %;
    infinite between different choices."""
    if one.choice != two.choice:
        return float("inf")
    return float(np.sqrt(np.mean((_body(one) - _body(two)) ** 2)))


def _body(made: Attempt) -> Array:
    return np.array(made.y[:BODY])


def collect(
    starts: Sequence[Start],
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
        starts: legs to begin with; each is first brought within the bar, and may be a member.
        aim: what a member must meet. state: where finished attempts lie.
        say: takes a line for each round.
        size: members wanted; there may be fewer.
        attempts: beside the starts; the last round is made whole.
        workers: processes; one works in this process.

    Raises:
        HoofEnvError: no start comes within the bar, a damaged file, a folder that cannot be written, or a
            process that died.
    """
    made: list[Attempt] = []
    inside: list[Attempt] = []
    rounds = -(-attempts // ROUND)
    tasks = [
        Task(0, i, seed, f"0000-{i:02d}", start.name, start.choice.to_dict(), start.x)
        for i, start in enumerate(starts)
    ]
    with _pool(workers) as run:
        for number in range(rounds + 1):
            if number:
                tasks = [_push_from(inside, number, index, seed) for index in range(ROUND)]
            made += _round(tasks, aim, state, run)
            inside = [one for one in made if one.merit <= aim.bar]
            say(_progress(number, rounds, tasks, made[-len(tasks) :], inside, aim))
            if not inside:
                nearest = min(one.merit for one in made)
                raise HoofEnvError(
                    f"no start comes within {aim.bar:g} bars without a shortage, the nearest has "
                    f"{nearest:.3f}: expected a better start or a wider --bar"
                )
        return _choose(made, inside, aim, state, run, size)


def _push_from(inside: Sequence[Attempt], number: int, index: int, seed: int) -> Task:
    """The next push: along one coordinate or all, from the leg that is furthest that way or from any."""
    rng = np.random.default_rng([seed, number, index])
    choices = [one.choice for i, one in enumerate(inside) if one.choice not in [o.choice for o in inside[:i]]]
    choice = choices[int(rng.integers(len(choices)))]
    legs = [one for one in inside if one.choice == choice]
    direction = rng.standard_normal(len(legs[0].y))
    if rng.random() < ALONG_ONE:
        one = int(rng.integers(BODY))
        direction = np.sign(direction[one]) * np.eye(direction.size)[one]
    direction /= np.linalg.norm(direction)
    if rng.random() < FROM_EDGE:
        parent = max(legs, key=lambda leg: (float(_body(leg) @ direction[:BODY]), leg.id))
    else:
        parent = legs[int(rng.integers(len(legs)))]
    return Task(
        number, index, seed, parent.id, parent.start, choice, parent.y, tuple(direction.tolist())
    )  # fmt: skip


def _progress(
    number: int,
    rounds: int,
    tasks: Sequence[Task],
    new: Sequence[Attempt],
    inside: Sequence[Attempt],
    aim: Aim,
) -> str:
    what = f"round {number} of {rounds}" if number else f"{len(tasks)} start{'s'[: len(tasks) > 1]}"
    seconds = sum(one.seconds for one in new) / len(new)
    line = f"{what}: {len(inside)} legs within {aim.bar:g} bars"
    if inside:
        first = inside[0]
        alike = [one for one in inside if one.choice == first.choice]
        furthest = max(alike, key=lambda one: distance(first, one))
        line += f", up to {distance(first, furthest):.3f} apart from the first"
    return f"{line}; {seconds:.1f} s an attempt"


Run = Callable[[Callable[[Any], Attempt], Sequence[Any]], Iterator[Attempt]]


def _round(tasks: Sequence[Task], aim: Aim, state: State, run: Run) -> list[Attempt]:
    """Make the attempts that are not yet in the folder; all of them in their order."""
    found = {task.id: kept for task in tasks if (kept := _load(state, task.id))}
    for made in run(partial(attempt, aim=aim), [task for task in tasks if task.id not in found]):
        _save(state, made)
        found[made.id] = made
    return [found[task.id] for task in tasks]


def _choose(
    made: list[Attempt], inside: list[Attempt], aim: Aim, state: State, run: Run, size: int
) -> Collection:
    """Members far apart, once the full system has seen all of them; whom it refuses another replaces."""
    known = {one.id: one for one in inside}
    while True:
        members = _far_apart([one for one in known.values() if not one.errors or one.holds(aim)], size)
        waiting = [one for one in members if not one.errors]
        if not waiting:
            break
        for one in run(partial(judge, aim=aim), waiting):
            _save(state, one)
            known[one.id] = one
    refused = tuple(one for one in known.values() if one.errors and not one.holds(aim))
    return Collection(tuple(members), tuple(known.get(one.id, one) for one in made), refused)


def _far_apart(legs: Sequence[Attempt], size: int) -> list[Attempt]:
    """The first, then again and again the one that is furthest from all chosen; no leg twice."""
    if not legs:
        return []
    chosen, gaps = [legs[0]], np.array([distance(legs[0], leg) for leg in legs])
    while len(chosen) < size and gaps.max() > 0:
        chosen.append(legs[int(np.argmax(gaps))])
        gaps = np.minimum(gaps, [distance(chosen[-1], leg) for leg in legs])
    return chosen


def _load(state: State, name: str) -> Attempt | None:
    path = state.folder / f"attempt-{name}.json"
    if not path.exists():
        return None
    data = read_json(path, "delete it to repeat the attempt")
    try:
        digest, made = data["problem"], data["attempt"]
        state.check(path, digest)
        return Attempt.from_dict(made)
    except (KeyError, TypeError):
        raise DataFileError(f"{path} is damaged; delete it to repeat the attempt") from None


def _save(state: State, made: Attempt) -> None:
    text = json.dumps({"problem": state.digest, "attempt": made.to_dict()}, indent=1, allow_nan=False)
    write(state.folder / f"attempt-{made.id}.json", text.encode())


@contextmanager
def _pool(workers: int) -> Iterator[Run]:
    """A function that maps over tasks, results as they come, in processes that end with this one."""
    if workers == 1:
        yield lambda function, tasks: (function(task) for task in tasks)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, ROUND), context, end_with_parent)

    def run(function: Callable[[Any], Attempt], tasks: Sequence[Any]) -> Iterator[Attempt]:
        with quiet_start():
            futures = [pool.submit(function, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool:
            raise HoofEnvError(
                "a process died (out of memory, or killed); the collection is kept and goes on with --resume"
            ) from None

    try:
        yield run
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
