"""Stances in a vertical force, and pairs of stances of two records.

A stance is a time of at least `MIN_STANCE_SECONDS` above a threshold. Shorter bursts, which noise causes in
swing, are dropped first; then shorter gaps are closed. Stances that the record's ends cut off are left out.
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
"""Numbers of the first sample of each stance and of the sample after its last."""

MIN_STANCE_SECONDS = 0.02
"""Shortest stance, and shortest gap between stances [s]."""

NEAR_BEST_RATIO = 1.1
"""Largest difference of a shift that counts as near the best, over the least difference."""

MAX_SHIFTS = 400
"""Largest number of shifts between touchdowns that are tried."""

MAX_PERIOD_RATIO = 1.1
"""Largest ratio of stride periods at which stances are paired by their times."""


def whole_stances(vertical: Floats, level: float, rate: float) -> Spans:
    """Find the whole stances in a vertical force.

    Args:
        vertical: the force, shape (n,).
        level: threshold, in the unit of the force.
        rate: sampling rate [Hz].
    """
    edges = np.flatnonzero(np.diff((vertical > level).astype(int), prepend=0, append=0))
    spans: Spans = []
    for first, last in edges.reshape(-1, 2).tolist():
        if last - first < MIN_STANCE_SECONDS * rate:
            continue
        if spans and first - spans[-1][1] < MIN_STANCE_SECONDS * rate:
            spans[-1] = spans[-1][0], last
        else:
            spans.append((first, last))
    # Stances at an end of the record are dropped last, as a neighbour across a short gap is a part of them.
    return [(i, j) for i, j in spans if i > 0 and j < len(vertical)]


def best_shift(
    forces_a: list[Floats], forces_b: list[Floats], stances: list[list[Spans]], rate: float, near: int
) -> float:
    """Find the time that is to be added to the times of B [s], both counted from their starts.

    Args:
        forces_a, forces_b: forces of the limbs of A and of B, shape (n, 2), in the same order.
        stances: stances of the limbs of A, and of B.
        rate: sampling rate of both [Hz].
        near: number of samples around the best shift between touchdowns that are searched.

    Raises:
        ParameterError: no limb has a stance in both records.
    """
    whole_a = np.array([force[:, 1] for force in forces_a])
    whole_b = np.array([force[:, 1] for force in forces_b])
    touch = [(of_a, of_b) for of_a, of_b in zip(*stances, strict=True) if of_a and of_b]
    if not touch:
        raise ParameterError("align: expected stances of one limb in both records, found none")
    lags = sorted({i - j for (i, _), (j, _) in product(*touch[0])}, key=abs)[:MAX_SHIFTS]
    # Under a large shift a short overlap could agree by chance.
    least = min(whole_a.shape[1], whole_b.shape[1]) // 2

    def difference(lag: int) -> float:
        """Return the root mean square difference if B is shifted by `lag` samples."""
        first = max(0, lag)
        last = min(whole_a.shape[1], whole_b.shape[1] + lag)
        if last - first < max(least, 1):
            return math.inf
        off = whole_a[:, first:last] - whole_b[:, first - lag : last - lag]
        return math.sqrt((off * off).mean())

    differences = {lag: difference(lag) for lag in lags}
    # Strides repeat, so that several shifts are about as good: the shortest is taken.
    best = next(lag for lag in lags if differences[lag] <= NEAR_BEST_RATIO * min(differences.values()))
    around = sorted(range(best - near, best + near + 1), key=lambda lag: abs(lag - best))
    # Of equal differences `min` takes the first, which is the nearest to the touchdowns.
    return min(around, key=difference) / rate


class Side(NamedTuple):
    """A limb in one of the records: times after the shift [s], forces of shape (n, 2) and whole stances."""

    time: Floats
    force: Floats
    stances: Spans

    @property
    def touchdowns(self) -> Floats:
        """Times of the touchdowns [s]."""
        return self.time[[first for first, _ in self.stances]]

    @property
    def period(self) -> float:
        """Median duration of a stride [s], NaN with less than two stances."""
        return float(np.median(np.diff(self.touchdowns))) if len(self.stances) > 1 else math.nan

    def whole_between(self, low: float, high: float) -> int:
        """Count the stances between two times [s]."""
        return sum(self.time[i] >= low and self.time[j] <= high for i, j in self.stances)


class Pair(NamedTuple):
    """A stance of A and one of B.

    Attributes:
        time: time from A's touchdown, from the earlier touchdown to the later lift-off, shape (n,) [s].
        a, b: forces of A and of B at that time, shape (n, 2).
        own: forces of each of the two stances alone.
        late: delay of B's touchdown [s].
    """

    time: Floats
    a: Floats
    b: Floats
    own: tuple[Floats, Floats]
    late: float


def pairs_of(a: Side, b: Side, rate: float, by_touchdown: bool) -> list[Pair]:
    """Pair the stances of a limb in two records.

    Args:
        a, b: the limb in both records.
        rate: sampling rate of both [Hz].
        by_touchdown: True lays each pair touchdown on touchdown, False leaves them at their times.
    """
    if not a.stances or not b.stances:
        return []
    touch_a = a.touchdowns
    touch_b = b.touchdowns
    pairs = []
    for m, n in _matches(a, b, by_touchdown):
        first_a, last_a = a.stances[m]
        first_b, last_b = b.stances[n]
        # Sample k of A is compared with sample k + ahead of B.
        ahead = first_b - first_a if by_touchdown else round((a.time[0] - b.time[0]) * rate)
        low = max(min(first_a, first_b - ahead), 0, -ahead)
        high = min(max(last_a, last_b - ahead), len(a.force), len(b.force) - ahead)
        if high - low > 1:
            time = (np.arange(low, high) - first_a) / rate
            own = a.force[first_a:last_a], b.force[first_b:last_b]
            late = float(touch_b[n] - touch_a[m])
            pairs.append(Pair(time, a.force[low:high], b.force[low + ahead : high + ahead], own, late))
    return pairs


def _matches(a: Side, b: Side, by_touchdown: bool) -> list[tuple[int, int]]:
    """Return numbers of stances of A and of B that make pairs.

    Two stances make a pair if each has the nearest touchdown to the other, so that a step that one record
    lacks does not shift the others. Records of different pace are paired by touchdown in order, from the two
    nearest touchdowns on.
    """
    apart = np.abs(a.touchdowns[:, None] - b.touchdowns)
    periods = sorted((a.period, b.period))
    # `not <=` instead of `>`, as an unknown period is NaN and counts as a different pace.
    if by_touchdown and not periods[1] <= MAX_PERIOD_RATIO * periods[0]:
        i, j = np.unravel_index(int(apart.argmin()), apart.shape)
        later = int(i - j)
        return [(m, m - later) for m in range(apart.shape[0]) if 0 <= m - later < apart.shape[1]]
    nearest = apart.argmin(axis=1).tolist()
    return [(m, n) for m, n in enumerate(nearest) if apart[:, n].argmin() == m]
