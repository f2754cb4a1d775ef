"""Settings that change from one episode to the next, for curricula: every row of a batch keeps its own until
it starts again.

Conditions are the attributes of an `EpisodeBatch` and its engine that follow from such settings, by name. A
batch works under one set of conditions at a time. If its rows are under several, a kernel runs once under
each of them on all rows, and each row keeps the result under its own: it has the bits of a single environment
with these settings. The time of a step is multiplied by the number of conditions, until every episode that
started under older ones has ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Conditions = dict[str, Any]

Result = TypeVar("Result")

CHANGEABLE = (
    "target_speed",
    "target_seconds",
    "terrain",
    "reward_weights",
    "randomize",
    "noise",
    "bias",
    "push_impulse",
    "push_seconds",
    "pushes",
    "strength",
)
"""Settings that may change: none of them changes the observation's entries, the meaning of actions, or the
length of an episode."""

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
    "noise",
    "bias",
    "push_impulse",
    "push_seconds",
    "given_pushes",
    "strength",
    "task_record",
)
OF_ENGINE = ("terrain", "substeps", "step_limits", "_model")
"""Attributes of a batch, and of its engine, that follow from these settings."""

PLACES = ("addresses", "_blocks")
"""Attributes that hold addresses of arrays, which a copy has to find again."""


def conditions_of(batch: Any) -> Conditions:
    """Return the conditions under which a batch works at present."""
    return {name: getattr(batch, name) for name in OF_BATCH} | {
        name: getattr(batch.engine, name) for name in OF_ENGINE
    }


class RowConditions:
    """Conditions of the rows of a batch.

    Attributes:
        all: conditions that rows are under; the last ones are those of every episode that starts from now
            on. Empty as long as nothing has changed.
        which: index in `all` of each row, shape (rows,).
    """

    def __init__(self, rows: int) -> None:
        self.all: list[Conditions] = []
        self.which = np.zeros(rows, np.int64)

    def add(self, old: Conditions, new: Conditions) -> None:
        """Put every episode that starts from now on under the new conditions."""
        # The first change: all rows are under the old conditions, at index 0.
        self.all = [*(self.all or [old]), new]

    def start(self, rows: NDArray[np.int64]) -> None:
        """Put rows under the last conditions, and remove conditions that no row is under any more."""
        self.which[rows] = len(self.all) - 1
        used = sorted({*self.which.tolist(), len(self.all) - 1})
        self.all = [self.all[k] for k in used]
        self.which[:] = np.searchsorted(used, self.which)

    @property
    def are_mixed(self) -> bool:
        """True if some rows are under older conditions."""
        return len(self.all) > 1

    def of(self, row: int) -> Conditions:
        """Return the conditions of a row, an empty mapping if nothing has ever changed."""
        return self.all[self.which[row]] if self.all else {}

    def groups(self, rows: NDArray[np.int64]) -> Iterator[tuple[Conditions, NDArray[np.int64]]]:
        """Yield the conditions that some rows are under, each with those rows."""
        for k, conditions in enumerate(self.all):
            group = rows[self.which[rows] == k]
            if group.size:
                yield conditions, group

    def copied(self) -> RowConditions:
        """Return the conditions for a copy of the batch, which has its arrays at other addresses."""
        made = RowConditions(len(self.which))
        made.which[:] = self.which
        for conditions in self.all:
            made.all.append({name: part for name, part in conditions.items() if name not in PLACES})
        return made


def enter(batch: Any, conditions: Conditions) -> None:
    """Let a batch work under conditions."""
    for name in OF_BATCH:
        setattr(batch, name, conditions[name])
    for name in OF_ENGINE:
        setattr(batch.engine, name, conditions[name])
    # The engine keeps the description of its states, in which the terrain is, after the first state.
    vars(batch.engine).pop("_layout", None)
    # Addresses are found once for each conditions: a step enters all of them.
    if PLACES[0] in conditions:
        for name in PLACES:
            setattr(batch, name, conditions[name])
    else:
        batch.find()
        conditions.update({name: getattr(batch, name) for name in PLACES})


def keep_others(batch: Any, rows: NDArray[np.int64], act: Callable[[], Result]) -> Result:
    """Call a function and restore all rows except some; return the function's result.

    Args:
        batch: an `EpisodeBatch`.
        rows: rows that the function may change.
        act: the function.
    """
    others = np.setdiff1d(np.arange(batch.num_envs), rows)
    by_column, by_row = _arrays(batch)
    kept_columns = [array[..., others] for array in by_column]
    kept_rows = [array[others] for array in by_row]
    # Also if Ctrl-C ends the call, so that no row has results under foreign conditions.
    try:
        return act()
    finally:
        for array, values in zip(by_column, kept_columns, strict=True):
            array[..., others] = values
        for array, values in zip(by_row, kept_rows, strict=True):
            array[others] = values


def under_each(batch: Any, rows: NDArray[np.int64], act: Callable[[NDArray[np.int64]], Any]) -> list[Any]:
    """Call a function once under each of the conditions that some rows are under; return its results.

    Args:
        batch: an `EpisodeBatch`.
        rows: rows that are to be changed.
        act: function of the rows that are under the present conditions; changes of other rows are undone.
    """
    newest = batch.conditions.all[-1]
    results = []
    try:
        for conditions, group in batch.conditions.groups(rows):
            enter(batch, conditions)
            results.append(keep_others(batch, group, lambda group=group: act(group)))  # type: ignore[misc]
    finally:
        enter(batch, newest)
    return results


def _arrays(batch: Any) -> tuple[list[NDArray[Any]], list[NDArray[Any]]]:
    """Return the arrays that kernels change: those with the environment on the last axis, and those with it
    on the first."""
    data, _, _, _, _, reactions = batch.engine.arrays
    by_column = [data, batch.episode, *([reactions] if reactions.size else [])]
    by_row = [batch.observations, batch.rewards, batch.past_actions, batch.frames]
    return by_column, by_row if batch.acted is batch.actions else [*by_row, batch.acted]
