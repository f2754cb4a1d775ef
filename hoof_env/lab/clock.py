"""When the samples of a record were taken: from a column of times, or a rate.

There is one clock for a record, that of its file: with a rate it begins where the column of times does.

Times need not be exact. Programs write them with few decimals, so that steps differ by the last digit: what
half a unit of that digit explains is no unevenness. A sample that is left out is one, where the last digit is
finer than a step.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.lab.tables import Table

Floats = NDArray[np.float64]

TIMES = dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0) | dict.fromkeys(
    ("ms", "msec", "msecs", "millisecond", "milliseconds"), 1e-3
)
"""Units of time [s], in small letters."""

UNEVEN = 0.01  # most that sampling intervals may differ from each other, of their mean
COARSE = 0.9  # of a step, from which on the last digit hides a sample that is left out,
FEW = 3  # unless as many steps or more differ, as those of rounded times do again and again
# rates between which those of force records lie [Hz]
SLOW = 10.0
FAST = 1e5
ROUND = (1000, 100, 50, 10, 5, 1)  # what rates are multiples of, the likeliest first [Hz]
MANY = 10  # numbers between powers of ten that show how many decimals are written there
DIGITS = 9  # most decimals that are looked for
SAME = 0.1  # share by which a step may differ from what the rate says


def times_of(
    path: Path, table: Table, name: str, rate: float | None, n: int, few: str
) -> tuple[Floats, list[str]]:
    """Times of `n` rows [s], evenly spaced, and what is doubtful about them. `few` names the columns.

    Raises:
        ParameterError: there is no such column and no rate, or its unit is none of time.
        DataFileError: the times do not increase evenly.
    """
    name = _found(table, name)
    if rate is not None:
        start, notes = _start(table, name, rate)
        return start + np.arange(n) / rate, notes
    if name not in table.names:
        raise ParameterError(
            f"map: expected a column of {path.name} for time, as in time=Seconds, or its rate (--rate-a, "
            f"--rate-b); it has {few}"
        )
    said = table.units.get(name)
    if said and said.casefold() not in TIMES:
        raise ParameterError(f"map: expected times of {path.name} in s or ms, got {said}")
    if name in table.unread:
        raise DataFileError(f"record {str(path)!r}: {table.unread[name]}")
    column = table.columns[name]
    if not np.isfinite(column).all():
        row = int(np.argmin(np.isfinite(column)))
        raise DataFileError(
            f"record {str(path)!r}: {name}: expected finite numbers, got {column[row]} in row {row + 1}"
        )
    time = _even(path, name, column) * TIMES[(said or "s").casefold()]
    found = (n - 1) / float(time[-1] - time[0])
    if SLOW <= found <= FAST:
        return time, []
    if said:
        return time, [
            f"times of {name} in {said} make a rate of {found:g} Hz, which is none of a force record; if the "
            "unit is wrong, change it in the file, or give the rate (--rate-a, --rate-b)"
        ]
    return time, [
        f"times of {name} have no unit and are taken as s, which makes a rate of {found:g} Hz; if they are "
        f"in ms, write {name} [ms] above them, or give the rate (--rate-a, --rate-b)"
    ]


def _found(table: Table, name: str) -> str:
    """The name as the table spells it, where only small and large letters differ."""
    alike = [one for one in table.names if one.casefold() == name.casefold()]
    return alike[0] if name not in table.names and len(alike) == 1 else name


def _start(table: Table, name: str, rate: float) -> tuple[float, list[str]]:
    """When a record with a rate begins [s], by its column of times, if it has one."""
    column = table.columns.get(name)
    if column is None or not np.isfinite(column[[0, -1]]).all() or column[-1] == column[0]:
        return 0.0, []
    unit = table.units.get(name, "").casefold()
    step = float(column[-1] - column[0]) / (len(column) - 1)
    if unit:
        scale = TIMES.get(unit)
    else:  # the rate tells it
        scale = next((one for one in (1.0, 1e-3) if abs(step * one * rate - 1) < SAME), None)
    if scale is not None and (unit or abs(step * scale * rate - 1) < SAME):
        notes = []
        if abs(step * scale * rate - 1) > SAME:
            notes = [
                f"times of {name} make a rate of {1 / (step * scale):g} Hz and not of {rate:g} Hz, which is "
                "taken; the record begins at the first of them"
            ]
        return float(column[0]) * scale, notes
    return 0.0, [
        f"steps of {name}, {step:g}, are neither s nor ms at a rate of {rate:g} Hz; the record begins at 0 s"
    ]


def _even(path: Path, name: str, column: Floats) -> Floats:
    """The column, its rounding taken away; `DataFileError` unless its steps are even."""
    steps = np.diff(column)
    mean = float(column[-1] - column[0]) / len(steps)
    if mean > 0 and np.abs(steps - mean).max() <= UNEVEN * mean:
        return column
    digit = _last_digit(column)
    hidden = digit > COARSE * steps.min() and (np.abs(steps - mean) > digit / 2).sum() < FEW
    if mean > 0 and digit > 0 and not hidden:
        smooth = _line(column, digit / 2)
        if smooth is not None:
            return smooth
    worst = int(np.abs(steps - mean).argmax())
    raise DataFileError(
        f"record {str(path)!r}: {name}: expected times that increase evenly, got steps of {steps.min():g} "
        f"to {steps.max():g}, of {steps[worst]:g} behind {column[worst]:g} in row {worst + 1}; if the "
        "samples are even nevertheless, give their rate (--rate-a, --rate-b)"
    )


def _last_digit(column: Floats) -> float:
    """A unit of the last decimal of numbers, the coarsest of each power of ten, as programs that keep some
    digits have fewer decimals of larger numbers; 0 if they are not rounded."""
    size = np.floor(np.log10(np.maximum(np.abs(column), 1.0))).astype(int)
    found = 0.0
    powers, counts = np.unique(size, return_counts=True)
    for power in powers[counts >= min(MANY, counts.max())]:  # a few may be round by chance
        values = column[size == power]
        for decimals in range(DIGITS + 1):
            scaled = values * 10.0**decimals
            if np.abs(scaled - np.rint(scaled)).max() < 1e-3:
                found = max(found, 10.0**-decimals)
                break
        else:
            return 0.0
    return found


def _line(column: Floats, most: float) -> Floats | None:
    """Even times none of which is farther than `most` from those of the column; None if there are none. Their
    rate is a whole number, the roundest that fits, if one does."""
    k = np.arange(len(column))
    most = most * (1 + 1e-6) + 1e-12 * float(np.abs(column).max())

    def off(step: float) -> float:
        rest = column - step * k
        return float(np.ptp(rest)) / 2

    mean = float(column[-1] - column[0]) / (len(column) - 1)
    low = mean - 2 * most / (len(column) - 1)
    high = mean + 2 * most / (len(column) - 1)
    for scale in (1.0, 1e3):  # of s and of ms
        for round_to in ROUND:
            rate = round(scale / mean / round_to) * round_to
            if rate > 0 and low <= scale / rate <= high and off(scale / rate) <= most:
                return _through(column, scale / rate, k)
    best = float(np.polyfit(k - k.mean(), column, 1)[0])
    for _ in range(100):  # the farthest of all times is a convex function of the step
        third = (high - low) / 3
        if off(low + third) <= off(high - third):
            high -= third
        else:
            low += third
    step = best if off(best) <= most else (low + high) / 2
    return _through(column, step, k) if off(step) <= most else None


def _through(column: Floats, step: float, k: NDArray[np.int64]) -> Floats:
    """Even times in the middle of those of the column; from its first, if that is one of them."""
    rest = column - step * k
    middle = float(rest.max() + rest.min()) / 2
    half = float(np.ptp(rest)) / 2
    digit = _last_digit(column)
    start = float(column[0]) if abs(column[0] - middle) + half <= digit / 2 * (1 + 1e-6) else middle
    return np.asarray(start + step * k, np.float64)
