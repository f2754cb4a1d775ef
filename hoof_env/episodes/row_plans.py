"""Plans of the rows of a batch, for curricula: every row keeps its own until it starts again.

A batch works under one plan at a time. If its rows are under several that kernels distinguish, a kernel runs
once under each of them on all rows, and each row keeps the result under its own: it has the bits of a single
environment with these settings. The time of a step is multiplied by the number of such plans; settings that
act at starts alone, such as `strength`, `randomize` and ranges of commanded speeds, cost no time.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.episodes.plan import Plan
from hoof_env.tasks.settings import PER_EPISODE, Settings, to_json

Index = NDArray[np.int64]

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
"""Settings that may change. They leave the observation's entries, the meaning of actions and the length of an
episode as they are."""


def _act_alike(one: Plan, other: Plan) -> bool:
    """True if kernels read the same numbers under both plans."""
    models = zip(one.mechanics.model, other.mechanics.model, strict=True)
    return bool(
        one.mechanics.substeps == other.mechanics.substeps
        and one.record.tobytes() == other.record.tobytes()
        and all(np.array_equal(array, same) for array, same in models)
    )


def _are_same(one: Settings, other: Settings) -> bool:
    """True if settings are the same, whether ranges are lists, as in states, or tuples."""
    return one == other or (one.strength == other.strength and to_json(one) == to_json(other))


class RowPlans:
    """Plans of the rows of a batch.

    Attributes:
        plans: plans that rows are under, or start under next, in the order in which they were asked for.
        marks: for each plan an object, which it shares with plans under which kernels give the same results.
        present, pending: index in `plans` of the plan of each row, and of the plan under which it starts
            next, shape (rows,).
        are_mixed: True if rows are under several plans.
        differ: True if these are several for the kernels.

    Args:
        plans: plans; by default all rows are under the last one.
        rows: number of rows.
    """

    def __init__(self, plans: list[Plan], rows: int) -> None:
        self.plans: list[Plan] = []
        self.marks: list[object] = []
        for plan in plans:
            self._append(plan)
        self.present = np.full(rows, len(plans) - 1)
        self.pending = self.present.copy()
        self._compare()

    def _append(self, plan: Plan) -> None:
        """Add a plan, with the mark of an earlier one that acts alike, if there is one."""
        known = {id(mark): (mark, other) for mark, other in zip(self.marks, self.plans, strict=True)}
        mark = next((mark for mark, other in known.values() if _act_alike(other, plan)), object())
        # New lists: copies share the old ones.
        self.plans = [*self.plans, plan]
        self.marks = [*self.marks, mark]

    def _compare(self) -> None:
        """Find out whether rows are under several plans."""
        present = np.unique(self.present).tolist()
        self.are_mixed = len({id(self.plans[k]) for k in present}) > 1
        self.differ = len({id(self.marks[k]) for k in present}) > 1

    def find(self, settings: Settings) -> Plan | None:
        """Return the plan that rows have for these settings; None without one."""
        return next((plan for plan in self.plans if _are_same(plan.asked, settings)), None)

    def add(self, plan: Plan, rows: Index) -> None:
        """Let rows start under a plan from now on."""
        known = [k for k, other in enumerate(self.plans) if _are_same(other.asked, plan.asked)]
        last = len(self.plans)
        if known:
            # It becomes the last one, for rows that are under it already, too.
            plan = self.plans[known[0]]
            self.present[np.isin(self.present, known)] = last
            self.pending[np.isin(self.pending, known)] = last
        self._append(plan)
        self.pending[rows] = last
        self.place(self.present, self.pending)

    def are_due(self, rows: Index) -> bool:
        """True if some rows start under another plan than the one that they are under."""
        return len(self.plans) > 1 and bool((self.present[rows] != self.pending[rows]).any())

    def start(self, rows: Index) -> None:
        """Put rows under their pending plans."""
        present = self.present.copy()
        present[rows] = self.pending[rows]
        self.place(present, self.pending)

    def place(self, present: Index, pending: Index) -> None:
        """Put all rows under plans; see `present` and `pending`; remove plans that no row needs any more."""
        used = np.union1d(present, pending)
        self.plans = [self.plans[k] for k in used.tolist()]
        self.marks = [self.marks[k] for k in used.tolist()]
        self.present = np.searchsorted(used, present)
        self.pending = np.searchsorted(used, pending)
        self._compare()

    @property
    def newest(self) -> Plan:
        """Last one of the plans that rows are under."""
        return self.plans[int(self.present.max())]

    def of(self, row: int) -> Plan:
        """Return the plan of a row."""
        return self.plans[self.present[row]]

    def pending_of(self, row: int) -> Plan:
        """Return the plan of the next episode of a row."""
        return self.plans[self.pending[row]]

    def in_use(self) -> list[Plan]:
        """Return the plans that rows are under."""
        return [self.plans[k] for k in np.unique(self.present).tolist()]

    def groups(self, rows: Index, *, for_kernels: bool = False) -> Iterator[tuple[Plan, Index]]:
        """Yield the plans of some rows, each with its rows; with `for_kernels` the plans that kernels
        distinguish."""
        each: list[object] = [*(self.marks if for_kernels else self.plans)]
        present = self.present[rows]
        for key in {id(one): one for one in each}.values():
            alike = [k for k, other in enumerate(each) if other is key]
            group = rows[np.isin(present, alike)]
            if group.size:
                yield self.plans[self.present[group[0]]], group

    def to_plain(self) -> dict[str, Any]:
        """Return the settings of all rows, for a state."""
        settings = [to_json(plan.asked) for plan in self.plans]
        return {"settings": settings, "which": self.present.copy(), "coming": self.pending.copy()}

    def copy(self) -> RowPlans:
        """Return a copy, which shares the plans."""
        twin = object.__new__(RowPlans)
        vars(twin).update(vars(self), present=self.present.copy(), pending=self.pending.copy())
        return twin
