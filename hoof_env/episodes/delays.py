"""Delays of observations and actions, and histories of both: what rows keep of earlier steps, and into which
parts a delay divides a control step. `frames_kernel` moves frames and actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.episodes.rows import Rows
from hoof_env.errors import ParameterError
from hoof_env.tasks.delays import Delay, check_delay, check_kept, parts_of
from hoof_env.tasks.settings import ResolvedSettings


@dataclass(frozen=True)
class Delays:
    """Delays and histories.

    Attributes:
        observation, action: delays of observations and of actions.
        history: number of frames that are observed.
        last_actions: number of actions that are observed.
        substeps: substeps of `sim_dt` of a control step.
    """

    observation: Delay
    action: Delay
    history: int
    last_actions: int
    substeps: int

    @classmethod
    def of(cls, s: ResolvedSettings, substeps: int, steps_per_episode: int) -> Delays:
        """Return the delays of settings.

        Raises:
            ParameterError: a setting is out of range.
        """

        def delay_of(name: str) -> Delay:
            delay = check_delay(name, getattr(s, name), substeps, steps_per_episode)
            if delay.substeps and s.solver == "paper":
                raise ParameterError(
                    f'{name}: expected whole steps with solver="paper", got {getattr(s, name)!r}'
                )
            return delay

        return cls(
            delay_of("observation_delay"),
            delay_of("action_delay"),
            check_kept("observation_history", s.observation_history, 1),
            check_kept("last_actions", s.last_actions, 0),
            substeps,
        )

    @property
    def frames(self) -> int:
        """Number of frames that a row keeps."""
        number = int(self.observation.substeps > 0) + self.observation.most + self.history
        # One frame is the observation itself; with any behind it, it has columns in the observation.
        return number if number > 1 else 0

    @property
    def has_actions(self) -> bool:
        """True if a row keeps actions."""
        return bool(self.action.most or self.action.substeps or self.last_actions)

    @property
    def past_actions(self) -> int:
        """Number of actions that a row keeps."""
        return max(self.action.most + 1, self.last_actions) if self.has_actions else 0

    def fill(self, record: Any, frame_size: int, action_size: int, engine_substeps: int) -> None:
        """Fill in its part of the task's record.

        Args:
            record: record of the task.
            frame_size: number of entries of a frame.
            action_size: number of actions.
            engine_substeps: substeps of the engine in one of `sim_dt`.
        """
        record["frame_size"] = frame_size
        record["frames"] = self.frames
        record["first_frame"] = int(self.observation.substeps > 0)
        record["history"] = self.history
        record["action_size"] = action_size
        record["kept_actions"] = self.past_actions
        record["has_actions"] = self.has_actions
        record["last_actions"] = self.last_actions
        parts = parts_of(self.substeps, self.action.substeps, self.observation.substeps)
        record["parts"] = len(parts.substeps)
        record["part_substeps"][: len(parts.substeps)] = np.array(parts.substeps) * engine_substeps
        record["acting_part"] = parts.acting
        record["seeing_part"] = parts.seeing

    def begin(
        self,
        rows: Rows,
        which: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Draw the delays of episodes that start in some rows."""
        episode = rows.named
        for delay, delays in (
            (self.observation, episode.observation_delay),
            (self.action, episode.action_delay),
        ):
            is_drawn = delay.least < delay.most
            whole = [generator.integers(delay.least, delay.most + 1) for generator in generators if is_drawn]
            delays[which] = whole if is_drawn else delay.most

    def fill_past(self, rows: Rows, which: NDArray[np.int64]) -> bool:
        """Fill what some rows keep of earlier steps with their first frame, and with zeros for actions;
        return True if they keep anything."""
        rows.past_actions[which] = 0.0
        rows.frames[which] = rows.frames[which, :1]
        return bool(rows.frames.size or rows.past_actions.size)
