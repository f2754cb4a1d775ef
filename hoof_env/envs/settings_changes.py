"""Settings that the rows of an environment change from their next reset on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from hoof_env.dynamics.memory import which as which_of
from hoof_env.envs.conditions import CHANGEABLE
from hoof_env.errors import FixedSettingError
from hoof_env.tasks.plain import as_plain
from hoof_env.tasks.registry import Task
from hoof_env.tasks.schedules import SPEED, check_unscheduled
from hoof_env.tasks.settings import SETTINGS


class SettingsChanges:
    """Part of `LegBase` that changes settings."""

    task: Task
    batch: Any
    _check_open: Any
    _given: list[Mapping[str, Any]]  # settings that each row was given

    def change_settings(self, *, envs: ArrayLike | None = None, **changes: Any) -> None:
        """Change settings from the next reset on, for a curriculum. The present episode continues with the
        old ones. In a vector environment each environment takes the new ones when it starts again, by itself
        or by `reset`.

        Args:
            envs: environments that take them, as indices or as a mask; None for all.
            changes: some of the settings of `conditions.CHANGEABLE`, as for `gymnasium.make`. Afterwards the
                environment is as if it had been made with them.

        Raises:
            ParameterError: a value is out of range, or the settings do not fit together; nothing has changed
                then.
            FixedSettingError: another setting.
        """
        self._check_open("change_settings")
        for name in changes:
            if name in SETTINGS and name not in CHANGEABLE:
                raise FixedSettingError(
                    f"change_settings: expected some of {', '.join(CHANGEABLE)}, got {name!r}, which stays as"
                    " it was made"
                )
        new = {name: as_plain(name, value) for name, value in changes.items()}
        rows = which_of(envs, self.batch.num_envs)
        if not rows.size:
            self.batch.conditions_under(self.task.settings({**self._given[0], **new}))
        # Rows that were given the same settings share the mapping, and go on to share it.
        groups: dict[int, list[int]] = {}
        for row in rows.tolist():
            groups.setdefault(id(self._given[row]), []).append(row)
        given = [{**self._given[group[0]], **new} for group in groups.values()]
        asked = [self.task.settings(each) for each in given]
        if SPEED in new and "schedule" not in new:
            for settings in asked:
                check_unscheduled(SPEED, settings)
        self.batch.change(asked, [*groups.values()])
        for each, group in zip(given, groups.values(), strict=True):
            for row in group:
                self._given[row] = each

    def _take_given(self) -> None:
        """Go on, after a state, from the settings of its rows."""
        shared: dict[int, dict[str, Any]] = {}
        for row in range(self.batch.num_envs):
            asked = self.batch.coming_settings(row)
            self._given[row] = shared.setdefault(id(asked), dict(vars(asked)))
