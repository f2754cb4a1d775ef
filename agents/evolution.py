"""The CMA-ES that `agents.open_loop` and `agents.horse_gaits` share: points of the box [-1, 1], scored by the
returns of episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError

Floats = NDArray[np.float64]

OPTIONS = {"bounds": [-1, 1], "verbose": -9, "verb_log": 0}
"""Options of every search: the box, and neither text nor files of cma's own."""


def require(command: str, *packages: str) -> None:
    """Raise `HoofEnvError` with the command that installs them if a package of a search is missing."""
    for package in packages:
        try:
            import_module(package)
        except ModuleNotFoundError as error:
            raise HoofEnvError(
                f'{command} needs {error.name}: pip install "hoof-env[train,identify]"'
            ) from None


def make_strategy(start: Floats, spread: float, population: int, seed: int, **options: Any) -> Any:
    """Return cma's strategy for a search from a point, shape (size,), with a first standard deviation."""
    import cma

    settings = OPTIONS | options | {"popsize": population, "seed": seed}
    return cma.CMAEvolutionStrategy(start, spread, settings)


def generations(
    strategy: Any, costs_of: Callable[[list[Floats]], list[float]], count: int
) -> Iterator[tuple[list[Floats], list[float]]]:
    """Improve a strategy for `count` generations; yield the points of each and their costs."""
    for _ in range(count):
        # Ask, score, tell: whatever the caller does to the strategy between generations counts from the next
        # on
        points = strategy.ask()
        costs = costs_of(points)
        strategy.tell(points, costs)
        yield points, costs


def mean_costs(returns: Floats, starts: int) -> list[float]:
    """Return minus the mean return of each candidate; its episodes, from `starts` starts, are consecutive."""
    costs: list[float] = (-returns.reshape(-1, starts).mean(1)).tolist()
    return costs
