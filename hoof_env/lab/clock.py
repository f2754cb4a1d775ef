"""Times of the samples of a record, from a column of times or a rate.

A record has one clock, the clock of its file: with a rate it begins with the first of the column of times.

Times need not be exact. Programs write them with few decimals, so that steps differ by the last digit:
differences up to half a unit of that digit do not count as uneven. A missing sample does, if the last digit
is finer than a step.
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
"""Units of time in seconds, by their spellings in small letters."""

UNEVEN = 0.01
"""Largest difference of a sampling interval from the mean interval, as a share of the mean."""

COARSE = 0.9
"""Share of a step above which a unit of the last digit would hide a missing sample."""

FEW = 3
"""Number of uneven steps from which on they are due to rounding, which recurs; a missing sample does not."""

SLOW = 10.0
"""Lowest rate of a force record [Hz]."""

FAST = 1e5
"""Highest rate of a force record [Hz]."""

ROUND = (1000, 100, 50, 10, 5, 1)
"""Numbers of which rates are multiples, the likeliest first [Hz]."""

MANY = 10
"""Number of values between two powers of ten that show with how many decimals they were written."""

DIGITS = 9
"""Largest number of decimals that is looked for."""

SAME = 0.1
"""Largest difference of a step from the step of the stated rate, as a share of the latter."""


def times_of(
    path: Path, table: Table, name: str, rate: float | None, n: int, few: str
) -> tuple[Floats, list[str]]:
    """Return the times of a record, evenly spaced, shape (n,) [s], and doubts about them.

    Args:
        path: the file, for error messages.
        table: its columns.
        name: name of the column of times.
        rate: sampling rate [Hz], which replaces the steps of the column; None takes them from the column.
        n: number of rows.
        few: names of the columns for error messages.

    Raises:
        ParameterError: the column and the rate are missing, or the column's unit is not one of time.
        DataFileError: the times are not finite, or do not increase evenly.
    """
    name = _spelled(table, name)
    if rate is not None:
        start, notes = _start(table, name, rate)
        return start + np.arange(n) / rate, notes
    if name not in table.names:
        raise ParameterError(
            f"map: expected a column of {path.name} for time, as in time=Seconds, or its rate (--rate-a, "
            f"--rate-b); it has {few}"
        )
    unit = table.units.get(name)
    if unit and unit.casefold() not in TIMES:
        raise ParameterError(f"map: expected times of {path.name} in s or ms, got {unit}")
    if name in table.unread:
        raise DataFileError(f"record {str(path)!r}: {table.unread[name]}")
    column = table.columns[name]
    if not np.isfinite(column).all():
        row = int(np.argmin(np.isfinite(column)))
        raise DataFileError(
            f"record {str(path)!r}: {name}: expected finite numbers, got {column[row]} in row {row + 1}"
        )
    time = _even(path, name, column) * TIMES[(unit or "s").casefold()]
    # A rate that no force plate has is a sign of a wrong unit. It is taken all the same, with a note.
    measured = (n - 1) / float(time[-1] - time[0])
    if SLOW <= measured <= FAST:
        return time, []
    if unit:
        return time, [
            f"times of {name} in {unit} make a rate of {measured:g} Hz, which is none of a force record; if "
            "the unit is wrong, change it in the file, or give the rate (--rate-a, --rate-b)"
        ]
    return time, [
        f"times of {name} have no unit and are taken as s, which makes a rate of {measured:g} Hz; if they "
        f"are in ms, write {name} [ms] above them, or give the rate (--rate-a, --rate-b)"
    ]


def _spelled(table: Table, name: str) -> str:
    """Return a column's name as the table spells it, if only small and large letters differ."""
    alike = [column for column in table.names if column.casefold() == name.casefold()]
    return alike[0] if name not in table.names and len(alike) == 1 else name


