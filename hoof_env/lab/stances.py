"""Stances in a vertical force, and which of two records belong together.

A stance is a stretch of at least `SHORTEST` above a threshold. Shorter bursts are dropped first, as noise
makes them in swing, and then gaps that are shorter are closed; stances that a record cuts off are left out.
"""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError

Floats = NDArray[np.float64]
Spans = list[tuple[int, int]]
"""First and last-but-one sample of each stance."""

SHORTEST = 0.02  # stances and gaps that count [s]
NEAR = 1.1  # of the least difference, within which the shortest shift is taken
MOST_SHIFTS = 400  # of touchdowns that are tried
SAME_PACE = 1.1  # most that stride periods differ by where stances are paired by their times


def whole_stances(vertical: Floats, level: float, rate: float) -> Spans:
    """The whole stances of a force that is above `level`, at `rate` [Hz]."""
    edges = np.flatnonzero(np.diff((vertical > level).astype(int), prepend=0, append=0))
    spans: Spans = []
    for first, last in edges.reshape(-1, 2).tolist():
        if last - first < SHORTEST * rate:
            continue
        if spans and first - spans[-1][1] < SHORTEST * rate:
            spans[-1] = spans[-1][0], last
        else:
            spans.append((first, last))
    return [(i, j) for i, j in spans if i > 0 and j < len(vertical)]


def best_shift(
    forces_a: list[Floats], forces_b: list[Floats], stances: list[list[Spans]], rate: float, near: int
) -> float:
    """What is added to the times of B [s], both from their starts; touchdowns are known to `near` samples.
    `ParameterError` where no limb has a stance in both."""
    whole_a, whole_b = (np.array([force[:, 1] for force in forces]) for forces in (forces_a, forces_b))
    touch = [(one, two) for one, two in zip(*stances, strict=True) if one and two]
    if not touch:
        raise ParameterError("align: expected stances of one limb in both records, found none")
    lags = sorted({i - j for (i, _), (j, _) in product(*touch[0])}, key=abs)[:MOST_SHIFTS]
    least = min(whole_a.shape[1], whole_b.shape[1]) // 2

    def difference(lag: int) -> float:
        first = max(0, lag)
        last = min(whole_a.shape[1], whole_b.shape[1] + lag)
        if last - first < max(least, 1):
            return math.inf
        off = whole_a[:, first:last] - whole_b[:, first - lag : last - lag]
        return math.sqrt((off * off).mean())

    found = {lag: difference(lag) for lag in lags}
    best = next(lag for lag in lags if found[lag] <= NEAR * min(found.values()))
    around = sorted(range(best - near, best + near + 1), key=lambda lag: abs(lag - best))
    return min(around, key=difference) / rate  # the first of equals


class Side(NamedTuple):
    """A limb in one of the records: times after the shift [s], forces of shape (n, 2), whole stances."""

    time: Floats
    force: Floats
    stances: Spans

    @property
    def touchdowns(self) -> Floats:
        """Their times [s]."""
        return self.time[[first for first, _ in self.stances]]

    @property
    def period(self) -> float:
        """Of a stride [s], the median; not a number for less than two stances."""
        return float(np.median(np.diff(self.touchdowns))) if len(self.stances) > 1 else math.nan

    def whole_between(self, low: float, high: float) -> int:
        """How many stances lie between two times [s]."""
        return sum(self.time[i] >= low and self.time[j] <= high for i, j in self.stances)


class Pair(NamedTuple):
    """Two stances: the time from A's touchdown [s], the forces of A and B over both stances, those of each
    stance alone, and how much later B touches down [s]."""

    time: Floats
    a: Floats
    b: Floats
    own: tuple[Floats, Floats]
    late: float


def pairs_of(a: Side, b: Side, rate: float, by_touchdown: bool) -> list[Pair]:
    """Stances that belong together, touchdown on touchdown or at the times they have."""
    if not a.stances or not b.stances:
        return []
    touch_a = a.touchdowns
    touch_b = b.touchdowns
    found = []
    for m, n in _together(a, b, by_touchdown):
        (first_a, last_a) = a.stances[m]
        (first_b, last_b) = b.stances[n]
        ahead = first_b - first_a if by_touchdown else round((a.time[0] - b.time[0]) * rate)
        low = max(min(first_a, first_b - ahead), 0, -ahead)
        high = min(max(last_a, last_b - ahead), len(a.force), len(b.force) - ahead)
        if high - low > 1:
            time = (np.arange(low, high) - first_a) / rate
            own = a.force[first_a:last_a], b.force[first_b:last_b]
            late = float(touch_b[n] - touch_a[m])
            found.append(Pair(time, a.force[low:high], b.force[low + ahead : high + ahead], own, late))
    return found


def _together(a: Side, b: Side, by_touchdown: bool) -> list[tuple[int, int]]:
    """Numbers of stances. Each with the one whose touchdown is nearest, if that is mutual: a step that one
    record lacks leaves the others where they are. Records of another pace by touchdown: in order, from the
    two that are nearest on."""
    apart = np.abs(a.touchdowns[:, None] - b.touchdowns)
    periods = sorted((a.period, b.period))
    if by_touchdown and not periods[1] <= SAME_PACE * periods[0]:  # or unknown
        i, j = np.unravel_index(int(apart.argmin()), apart.shape)
        later = int(i - j)
        return [(m, m - later) for m in range(apart.shape[0]) if 0 <= m - later < apart.shape[1]]
    nearest = apart.argmin(axis=1).tolist()
    return [(m, n) for m, n in enumerate(nearest) if apart[:, n].argmin() == m]
