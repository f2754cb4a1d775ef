"""The rule of a stance in Python, one substep after the other; the kernels have it in `observables`.

A stance opens when the normal force on the hoof rises above a threshold, as on a force plate. It closes when
the force falls below it (lift-off), or after one crank revolution, whichever comes first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class StanceCounter:
    """Stances of one leg so far.

    Attributes:
        threshold: normal force that tells stance from swing [N].
        is_open: whether the hoof is in stance.
        began: crank angle where the last stance opened [rad].
        peak: highest resultant force of the open stance [N], 0 between stances.
        count: how many have opened.
    """

    threshold: float
    is_open: bool = False
    began: float = 0.0
    peak: float = 0.0
    count: int = 0

    def add(self, theta: float, normal: float, force: float) -> float:
        """Take the next substep: crank angle [rad], normal and resultant force on the hoof [N].

        Returns:
            By how much the running peak has grown [N]; over a stance these add up to its peak.
        """
        loaded = normal > self.threshold
        goes_on = loaded and self.is_open and theta - self.began < 2 * math.pi
        before = self.peak if goes_on else 0.0
        if loaded and not goes_on:
            self.began, self.count = theta, self.count + 1
        self.is_open, self.peak = loaded, max(before, force) if loaded else 0.0
        return self.peak - before