def _start(table: Table, name: str, rate: float) -> tuple[float, list[str]]:
    """Return the first time [s] of a record with a given rate, by its column of times, else 0; and doubts
    about it."""
    column = table.columns.get(name)
    if column is None or not np.isfinite(column[[0, -1]]).all() or column[-1] == column[0]:
        return 0.0, []
    unit = table.units.get(name, "").casefold()
    step = float(column[-1] - column[0]) / (len(column) - 1)
    if unit:
        scale = TIMES.get(unit)
    else:
        # Without a unit, s or ms, whichever agrees with the rate.
        scale = next((seconds for seconds in (1.0, 1e-3) if abs(step * seconds * rate - 1) < SAME), None)
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
    """Return a column of times without the rounding of its last digit; raise `DataFileError` unless its steps
    are even."""
    steps = np.diff(column)
    mean = float(column[-1] - column[0]) / len(steps)
    if mean > 0 and np.abs(steps - mean).max() <= UNEVEN * mean:
        return column
    digit = _last_digit(column)
    # With a digit as coarse as a step, a missing sample would look like rounding.
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
    """Return a unit of the last decimal of numbers, 0 if they are not rounded.

    Programs that keep some number of digits write fewer decimals of larger numbers, so that each power of ten
    is looked at alone, and the coarsest unit is returned.
    """
    size = np.floor(np.log10(np.maximum(np.abs(column), 1.0))).astype(int)
    coarsest = 0.0
    powers, counts = np.unique(size, return_counts=True)
    # A few numbers may be round by chance.
    for power in powers[counts >= min(MANY, counts.max())]:
        values = column[size == power]
        for decimals in range(DIGITS + 1):
            scaled = values * 10.0**decimals
            if np.abs(scaled - np.rint(scaled)).max() < 1e-3:
                coarsest = max(coarsest, 10.0**-decimals)
                break
        else:
            return 0.0
    return coarsest


def _line(column: Floats, most: float) -> Floats | None:
    """Fit even times to a column of times.

    Returns:
        Times of which none is farther than `most` from those of the column, None if there are none. Their
        rate is a whole number, the roundest that fits, if one does.
    """
    k = np.arange(len(column))
    # A little more than half a digit, for the rounding of the numbers themselves.
    most = most * (1 + 1e-6) + 1e-12 * float(np.abs(column).max())

    def off(step: float) -> float:
        """Return the largest distance of even times with this step, in the best place, from the column."""
        rest = column - step * k
        return float(np.ptp(rest)) / 2

    mean = float(column[-1] - column[0]) / (len(column) - 1)
    low = mean - 2 * most / (len(column) - 1)
    high = mean + 2 * most / (len(column) - 1)
    # The column may be in s or in ms: a rate of 200 Hz has steps of 0.005 or 5.
    for scale in (1.0, 1e3):
        for round_to in ROUND:
            rate = round(scale / mean / round_to) * round_to
            if rate > 0 and low <= scale / rate <= high and off(scale / rate) <= most:
                return _through(column, scale / rate, k)
    best = float(np.polyfit(k - k.mean(), column, 1)[0])
    # The largest distance is a convex function of the step: each third that is cut off cannot hold its least.
    for _ in range(100):
        third = (high - low) / 3
        if off(low + third) <= off(high - third):
            high -= third
        else:
            low += third
    step = best if off(best) <= most else (low + high) / 2
    return _through(column, step, k) if off(step) <= most else None


def _through(column: Floats, step: float, k: NDArray[np.int64]) -> Floats:
    """Return even times with a step, at least distance from the column, or from its first time on if that is
    as good within half a digit."""
    rest = column - step * k
    middle = float(rest.max() + rest.min()) / 2
    half = float(np.ptp(rest)) / 2
    digit = _last_digit(column)
    start = float(column[0]) if abs(column[0] - middle) + half <= digit / 2 * (1 + 1e-6) else middle
    return np.asarray(start + step * k, np.float64)
