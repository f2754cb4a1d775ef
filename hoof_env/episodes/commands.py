"""Commanded speeds of an episode: their range, when another speed is commanded, and how they are drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.episodes.rows import Rows
from hoof_env.tasks.parameters import check_range
from hoof_env.tasks.schedules import SPEED, Ramp
from hoof_env.tasks.settings import ResolvedSettings

Index = NDArray[np.int64]
Generators = Sequence[np.random.Generator]


@dataclass(frozen=True)
class Commands:
    """Commanded speeds.

    Attributes:
        speeds: lowest and highest commanded speed at any time [m/s]; None if no speed is commanded.
        seconds: shortest and longest time until another speed is commanded [s].
        ramp: ramp of the speeds over a schedule; None without one.
        largest_change: largest change from one commanded speed to the next [m/s].
        dt: control step [s].
    """

    speeds: tuple[float, float] | None
    seconds: tuple[float, float]
    ramp: Ramp | None
    largest_change: float
    dt: float

    @classmethod
    def of(
        cls,
        s: ResolvedSettings,
        speeds: tuple[float, float] | None,
        schedule: Mapping[str, Ramp],
        largest_change: float,
        dt: float,
    ) -> Commands:
        """Return the commands from settings.

        Args:
            s: settings.
            speeds: lowest and highest commanded speed of the body [m/s]; None without commands.
            schedule: ramps of scheduled settings.
            largest_change: see the class.
            dt: control step [s].

        Raises:
            ParameterError: a setting is out of range.
        """
        ramp = schedule.get(SPEED)
        speeds = ramp.bounds if ramp else speeds
        varies = speeds is not None and speeds[0] < speeds[1]
        seconds = check_range("target_seconds", s.target_seconds, dt if varies else 0.0)
        return cls(speeds, seconds, ramp, largest_change, dt)

    @property
    def varies(self) -> bool:
        """True if several speeds are commanded in an episode."""
        return self.speeds is not None and self.speeds[0] < self.speeds[1]

    def at(self, steps_before: Any) -> tuple[Any, Any]:
        """Return the lowest and highest commanded speed [m/s], each one number, or one for each number of
        earlier control steps where they follow a schedule."""
        assert self.speeds
        return self.ramp.range_at(steps_before) if self.ramp else self.speeds

    def begin(self, rows: Rows, which: Index, generators: Generators, options: Mapping[str, Any]) -> None:
        """Draw or set the first commanded speeds of some rows."""
        episode = rows.named
        episode.target[which] = np.inf
        episode.switch[which] = np.inf
        if self.speeds:
            (low, high) = self.at(rows.steps_before[which])
            episode.target[which] = low
            if self.varies:
                ends = zip(*np.broadcast_arrays(low, high, which)[:2], generators, strict=True)
                episode.target[which] = [generator.uniform(slow, fast) for slow, fast, generator in ends]
                self.draw_next(rows, which, generators)
        # After the draws, so that the option does not change what follows from the generator.
        if "target_speed" in options:
            self.command(rows, which, options["target_speed"])

    def draw_next(self, rows: Rows, which: Index, generators: Generators) -> None:
        """Draw the next commanded speeds of some rows, and the control steps after which they are commanded,
        from a generator for each."""
        episode = rows.named
        when, where = np.array([generator.random(2) for generator in generators]).reshape(-1, 2).T
        (shortest, longest) = self.seconds
        (low, high) = self.at(rows.steps_before[which])
        steps = np.rint((shortest + (longest - shortest) * when) / self.dt)
        low = np.maximum(low, episode.target[which] - self.largest_change)
        high = np.minimum(high, episode.target[which] + self.largest_change)
        episode.switch[which] = episode.steps[which] + steps
        episode.next_target[which] = low + (high - low) * where

    def command(self, rows: Rows, which: Any, speeds: Any) -> None:
        """Command speeds in some rows for the rest of their episodes [m/s]."""
        rows.named.target[which] = speeds
        rows.named.switch[which] = np.inf
