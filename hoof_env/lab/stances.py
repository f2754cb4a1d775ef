"""Stances in a vertical force, and pairs of stances of two records.

A stance is a time of at least `MIN_STANCE_SECONDS` above a threshold. Shorter bursts, which noise causes in
swing, are dropped first; then shorter gaps are closed. Stances that the record's ends cut off are left out.
"""

from __future__ import annotations

import math
from itertools import pairwise, product
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
"""Largest ratio of a shift's difference to the least one at which the shift counts as near the best."""

MAX_SHIFTS = 400
"""Largest number of shifts between touchdowns that are tried."""

MAX_OUTSIDE_STRIDE = 0.55
"""Largest part of the shorter record that may lie outside the other, in strides: with half a stride any phase
of B can be laid on A's."""

MIN_STRIDES = 2
"""Least number of strides in the overlap of records that began at different times."""

CLEAR_SHARE = 1 / 3
"""Ratio of the difference of such records to the difference of strides from the next one, below which they
have the same strides."""

MAX_PERIOD_RATIO = 1.1
"""Largest ratio of stride periods at which stances are paired by their times."""


def whole_stances(vertical: Floats, level: float, rate: float) -> Spans:
    """Find the whole stances in a vertical force: `loaded_spans` that no end of the record cuts off."""
    # Stances at an end of the record are dropped last, as a neighbour across a short gap is a part of them.
    return [(i, j) for i, j in loaded_spans(vertical, level, rate) if i > 0 and j < len(vertical)]


