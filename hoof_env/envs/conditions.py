"""Settings that change from one episode to the next, as a curriculum asks, in a batch of which every row goes
on with its own until it starts again.

Conditions are what an `EpisodeBatch` and its engine have of such settings, by name. A batch works under one
of them at a time. Where rows are under several, a kernel runs once under each of them on all rows, and each
row keeps what happened under its own: it has the bits of a single environment with these settings. That takes
as many times as long as there are conditions, until every episode has ended that began under older ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Conditions = dict[str, Any]

CHANGEABLE = ("target_speed", "target_seconds", "terrain", "reward_weights", "randomize")
"""Settings that may change: none changes what is observed, an action, or how long an episode is."""

OF_BATCH = (
    "asked",
    "settings",
    "randomize",
    "terrain",
    "validated",
    "weights",
    "target_speed",
    "speed_changes",
    "target_seconds",
    "task_record",
)
OF_ENGINE = ("terrain", "substeps", "step_limits", "_model")
"""Attributes of a batch, and of its engine, that follow from these settings."""

PLACES = ("addresses", "_blocks")
"""Where the arrays are; they are found again in a copy."""


def conditions_of(batch: Any) -> Conditions:
    """Those under which a batch works."""
    return {name: getattr(batch, name) for name in OF_BATCH} | {
        name: getattr(batch.engine, name) for name in OF_ENGINE
    }


class RowConditions:
    """Under which conditions the rows of a batch are.

    Attributes:
        all: conditions of some row, the last ones those of every episode that starts from now on; empty as
            long as nothing has changed.
        which: by row, a place in `all`.
    """

    def __init__(self, rows: int) -> None:
        self.all: list[Conditions] = []
        self.which = np.zeros(rows, np.int64)

    def add(self, old: Conditions, new: Conditions) -> None:
        """Have every episode that starts from now on take the new conditions."""
        self.all = [*(self.all or [old]), new]

    def start(self, rows: NDArray[np.int64]) -> None:
        """Rows take the last conditions; those of no row are forgotten."""
        self.which[rows] = len(self.all) - 1
        used = sorted({*self.which.tolist(), len(self.all) - 1})
        self.all = [self.all[k] for k in used]
        self.which[:] = np.searchsorted(used, self.which)

    @property
    def are_mixed(self) -> bool:
        """Whether some rows are under older conditions."""
        return len(self.all) > 1

    def of(self, row: int) -> Conditions:
        """Of a row; nothing if nothing has ever changed."""
        return self.all[self.which[row]] if self.all else {}

    def groups(self, rows: NDArray[np.int64]) -> Iterator[tuple[Conditions, NDArray[np.int64]]]:
        """Those of some rows, with the rows."""
        for k, conditions in enumerate(self.all):
            those = rows[self.which[rows] == k]
            if those.size:
                yield conditions, those

    def copied(self) -> RowConditions:
        """For a copy of the batch, which has its arrays elsewhere."""
        made = RowConditions(len(self.which))
        made.which[:] = self.which
        made.all = [{name: part for name, part in one.items() if name not in PLACES} for one in self.all]
        return made


def enter(batch: Any, conditions: Conditions) -> None:
    """Have a batch work under conditions."""
    for name in OF_BATCH:
        setattr(batch, name, conditions[name])
    for name in OF_ENGINE:
        setattr(batch.engine, name, conditions[name])
    vars(batch.engine).pop("_layout", None)
    if PLACES[0] in conditions:
        for name in PLACES:
            setattr(batch, name, conditions[name])
    else:
        batch.find()
        conditions.update({name: getattr(batch, name) for name in PLACES})


def keep_others(batch: Any, rows: NDArray[np.int64], act: Callable[[], Any]) -> Any:
    """What a call returns, which changes nothing but some rows."""
    others = np.setdiff1d(np.arange(batch.num_envs), rows)
    by_column, by_row = _arrays(batch)
    kept = [array[..., others] for array in by_column], [array[others] for array in by_row]
    try:
        return act()
    finally:  # also where Ctrl-C ends it
        for array, values in zip(by_column, kept[0], strict=True):
            array[..., others] = values
        for array, values in zip(by_row, kept[1], strict=True):
            array[others] = values


def under_each(batch: Any, rows: NDArray[np.int64], act: Callable[[NDArray[np.int64]], Any]) -> list[Any]:
    """What a call returns under the conditions of some rows, once for each, with their rows, of which alone
    it changes anything."""
    newest = batch.conditions.all[-1]
    found = []
    try:
        for conditions, those in batch.conditions.groups(rows):
            enter(batch, conditions)
            found.append(keep_others(batch, those, lambda those=those: act(those)))  # type: ignore[misc]
    finally:
        enter(batch, newest)
    return found


def _arrays(batch: Any) -> tuple[list[NDArray[Any]], list[NDArray[Any]]]:
    """What kernels change: arrays with the environment on the last axis, and with it on the first."""
    data, _, _, _, _, reactions = batch.engine.arrays
    by_column = [data, batch.episode, *([reactions] if reactions.size else [])]
    return by_column, [batch.observations, batch.rewards]
