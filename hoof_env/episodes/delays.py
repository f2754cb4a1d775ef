"""Delays of observations and actions, and histories of both: the memory of rows, and the parts into which a
delay divides a control step. `frames_kernel` moves frames and actions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.episodes.rows import Rows
from hoof_env.errors import ParameterError, brief, check_number, count
from hoof_env.tasks.parameters import check_range
from hoof_env.tasks.settings import ResolvedSettings

MAX_DELAY = 1000
"""Largest number of control steps that a delay lasts, and of observations and actions that are observed."""


class Delay(NamedTuple):
    """Delay: whole control steps, which each episode draws between two bounds, plus substeps.

    Attributes:
        least, most: bounds of the whole control steps.
        substeps: further substeps of `sim_dt`.
    """

    least: int
    most: int
    substeps: int


def check_delay(name: str, given: Any, substeps: int, steps: int) -> Delay:
    """Return a delay from a setting.

    Args:
        name: name of the setting.
        given: the setting, one number or two whole ones [control steps].
        substeps: substeps of `sim_dt` in a control step.
        steps: control steps of an episode.

    Raises:
        ParameterError: a delay is negative, is not a whole number of substeps, or lasts a whole episode; or a
            range has bounds that are not whole.
    """
    most = min(steps - 1, MAX_DELAY)
    if isinstance(given, (list, tuple)):
        low, high = check_range(name, given, 0.0, most)
        if low != round(low) or high != round(high):
            raise ParameterError(f"{name}: expected a range between whole numbers, got {brief(given)}")
        return Delay(round(low), round(high), 0)
    delay = check_number(name, given, low=0.0, high=most)
    whole = math.floor(delay + 1e-9)
    rest = (delay - whole) * substeps
    if abs(rest - round(rest)) > 1e-6:
        raise ParameterError(
            f"{name}: expected a whole number of substeps, of which a control step has {substeps}, got"
            f" {brief(given)}"
        )
    return Delay(whole, whole, round(rest))


def check_kept(name: str, given: Any, low: int) -> int:
    """Return a number of observations or actions that are observed.

    Raises:
        ParameterError: it is not a whole number from `low` to `MAX_DELAY`.
    """
    return count(name, given, low=low, most=MAX_DELAY)


class Parts(NamedTuple):
    """Parts of a control step, at whose boundaries an action takes effect or an observation is taken.

    Attributes:
        substeps: substeps of `sim_dt` of each part.
        acting: number of the part at whose start an action takes effect.
        seeing: number of the part after which an observation is taken, -1 for the end of the step.
    """

    substeps: tuple[int, ...]
    acting: int
    seeing: int


def parts_of(substeps: int, acts_after: int, seen_before: int) -> Parts:
    """Return the parts of a control step.

    Args:
        substeps: substeps of the step.
        acts_after: substeps after which an action takes effect.
        seen_before: number of substeps before the end at which an observation is taken.
    """
    ends = sorted({acts_after, substeps - seen_before, substeps} - {0})
    begins = [0, *ends[:-1]]
    lengths = tuple(end - begin for begin, end in zip(begins, ends, strict=True))
    seeing = ends.index(substeps - seen_before) if seen_before else -1
    return Parts(lengths, begins.index(acts_after), seeing)


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
        """Return the delays from settings.

        Raises:
            ParameterError: a setting is out of range.
        """

        def delay_of(name: str) -> Delay:
            delay = check_delay(name, getattr(s, name), substeps, steps_per_episode)
            if delay.substeps and s.solver == "paper":
                raise ParameterError(
                    f'{name}: expected whole steps with solver="paper", got {brief(getattr(s, name))}'
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
        """Fill the memory of some rows with their first frame, and with zeros for actions; return True if
        they have a memory."""
        rows.past_actions[which] = 0.0
        rows.frames[which] = rows.frames[which, :1]
        return bool(rows.frames.size or rows.past_actions.size)
