"""Entries of an observation: which of a task's entries settings ask for, and the names of its columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

from hoof_env.episodes.scene import functions_of, is_from_outside
from hoof_env.errors import ParameterError, check_number
from hoof_env.tasks.observation import PRESSURE, Entry, check_groups, groups_of, observed
from hoof_env.tasks.registry import Task
from hoof_env.tasks.settings import ResolvedSettings

SENSED = ("hoof", PRESSURE)
"""Groups with numbers that a force sensor reads."""

MAX_THRESHOLD = 1e6
"""Largest `force_threshold` [N]."""


def _ago(steps: int) -> str:
    return "1 step ago" if steps == 1 else f"{steps} steps ago"


@dataclass(frozen=True)
class Observed:
    """Entries of an observation.

    Attributes:
        task: task that has them.
        trunk, drive: kinds of trunk and drive, on which entries depend.
        groups: groups that are observed.
        privileged: groups of which the true numbers are observed, too.
        force_threshold: load below which a sensor reads 0 [N].
    """

    task: Task
    trunk: str
    drive: str
    groups: tuple[str, ...]
    privileged: tuple[str, ...]
    force_threshold: float

    @classmethod
    def of(cls, s: ResolvedSettings, task: Task, groups: Sequence[str]) -> Observed:
        """Return the entries from settings.

        Args:
            s: settings.
            task: task.
            groups: groups that are observed.

        Raises:
            ParameterError: a group is unknown, constant without another setting, or has nothing on this
                trunk; or a threshold of forces is out of range, or no group has forces.
        """
        privileged: Sequence[str] = ()
        if not isinstance(s.privileged, (list, tuple)) or s.privileged:
            privileged = check_groups(s.privileged, groups_of(task.entries), "privileged")
        for group, needed in (("target", "target_speed"), ("ground", "terrain")):
            value = getattr(s, needed)
            for name, given in (("observation", groups), ("privileged", privileged)):
                if group in given and value in (None, {}):
                    raise ParameterError(
                        f"{name}: {group!r} is constant without {needed}, got {needed}={value!r}"
                    )
        threshold = check_number("force_threshold", s.force_threshold, low=0.0, high=MAX_THRESHOLD)
        if threshold and not {*SENSED} & {*groups, *privileged}:
            raise ParameterError(
                f"force_threshold: expected some of {', '.join(SENSED)} among the groups of observation or"
                f" privileged, without which it has no effect, got observation={list(groups)}"
            )
        found = cls(task, s.trunk, s.drive, tuple(groups), tuple(privileged), threshold)
        for name in ("noise", "bias"):
            found._check_any(name, getattr(s, name) or ())
        found._check_any("privileged", privileged)
        if not found.entries:
            raise ParameterError(f"observation: nothing of {list(groups)} is observed on a fixed trunk")
        return found

    def _check_any(self, name: str, groups: Any) -> None:
        """Check that something of each group is observed.

        Raises:
            ParameterError: nothing of a group is.
        """
        for group in groups:
            if not self._entries([group]):
                raise ParameterError(f"{name}: nothing of {group!r} is observed on a {self.trunk} trunk")

    def _entries(self, groups: Sequence[str]) -> tuple[Entry, ...]:
        return tuple(observed(groups, self.trunk, self.drive, self.task.entries))

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """Entries that are observed, in the order of their columns."""
        return self._entries(self.groups)

    @cached_property
    def true_entries(self) -> tuple[Entry, ...]:
        """Entries of which the true numbers are observed."""
        return self._entries(self.privileged)

    @cached_property
    def has_user_entries(self) -> bool:
        """True if any of them is from outside the package."""
        parts = [part for entry in (*self.entries, *self.true_entries) for part in functions_of(entry)]
        return any(map(is_from_outside, parts))

    def names(
        self, history: int, last_actions: int, actions: Sequence[str], renamed: Mapping[str, str]
    ) -> tuple[str, ...]:
        """Return the names of the observation's columns.

        Args:
            history: number of frames that are observed.
            last_actions: number of actions that are observed.
            actions: names of the actions.
            renamed: names of entries that measure another quantity than their name says; see `body.Body`.
        """
        frame = [renamed.get(entry.name, entry.name) for entry in self.entries]
        return (
            *frame,
            *(f"{name}, {_ago(k)}" for k in range(1, history) for name in frame),
            *(f"action {_ago(k)}: {name}" for k in range(1, last_actions + 1) for name in actions),
            *(f"true {renamed.get(entry.name, entry.name)}" for entry in self.true_entries),
        )

    def scales(self, renamed: Mapping[str, str]) -> dict[str, str]:
        """Return the formula of each entry's scale, by name.

        Args:
            renamed: as in `names`.
        """
        return {
            renamed.get(entry.name, entry.name): entry.scale.text
            for entry in (*self.entries, *self.true_entries)
        }

    def fill(self, record: Any, slots: Sequence[int], size: int) -> dict[int, str]:
        """Fill in its part of the task's record; return the group of the entry in each slot that is observed.

        Args:
            record: record of the task.
            slots: slot of each of the task's entries; see `scene.Slots`.
            size: number of columns of the observation.
        """
        # One kernel serves all choices of groups: it skips entries without a column.
        record["observation_size"] = size
        record["observation_columns"] = -1
        record["privileged_columns"] = -1
        frame = [entry.name for entry in self.entries]
        true = [entry.name for entry in self.true_entries]
        groups = {}
        for entry, slot in zip(self.task.entries, slots, strict=True):
            if entry.name in frame:
                record["observation_columns"][slot] = frame.index(entry.name)
                groups[slot] = entry.group
            if entry.name in true:
                record["privileged_columns"][slot] = size - len(true) + true.index(entry.name)
        record["has_privileged"] = bool(true)
        record["force_threshold"] = self.force_threshold
        return groups

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for a pickle: entries may have lambdas, and follow from the task."""
        return {item.name: getattr(self, item.name) for item in fields(self)}