def loaded_spans(vertical: Floats, level: float, rate: float) -> Spans:
    """Find the times above a threshold in a vertical force.

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
    return spans


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
    touch = [(of_a, of_b) for of_a, of_b in zip(*stances, strict=True) if of_a and of_b]
    if not touch:
        raise ParameterError("align: expected stances of one limb in both records, found none")
    fit = _Fit(forces_a, forces_b, *touch[0])
    lags = sorted({i - j for (i, _), (j, _) in product(*touch[0])}, key=abs)
    best = fit.of_part(lags[:MAX_SHIFTS], fit.of_all(lags))
    return min(_around(best, near), key=fit.difference) / rate


def _around(lag: int, near: int) -> list[int]:
    """Return the lags within `near` of one, the nearest first, which `min` takes of equal ones."""
    return sorted(range(lag - near, lag + near + 1), key=lambda other: abs(other - lag))


def _variation(verticals: Floats, stances: Spans) -> float:
    """Return the median root mean square difference of strides from the next one, 0 with less than
    `MIN_STRIDES`.

    Args:
        verticals: vertical forces of the limbs, shape (limbs, n).
        stances: stances of a limb, whose touchdowns begin strides.
    """
    touch = [first for first, _ in stances]
    if len(touch) <= MIN_STRIDES:
        return 0.0
    strides = [verticals[:, i:j] for i, j in pairwise(touch)]
    sizes = []
    for one, other in pairwise(strides):
        n = min(one.shape[1], other.shape[1])
        sizes.append(math.sqrt(((one[:, :n] - other[:, :n]) ** 2).mean()))
    return float(np.median(sizes))


class _Fit:
    """Differences of the vertical forces of two records if B is shifted by a lag in samples.

    Args:
        forces_a, forces_b: forces of the limbs, shape (n, 2).
        stances_a, stances_b: stances of one limb, which divide the records into strides.
    """

    def __init__(
        self, forces_a: list[Floats], forces_b: list[Floats], stances_a: Spans, stances_b: Spans
    ) -> None:
        self._a = np.array([force[:, 1] for force in forces_a])
        self._b = np.array([force[:, 1] for force in forces_b])
        self._touch = np.array([first for first, _ in stances_a])
        # A fault of one record makes only that one vary.
        self._variation = min(_variation(self._a, stances_a), _variation(self._b, stances_b))
        periods = [np.median(np.diff([i for i, _ in spans])) for spans in (stances_a, stances_b) if spans[1:]]
        self._shorter = min(self._a.shape[1], self._b.shape[1])
        self._period = float(min(periods, default=self._shorter))

    def _overlap(self, lag: int) -> tuple[int, int]:
        """Return the numbers of A's first sample within B, and of the sample after its last."""
        return max(0, lag), min(self._a.shape[1], self._b.shape[1] + lag)

    def _squares(self, lag: int) -> Floats:
        """Return the squared differences, means over the limbs, in the overlap, shape (n,)."""
        first, last = self._overlap(lag)
        off = self._a[:, first:last] - self._b[:, first - lag : last - lag]
        return np.asarray((off * off).mean(axis=0))

    def difference(self, lag: int) -> float:
        """Return the root mean square difference in the overlap, infinite without one."""
        first, last = self._overlap(lag)
        return math.sqrt(self._squares(lag).mean()) if last > first else math.inf

    def _within(self, lag: int) -> NDArray[np.int64]:
        """Return the touchdowns in the overlap, counted from its start."""
        first, last = self._overlap(lag)
        return self._touch[(self._touch >= first) & (self._touch < last)] - first

    def _is_long(self, lag: int) -> bool:
        """Return True if the overlap has `MIN_STRIDES` and half of the shorter record."""
        first, last = self._overlap(lag)
        return len(self._within(lag)) >= MIN_STRIDES and last - first >= self._shorter // 2

    def _typical(self, lag: int) -> float:
        """Return the median over strides of the root mean square difference."""
        # Before the first touchdown in the overlap there is the end of a stride.
        parts = np.split(self._squares(lag), self._within(lag))[1:]
        return math.sqrt(float(np.median([part.mean() for part in parts]))) if parts else 0.0

    def of_all(self, lags: list[int]) -> int:
        """Return the best of the lags under which the shorter record lies within the other, but for half a
        stride at most: no stride that both have is left out."""
        slack = MAX_OUTSIDE_STRIDE * self._period
        whole = [lag for lag in lags if np.diff(self._overlap(lag))[0] >= self._shorter - slack]
        if not whole:
            return max(lags, key=lambda lag: int(np.diff(self._overlap(lag))[0]))
        whole = whole[:MAX_SHIFTS]
        differences = [self.difference(lag) for lag in whole]
        # Strides repeat, so that several shifts are about as good: the shortest is taken.
        return next(
            lag
            for lag, size in zip(whole, differences, strict=True)
            if size <= NEAR_BEST_RATIO * min(differences)
        )

    def of_part(self, lags: list[int], whole: int) -> int:
        """Return the lag under which a part of the records agrees far better than one stride with the next,
        as of two records that began at different times; else `whole`, the best of all strides."""
        least = CLEAR_SHARE * self._variation
        # The median of strides, so that a stride in which one record is at fault does not count.
        if not least > 0 or self._typical(whole) < least:
            return whole
        size, best = min((self.difference(lag), lag) for lag in [whole, *filter(self._is_long, lags)])
        return best if size < least else whole


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

    Two stances make a pair if each has the nearest touchdown to the other, less than half a stride away, so
    that a step that one record lacks does not shift the others. Records of different pace are paired by
    touchdown in order, all stances of the record that has fewer.
    """
    apart = np.abs(a.touchdowns[:, None] - b.touchdowns)
    periods = sorted((a.period, b.period))
    # `not <=` instead of `>`, as an unknown period is NaN and counts as a different pace.
    if by_touchdown and not periods[1] <= MAX_PERIOD_RATIO * periods[0]:
        m, n = apart.shape
        fewer = min(m, n)
        # Sums of distances by the number of stances of the longer record before the first pair.
        sums = [np.trace(apart[max(k, 0) :, max(-k, 0) :][:fewer, :fewer]) for k in _offsets(m, n)]
        k = _offsets(m, n)[int(np.argmin(sums))]
        return [(max(k, 0) + i, max(-k, 0) + i) for i in range(fewer)]
    # The next stance of a limb is no partner of one that the other record lacks.
    known = [period for period in periods if period > 0]
    nearest = apart.argmin(axis=1).tolist()
    return [
        (m, n)
        for m, n in enumerate(nearest)
        if apart[:, n].argmin() == m and (apart[m, n] < known[0] / 2 if known else _overlap(a, b, m, n))
    ]


def _offsets(m: int, n: int) -> list[int]:
    """Return by how many stances A may be ahead of B, of `m` and `n` stances, if all of the fewer are paired;
    negative where B is ahead."""
    return list(range(m - n + 1)) if m >= n else [-k for k in range(n - m + 1)]


def _overlap(a: Side, b: Side, m: int, n: int) -> bool:
    """Return True if stance `m` of A and stance `n` of B are partly at the same time."""
    (first_a, last_a), (first_b, last_b) = a.stances[m], b.stances[n]
    return bool(a.time[first_a] < b.time[last_b] and b.time[first_b] < a.time[last_a])
