"""Changes of a batch of episodes from the next start of a row on: settings, and schedules that begin anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.conditions import Conditions, RowConditions, conditions_of, enter
from hoof_env.tasks.settings import Settings


class BatchChanges:
    """Settings of the rows of an `EpisodeBatch`, which says what the attributes are."""

    # Attributes of the subclass that the methods here read.

    task: Any
    asked: Settings
    conditions: RowConditions
    has_overrides: NDArray[np.bool_]
    steps_per_episode: int
    episode_rows: Any
    steps_before: NDArray[np.float64]
    drawn_names: list[str]
    start_values: NDArray[np.float64]
    start_row_count: Any
    num_envs: int

    def __init__(self, task: Any, settings: Settings, num_envs: int, *, runs: bool = True) -> None:
        """Make the batch, see `EpisodeBatch`."""

    def limit(self, steps: int) -> None:
        """Truncate episodes, see `EpisodeBatch`."""

    def prepare(self, conditions: Conditions) -> None:
        """Compile the kernels of conditions, see `BatchKernels`."""

    def change(self, asked: Sequence[Settings], rows: Sequence[Sequence[int]]) -> None:
        """Start episodes from now on with other settings, of those that `conditions.CHANGEABLE` names.

        Args:
            asked: all settings, for each group of rows.
            rows: these groups.

        Raises:
            ParameterError: a setting is out of range, or a function from outside cannot be part of kernels
                for other ground; nothing has changed then.
        """
        made = [self.conditions_under(settings) for settings in asked]
        for conditions in made:
            self.prepare(conditions)
        for conditions, group in zip(made, rows, strict=True):
            self.conditions.add(conditions_of(self), conditions, np.array(group))

    def conditions_under(self, settings: Settings) -> Conditions:
        """Return the conditions of episodes with some settings."""
        known = self.conditions.find(settings)
        if known is not None:
            return known
        # A batch of one checks the settings and makes everything that follows from them.
        made = type(self)(self.task, settings, 1, runs=False)
        made.limit(self.steps_per_episode)
        return conditions_of(made)

    def coming_settings(self, row: int) -> Settings:
        """Return the settings of the next episode of a row."""
        conditions = self.conditions
        return conditions.all[conditions.coming[row]]["asked"] if conditions.all else self.asked

    def _adopt(self, rows: NDArray[np.int64]) -> None:
        """Put rows under the conditions that `change` asked for."""
        conditions = self.conditions
        # The engine's constants of these rows are those of their old settings.
        self.has_overrides[rows[conditions.which[rows] != conditions.coming[rows]]] = True
        conditions.start(rows)
        self.put_under(conditions)

    def put_under(self, conditions: RowConditions) -> None:
        """Work under conditions of the rows; without any go on as before."""
        self.conditions = conditions
        if conditions.all:
            enter(self, conditions.newest)
            self._name_drawn()

    def _name_drawn(self) -> None:
        """Give `start_values` a row for each parameter that any row draws, NaN where one does not."""
        old = self.drawn_names
        old_values = self.start_values
        present = [self.conditions.all[k] for k in np.unique(self.conditions.which).tolist()]
        self.drawn_names = [*dict.fromkeys(name for each in present for name in each["randomize"])]
        if self.drawn_names == old:
            return
        first = self.start_row_count
        self.start_values = np.full((first + len(self.drawn_names), self.num_envs), np.nan)
        self.start_values[:first] = old_values[:first]
        for k, name in enumerate(self.drawn_names):
            if name in old:
                self.start_values[first + k] = old_values[first + old.index(name)]

    def restart_schedules(self, rows: Sequence[int] | NDArray[np.int64]) -> None:
        """Begin the schedules of rows anew with the next start, which counts the steps of the present
        episode."""
        self.steps_before[rows] = -self.episode_rows.steps[rows]
