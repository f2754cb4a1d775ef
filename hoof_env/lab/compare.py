"""Two force records beside each other, limb by limb: `hoof-env compare`.

Both are resampled by linear interpolation to the higher of both rates, so that no peak of either is lost. A
stance of a limb is a stretch of at least `SHORTEST` whose vertical force is above the threshold; gaps that
are shorter are closed, and stances that a record cuts off are left out.

Three ways to align B with A. "none": the times of the files. "shift": one shift for all limbs. It is a
difference of the touchdowns of one stance of A and one of B, the one under which the vertical forces of all
limbs differ least (root mean square over at least half of the shorter record; of shifts within 10 % of the
least, the shortest, as strides repeat), then moved within two sampling intervals to the least difference.
"stances": that shift tells which stances belong together, and then each pair is laid touchdown on touchdown.
The pairs of a limb begin with the two whose touchdowns are nearest under the shift, and go on from there in
order, so that records of different stride times can be compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, ParameterError, check_choice, check_number
from hoof_env.lab.forces import THRESHOLD
from hoof_env.lab.read import ForceRecord

Floats = NDArray[np.float64]

SHORTEST = 0.02  # stances and gaps that count [s]
ALIGNMENTS = ("stances", "shift", "none")
ONE_PERCENT = 0.01  # threshold in body weights of an animal whose weight is not known
NEAR = 1.1  # of the least difference, within which the shortest shift is taken
MOST_SHIFTS = 400  # of touchdowns that are tried


@dataclass(frozen=True)
class Force:
    """How B differs from A in one component of a limb's force, means over the pairs; errors are B less A.

    Attributes:
        rmse: root mean square difference over all pairs, from the earlier touchdown to the later lift-off.
        r: Pearson's correlation there; not a number where a force does not change.
        peak, peak_error: of A, and the error [the records' unit].
        impulse, impulse_error: of A, and the error [that unit times s].
    """

    rmse: float
    r: float
    peak: float
    peak_error: float
    impulse: float
    impulse_error: float


@dataclass(frozen=True)
class LimbErrors:
    """How a limb of B differs from that of A.

    Attributes:
        pairs: how many stances are compared.
        forces: by component: "vertical", "fore-aft", and of the latter "braking" and "propulsion" alone,
            whose peaks and impulses are positive.
        contact, contact_error: how long a stance lasts in A, and the error [s].
        touchdown_error: how much later B touches down after the shift [s], mean over the pairs.
        touchdown_spread: their standard deviation [s].
        peak_time_error: how much later after touchdown the vertical peak comes [s].
    """

    pairs: int
    forces: dict[str, Force]
    contact: float
    contact_error: float
    touchdown_error: float
    touchdown_spread: float
    peak_time_error: float


@dataclass(frozen=True)
class Comparison:
    """What `compare` finds.

    Attributes:
        a, b: the records.
        unit: of all forces, "N" or "BW".
        rate: that both are resampled to [Hz].
        shift: added to the times of B [s].
        limbs: errors by limb, in the order of A.
        curves: by limb, of each pair the time from A's touchdown [s], shape (n,), the forces of A and those
            of B there, forward and upward, shape (n, 2).
    """

    a: ForceRecord
    b: ForceRecord
    unit: str
    rate: float
    shift: float
    limbs: dict[str, LimbErrors]
    curves: dict[str, list[tuple[Floats, Floats, Floats]]]


def compare(
    a: ForceRecord,
    b: ForceRecord,
    align: str = "stances",
    threshold: float = THRESHOLD,
    units: str = "auto",
) -> Comparison:
    """Errors of B against A.

    Args:
        a, b: the records; limbs of the same name are compared, and where both have one only, those.
        align: one of `ALIGNMENTS`; see above.
        threshold: vertical force that makes a stance [N]; 1 % of the weight where the weight is not known.
        units: "N" or "BW" for the errors; "auto" is N where both records can be in N, else BW.

    Raises:
        ParameterError: an argument is wrong, records have no limb or no unit in common, or do not overlap.
        DataFileError: a record has no whole stance of any of those limbs.
    """
    check_choice("align", align, ALIGNMENTS)
    check_choice("units", units, ("auto", "N", "BW"))
    check_number("threshold", threshold, low=0.0, high=1e6)
    unit, (by_a, by_b) = _common_unit(a, b, units)
    names = _common_limbs(a, b)
    rate = max(a.rate, b.rate)
    starts = (a.time[0], b.time[0]) if align == "none" else (0.0, 0.0)
    time_a, forces_a = _resampled(a, [one for one, _ in names], by_a, rate, starts[0])
    time_b, forces_b = _resampled(b, [two for _, two in names], by_b, rate, starts[1])
    weight = a.weight or b.weight
    level = threshold if unit == "N" else threshold / weight if weight else ONE_PERCENT
    stances = [[_stances(force[:, 1], level, rate) for force in forces] for forces in (forces_a, forces_b)]
    for record, found in zip((a, b), stances, strict=True):
        if not any(found):
            raise DataFileError(
                f"record {record.name!r}: expected a whole stance above {level:g} {unit}, found none"
            )
    near = math.ceil(2 * rate / min(a.rate, b.rate))
    shift = 0.0 if align == "none" else _shift(forces_a, forces_b, stances, rate, near)
    limbs, curves = {}, {}
    for k, (name, _) in enumerate(names):
        sides = (
            _Side(time_a, forces_a[k], stances[0][k]),
            _Side(time_b + shift, forces_b[k], stances[1][k]),
        )
        pairs = _pairs(*sides, rate, by_touchdown=align == "stances")
        if pairs:
            limbs[name] = _errors(pairs, rate)
            curves[name] = [(pair.time, pair.a, pair.b) for pair in pairs]
    if not limbs:
        raise ParameterError(
            f"align: expected stances of a limb in {a.name} and {b.name} at the same times, found none with "
            f"align={align!r}"
        )
    return Comparison(a, b, unit, rate, shift, limbs, curves)


def _common_unit(a: ForceRecord, b: ForceRecord, units: str) -> tuple[str, tuple[float, float]]:
    for unit in ("N", "BW") if units == "auto" else (units,):
        by_a, by_b = a.per(unit), b.per(unit)
        if by_a and by_b:
            return unit, (by_a, by_b)
    wanted = "N" if units == "auto" else units
    lacking = next(name for name, record in (("a", a), ("b", b)) if not record.per(wanted))
    raise ParameterError(
        f"mass-{lacking}: expected the mass [kg] of the animal of {a.name if lacking == 'a' else b.name}, to "
        f"compare {a.unit} with {b.unit}{'' if units == 'auto' else f' in {units}'}"
    )


def _common_limbs(a: ForceRecord, b: ForceRecord) -> list[tuple[str, str]]:
    if shared := [(limb, limb) for limb in a.limbs if limb in b.limbs]:
        return shared
    if len(a.limbs) == len(b.limbs) == 1:
        return [(*a.limbs, *b.limbs)]  # type: ignore[list-item]
    raise ParameterError(
        f"map: expected a limb that both records have; {a.name} has {', '.join(a.limbs)}, {b.name} has "
        f"{', '.join(b.limbs)}; name one as in left_fore=plate_1"
    )


def _resampled(
    record: ForceRecord, limbs: list[str], factor: float, rate: float, start: float
) -> tuple[Floats, list[Floats]]:
    """Times from `start` on and forces of limbs, times `factor`, at `rate`."""
    own = record.time - record.time[0]
    time = np.arange(int(own[-1] * rate + 1e-6) + 1) / rate
    forces = [
        np.column_stack([np.interp(time, own, column) for column in record.limbs[limb].T]) * factor
        for limb in limbs
    ]
    return start + time, forces


def _stances(vertical: Floats, level: float, rate: float) -> list[tuple[int, int]]:
    """First and last-but-one sample of each whole stance."""
    edges = np.flatnonzero(np.diff((vertical > level).astype(int), prepend=0, append=0))
    spans: list[tuple[int, int]] = []
    for first, last in edges.reshape(-1, 2).tolist():
        if spans and first - spans[-1][1] < SHORTEST * rate:
            spans[-1] = spans[-1][0], last
        else:
            spans.append((first, last))
    n = len(vertical)
    return [(i, j) for i, j in spans if j - i >= SHORTEST * rate and i > 0 and j < n]


def _shift(
    forces_a: list[Floats],
    forces_b: list[Floats],
    stances: list[list[list[tuple[int, int]]]],
    rate: float,
    near: int,
) -> float:
    """What is added to the times of B [s], both from their starts; touchdowns are known to `near` samples."""
    whole_a, whole_b = (np.array([force[:, 1] for force in forces]) for forces in (forces_a, forces_b))
    touch = [(one, two) for one, two in zip(*stances, strict=True) if one and two]
    if not touch:
        raise ParameterError("align: expected stances of one limb in both records, found none")
    lags = sorted({i - j for (i, _), (j, _) in product(*touch[0])}, key=abs)[:MOST_SHIFTS]
    least = min(whole_a.shape[1], whole_b.shape[1]) // 2

    def difference(lag: int) -> float:
        first, last = max(0, lag), min(whole_a.shape[1], whole_b.shape[1] + lag)
        if last - first < max(least, 1):
            return math.inf
        off = whole_a[:, first:last] - whole_b[:, first - lag : last - lag]
        return math.sqrt((off * off).mean())

    found = {lag: difference(lag) for lag in lags}
    best = next(lag for lag in lags if found[lag] <= NEAR * min(found.values()))
    around = sorted(range(best - near, best + near + 1), key=lambda lag: abs(lag - best))
    return min(around, key=difference) / rate  # the first of equals


class _Side(NamedTuple):
    """A limb in one of the records: times after the shift [s], forces of shape (n, 2), whole stances."""

    time: Floats
    force: Floats
    stances: list[tuple[int, int]]


class _Pair(NamedTuple):
    """Two stances: the time from A's touchdown [s], the forces of A and B over both stances, those of each
    stance alone, and how much later B touches down [s]."""

    time: Floats
    a: Floats
    b: Floats
    own: tuple[Floats, Floats]
    late: float


def _pairs(a: _Side, b: _Side, rate: float, by_touchdown: bool) -> list[_Pair]:
    """Stances that belong together. By touchdown: in order, from the two that are nearest on. Else each with
    the nearest one, if that is mutual."""
    if not a.stances or not b.stances:
        return []
    touch_a, touch_b = (side.time[[first for first, _ in side.stances]] for side in (a, b))
    apart = np.abs(touch_a[:, None] - touch_b)
    i, j = np.unravel_index(int(apart.argmin()), apart.shape)
    later = int(i - j)
    together = [(m, m - later) for m in range(len(touch_a)) if 0 <= m - later < len(touch_b)]
    if not by_touchdown:
        nearest = apart.argmin(axis=1).tolist()
        together = [(m, n) for m, n in enumerate(nearest) if apart[:, n].argmin() == m]
    found = []
    for m, n in together:
        (first_a, last_a), (first_b, last_b) = a.stances[m], b.stances[n]
        ahead = first_b - first_a if by_touchdown else round((a.time[0] - b.time[0]) * rate)
        low = max(min(first_a, first_b - ahead), 0, -ahead)
        high = min(max(last_a, last_b - ahead), len(a.force), len(b.force) - ahead)
        if high - low > 1:
            time = (np.arange(low, high) - first_a) / rate
            own = a.force[first_a:last_a], b.force[first_b:last_b]
            late = float(touch_b[n] - touch_a[m])
            found.append(_Pair(time, a.force[low:high], b.force[low + ahead : high + ahead], own, late))
    return found


PARTS: dict[str, Callable[[Floats], Floats]] = {
    "vertical": lambda force: force[:, 1],
    "fore-aft": lambda force: force[:, 0],
    "braking": lambda force: np.maximum(-force[:, 0], 0.0),
    "propulsion": lambda force: np.maximum(force[:, 0], 0.0),
}
"""Components of forces of shape (n, 2)."""


def _errors(pairs: list[_Pair], rate: float) -> LimbErrors:
    """Errors of a limb over pairs of stances."""
    forces = {}
    for name, part in PARTS.items():
        x = np.concatenate([part(pair.a) for pair in pairs])
        y = np.concatenate([part(pair.b) for pair in pairs])
        figures = np.array([
            [(part(force).max(), part(force).sum() / rate) for force in pair.own] for pair in pairs
        ]).mean(axis=0)  # fmt: skip
        (peak, impulse), (peak_error, impulse_error) = figures[0], figures[1] - figures[0]
        spread = x.std() * y.std()
        r = float(((x - x.mean()) * (y - y.mean())).mean() / spread) if spread > 0 else math.nan
        rmse = math.sqrt(((x - y) ** 2).mean())
        forces[name] = Force(
            rmse, r, float(peak), float(peak_error), float(impulse), float(impulse_error)
        )  # fmt: skip
    contact, peak_time = (
        np.array([[measure(force) / rate for force in pair.own] for pair in pairs]).mean(axis=0)
        for measure in (len, lambda force: int(force[:, 1].argmax()))
    )
    late = np.array([pair.late for pair in pairs])
    return LimbErrors(
        len(pairs), forces, float(contact[0]), float(contact[1] - contact[0]),
        float(late.mean()), float(late.std()), float(peak_time[1] - peak_time[0]),
    )  # fmt: skip
