"""The open-loop walk that carries: CMA-ES over a gait's swing parameters on the leg of a preset.

The paper's walk touches the ground lightly on a fixed trunk. On the suspended trunk of the environment it
lets the trunk sink, and may push it backward. Another steady gait of the same leg, the same four numbers,
walks and carries: the one with the lowest peak force among those that meet every demand of `carry_measure`.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError, check_number
from hoof_env.gait.parameters import LIMITS, GaitParameters, load_gait
from hoof_env.identify.carry_measure import DEMANDS, Carriage, Course, missed
from hoof_env.identify.command import check_extras
from hoof_env.identify.workers import end_with_parent, quiet_start

Evaluate = Callable[[list[NDArray[np.float64]]], list[float]]

NAME = "carrying_walk"
"""The gait's name in a preset."""

EVALUATIONS, POPULATION, RESTARTS = 1600, 8, 4
"""Gaits tried, gaits of a generation, and independent starts of the optimiser among which they are shared."""

SCREENED = 48
"""Random gaits of which the best is where the optimiser starts."""

SEARCHED, JUDGED = 2, 8
"""Starts of the trunk from which a gait is measured: in the search, and in the end."""

CANDIDATES = 10
"""Best gaits of the search that are judged, at most."""

PENALTY = 10.0
"""What missing a demand by its tolerance costs, in loads of peak force."""

MARGIN = 0.02
"""By how many tolerances the search keeps within the demands: the judging starts differ a little."""

FALL = 1000.0
"""Cost of losing the trunk at the last moment; losing it at once costs twice that."""

SLOWEST, FASTEST = 0.5, 1.5
"""Crank speeds tried, in those of the preset's walk, if it is free."""


def cost(carriage: Carriage) -> float:
    """What is minimised, dimensionless: the peak force in loads, and for each demand `PENALTY` times
    log2(1 + its miss in tolerances). The logarithm keeps one demand that is missed by far from hiding the
    others; a gait on the very edge of a demand misses it by `MARGIN`."""
    if carriage.survived < 1:
        return FALL * (2 - carriage.survived)
    return carriage.peak_share + PENALTY * sum(float(np.log2(1 + d.miss(carriage, MARGIN))) for d in DEMANDS)


@dataclass(frozen=True)
class Found:
    """The best gait that a search found.

    Attributes:
        gait: its parameters. carriage: how it carries, from `JUDGED` starts. missed: demands that it misses,
            in words; empty if it is a carrying walk.
        seed, evaluations: of the search.
    """

    gait: GaitParameters
    carriage: Carriage
    missed: tuple[str, ...]
    seed: int
    evaluations: int


def find_carrying_walk(
    preset: str | Path,
    *,
    seed: int = 0,
    evaluations: int = EVALUATIONS,
    workers: int = 1,
    free_crank: bool = False,
    progress: Callable[[int, float], None] | None = None,
) -> Found:
    """Search for the steady gait that carries with the lowest peak force.

    Args:
        preset: leg and walk, a name or a JSON file.
        seed: the same seed finds the same gait, with any number of workers.
        evaluations: gaits to try, at most. workers: processes.
        free_crank: search the crank's speed too, `SLOWEST` to `FASTEST` times that of the preset's walk; it
            has that of the walk otherwise.
        progress: called after each generation with the gaits tried so far and the lowest cost.

    Raises:
        ParameterError: an unknown preset, or a number out of range.
        DataFileError: a preset file that is unreadable or lacks a part.
        HoofEnvError: the optimiser is not installed.
    """
    check_extras()
    seed = int(check_number("seed", seed, low=0, high=2**53))
    evaluations = int(check_number("evaluations", evaluations, low=POPULATION, high=1e9))
    workers = int(check_number("workers", workers, low=1, high=1024))
    low, high = _box(load_gait("walk", preset), free_crank)
    course = Course(preset, JUDGED)
    with _evaluator(preset, workers) as evaluate:
        tried = _search(evaluate, seed, evaluations, low, high, progress or (lambda count, best: None))
    judged = []
    for _, x in sorted(tried)[:CANDIDATES]:
        gait = GaitParameters.from_array(x)
        carriage = course.measure(gait)
        judged.append((cost(carriage), x, Found(gait, carriage, tuple(missed(carriage)), seed, len(tried))))
        if not judged[-1][2].missed:
            return judged[-1][2]
    return min(judged, key=lambda entry: entry[:2])[2]


def _box(walk: GaitParameters, free_crank: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest of the four numbers; the crank's are equal if it is not free."""
    check_number("the walk's crank_speed", walk.crank_speed, low=0, exclusive_low=True)
    low, high = np.array(list(LIMITS.values())).T
    slow, fast = (SLOWEST, FASTEST) if free_crank else (1.0, 1.0)
    low[0], high[0] = slow * walk.crank_speed, min(high[0], fast * walk.crank_speed)
    return low, high


def _search(
    evaluate: Evaluate,
    seed: int,
    evaluations: int,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    progress: Callable[[int, float], None],
) -> list[tuple[float, tuple[float, ...]]]:
    """CMA-ES from one start after the other; every gait tried, its cost first."""
    import cma

    free, generator = high > low, np.random.default_rng(seed)
    tried: list[tuple[float, tuple[float, ...]]] = []

    def costs(units: Any) -> list[float]:
        """Of gaits given as parts of the free ranges, shape (n, free parameters)."""
        gaits = np.tile(low, (len(units), 1))
        gaits[:, free] += (high - low)[free] * np.array(units)
        gaits = np.clip(gaits, low, high)  # round-off
        found = evaluate(list(gaits))
        tried.extend(zip(found, map(tuple, gaits.tolist()), strict=True))
        progress(len(tried), min(tried)[0])
        return found

    while (left := evaluations - len(tried)) >= POPULATION:
        units = generator.random((min(SCREENED, left), int(free.sum())))
        first = units[np.argmin(costs(units))]
        options = {
            "bounds": [0, 1], "popsize": POPULATION, "seed": int(generator.integers(1, 2**31)),
            "tolfun": 1e-3, "tolx": 1e-4, "verbose": -9, "verb_log": 0,
        }  # fmt: skip
        search, end = cma.CMAEvolutionStrategy(first, 0.15, options), len(tried) + evaluations // RESTARTS
        while not search.stop() and len(tried) + POPULATION <= min(end, evaluations):
            asked = search.ask()
            search.tell(asked, costs(asked))
    return tried


_course: Course | None = None
"""Of this process."""


def _begin(preset: str) -> None:
    """Set up a process."""
    global _course
    _course = Course(preset, SEARCHED)


def _begin_process(preset: str) -> None:
    """Set up a process of its own, which leaves an interrupt to its parent and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    _begin(preset)


def _evaluate(x: NDArray[np.float64]) -> float:
    assert _course is not None
    return cost(_course.measure(GaitParameters.from_array(x)))


@contextmanager
def _evaluator(preset: str | Path, workers: int) -> Iterator[Evaluate]:
    """A function from gaits to their costs, in this process or in several."""
    if workers == 1:
        _begin(str(preset))
        yield lambda generation: [_evaluate(x) for x in generation]
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_begin_process, initargs=(str(preset),)) as pool:

        def evaluate(generation: list[NDArray[np.float64]]) -> list[float]:
            with quiet_start():  # the pool starts its processes as tasks come
                costs = pool.map(_evaluate, generation)
            return list(costs)

        try:
            yield evaluate
        except BrokenProcessPool:
            raise HoofEnvError("a process of the search died (out of memory, or killed)") from None
