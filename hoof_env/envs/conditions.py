"""Settings that change from one episode to the next, for curricula: every row of a batch keeps its own until
it starts again.

Conditions are the attributes of an `EpisodeBatch` and its engine that follow from such settings, by name. A
batch works under one set of conditions at a time. If its rows are under several that kernels distinguish, a
kernel runs once under each of them on all rows, and each row keeps the result under its own: it has the bits
of a single environment with these settings. The time of a step is multiplied by the number of such sets;
settings that act at starts alone, such as `strength`, `randomize` and ranges of commanded speeds, cost none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hoof_env.tasks.plain import to_json
from hoof_env.tasks.settings import PER_EPISODE, Settings

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
    "schedule",
    "constants",
    *PER_EPISODE,
)
"""Settings that may change: none of them changes the observation's entries, the meaning of actions, or the
length of an episode."""

OF_BATCH = (
    "asked",
    "settings",
    "body",
    "randomize",
    "schedule",
    "terrain",
    "validated",
    "weights",
    "constants",
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
OF_ENGINE = ("mechanics",)
"""Attributes of a batch, and of its engine, that follow from these settings."""

KERNEL = "kernel mark"
"""Name of the part of conditions that is one object where kernels give the same results."""

PLACES = ("held", "_blocks", "kernels", "kernel")
"""Attributes that hold addresses of arrays, which a copy has to find again."""


def conditions_of(batch: Any) -> Conditions:
    """Return the conditions under which a batch works at present."""
    return {name: getattr(batch, name) for name in OF_BATCH} | {
        name: getattr(batch.engine, name) for name in OF_ENGINE
    }


def _act_alike(one: Conditions, other: Conditions) -> bool:
    """True if kernels read the same numbers under both conditions."""
    mine, others = one["mechanics"], other["mechanics"]
    models = zip(mine.model, others.model, strict=True)
    return bool(
        mine.substeps == others.substeps
        and one["task_record"].tobytes() == other["task_record"].tobytes()
        and all(np.array_equal(array, same) for array, same in models)
    )


def _are_same(one: Settings, other: Settings) -> bool:
    """True if settings are the same, whether ranges are lists, as in states, or tuples."""
    return one == other or (one.strength == other.strength and to_json(one) == to_json(other))


def _marked(new: Conditions, known: list[Conditions]) -> Conditions:
    """Return conditions with their `KERNEL`, which they share with known ones that act alike."""
    alike = (one[KERNEL] for one in known if _act_alike(one, new))
    return new | {KERNEL: next(alike, object())}


class RowConditions:
    """Conditions of the rows of a batch.

    Attributes:
        all: conditions that rows are under, or start under next, in the order in which they were asked for.
            Empty as long as nothing has changed.
        which, coming: index in `all` of the conditions of each row, and of those under which it starts next,
            shape (rows,).
        are_mixed: True if rows are under several conditions.
        differ: True if these are several for the kernels.
    """

    def __init__(self, rows: int) -> None:
        self.all: list[Conditions] = []
        self.which = np.zeros(rows, np.int64)
        self.coming = np.zeros(rows, np.int64)
        self.are_mixed = False
        self.differ = False

    def add(self, old: Conditions, new: Conditions, rows: NDArray[np.int64]) -> None:
        """Let rows start under new conditions from now on; `old` are those of all rows before the first
        change."""
        self.all = self.all or [old | {KERNEL: object()}]
        known = [k for k, one in enumerate(self.all) if _are_same(one["asked"], new["asked"])]
        last = len(self.all)
        if known:
            # They become the last ones, for rows that are under them already, too.
            new = self.all[known[0]]
            self.which[np.isin(self.which, known)] = last
            self.coming[np.isin(self.coming, known)] = last
        else:
            new = _marked(new, self.all)
        self.all = [*self.all, new]
        self.coming[rows] = last

    def find(self, settings: Settings) -> Conditions | None:
        """Return the conditions that settings ask for, if rows have them; else None."""
        return next((known for known in self.all if _are_same(known["asked"], settings)), None)

    def to_plain(self) -> dict[str, Any]:
        """Return the settings of all rows, for a state."""
        settings = [to_json(conditions["asked"]) for conditions in self.all]
        return {"settings": settings, "which": self.which.copy(), "coming": self.coming.copy()}

    def are_due(self, rows: NDArray[np.int64]) -> bool:
        """True if some rows start under other conditions than those that they are under."""
        return bool(self.all) and bool((self.which[rows] != self.coming[rows]).any())

    def start(self, rows: NDArray[np.int64]) -> None:
        """Put rows under their coming conditions, and remove conditions that no row needs any more."""
        which = self.which.copy()
        which[rows] = self.coming[rows]
        self.place(which, self.coming)

    def place(self, which: NDArray[np.int64], coming: NDArray[np.int64]) -> None:
        """Put all rows under conditions, and remove conditions that no row needs any more; see `which` and
        `coming`."""
        used = np.union1d(which, coming)
        each: list[Conditions] = []
        for k in used.tolist():
            one = self.all[k]
            each.append(one if KERNEL in one else _marked(one, each))
        self.all = each
        self.which = np.searchsorted(used, which)
        self.coming = np.searchsorted(used, coming)
        present = [self.all[k] for k in np.unique(self.which).tolist()]
        self.are_mixed = len(present) > 1
        self.differ = len({id(conditions[KERNEL]) for conditions in present}) > 1

    @property
    def newest(self) -> Conditions:
        """Last ones of those that rows are under."""
        return self.all[int(self.which.max())]

    def of(self, row: int) -> Conditions:
        """Return the conditions of a row, an empty mapping if nothing has ever changed."""
        return self.all[self.which[row]] if self.all else {}

    def groups(
        self, rows: NDArray[np.int64], *, for_kernels: bool = False
    ) -> Iterator[tuple[Conditions, NDArray[np.int64]]]:
        """Yield the conditions that some rows are under, each with those rows; with `for_kernels` those that
        kernels distinguish."""
        keys = [id(conditions[KERNEL]) if for_kernels else k for k, conditions in enumerate(self.all)]
        which = self.which[rows]
        for key in dict.fromkeys(keys):
            alike = [k for k, other in enumerate(keys) if other == key]
            group = rows[np.isin(which, alike)]
            if group.size:
                yield self.all[self.which[group[0]]], group

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes for a pickle: without what belongs to one process."""
        return vars(self.copied())

    def copied(self) -> RowConditions:
        """Return the conditions for a copy of the batch, which has its arrays at other addresses."""
        made = RowConditions(len(self.which))
        vars(made).update(vars(self), which=self.which.copy(), coming=self.coming.copy())
        # A pickle keeps identity, a copy shares it.
        made.all = [
            {name: part for name, part in conditions.items() if name not in PLACES} for conditions in self.all
        ]
        return made


def enter(batch: Any, conditions: Conditions) -> None:
    """Let a batch work under conditions."""
    for name in OF_BATCH:
        setattr(batch, name, conditions[name])
    for name in OF_ENGINE:
        setattr(batch.engine, name, conditions[name])
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


def under_each(
    batch: Any,
    rows: NDArray[np.int64],
    act: Callable[[NDArray[np.int64]], Any],
    *,
    for_kernels: bool = False,
) -> list[Any]:
    """Call a function once under each of the conditions that some rows are under; return its results.

    Args:
        batch: an `EpisodeBatch`.
        rows: rows that are to be changed.
        act: function of the rows that are under the present conditions; changes of other rows are undone.
        for_kernels: True for a function that only runs kernels: once where they do not distinguish.
    """
    newest = batch.conditions.newest
    results = []
    try:
        for conditions, group in batch.conditions.groups(rows, for_kernels=for_kernels):
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
