"""Stances and their peaks from a stream of instants, by the rule of `envs.stance`, for the picture alone."""

from __future__ import annotations

import math
from typing import NamedTuple

from hoof_env.render.instant import Instant


class Peak(NamedTuple):
    """When a stance had its highest force, and how much it was: [s, N]."""

    time: float
    force: float


class Stances:
    """Follows stances: one opens when the normal force rises above a threshold and closes when it falls
    below, or after one revolution of the crank; its peak is the highest resultant force while it is open.

    Args:
        threshold: [N].

    Attributes:
        opened: when the open stance began [s]; None between stances.
        peaks: peak of each stance so far, the last one's still growing while it is open.
        highest: force so far [N].
    """

    def __init__(self, threshold: float) -> None:
        self._threshold = threshold
        self._opened_at = 0.0
        self.opened: float | None = None
        self.peaks: list[Peak] = []
        self.highest = 0.0

    @property
    def running_peak(self) -> float:
        """Highest force of the open stance so far [N], 0 between stances."""
        return self.peaks[-1].force if self.opened is not None else 0.0

    def add(self, now: Instant) -> None:
        """Take the next instant."""
        force, loaded = now.grf, now.normal > self._threshold
        self.highest = max(self.highest, force)
        if self.opened is not None and (not loaded or now.crank_angle - self._opened_at >= 2 * math.pi):
            self.opened = None
        if loaded and self.opened is None:
            self.opened, self._opened_at = now.time, now.crank_angle
            self.peaks.append(Peak(now.time, 0.0))
        if self.opened is not None and force > self.peaks[-1].force:
            self.peaks[-1] = Peak(now.time, force)
