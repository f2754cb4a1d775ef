"""Times of a record's samples, from a column of times or a sampling rate.

Times are by the file's clock; with a given rate, the record begins at the first time of the column.

Times need not be exact. Programs write few decimals, so steps differ in the last digit; differences of up to
half a unit of that digit are not uneven. A missing sample is, if the last digit is finer than a step.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.lab.tables import Table

Floats = NDArray[np.float64]

SECONDS_BY_UNIT = dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0) | dict.fromkeys(
    ("ms", "msec", "msecs", "millisecond", "milliseconds"), 1e-3
)
SECONDS_BY_UNIT |= {"us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86_400.0}
"""Units of time in seconds, by their spellings in small letters."""

GUESSED_UNITS = ("ms", "us", "ns", "d")
"""Units of times without one, the likeliest first, if seconds give no plausible rate."""

RATE_REMEDY = "; if the samples are evenly spaced, give their rate (--rate-a, --rate-b)"
"""End of messages about times that cannot be read."""

MAX_UNEVENNESS = 0.01
"""Largest difference of a sampling interval from the mean interval, as a share of the mean."""

MAX_DIGIT_SHARE = 0.9
"""Share of a step above which a unit of the last digit would hide a missing sample."""

MIN_UNEVEN_STEPS = 3
"""Least number of uneven steps that rounding explains. Rounding recurs, a missing sample does not."""

MIN_RATE_HZ = 10.0
"""Lowest rate of a force record [Hz]."""

MAX_RATE_HZ = 1e5
"""Highest rate of a force record [Hz]."""

ROUND_RATES_HZ = (1000, 100, 50, 10, 5, 1)
"""Likely common divisors of rates, the likeliest first [Hz]."""

MIN_NUMBERS_FOR_DIGIT = 10
"""Least number of values of one magnitude that show the number of decimals of their program."""

MAX_DECIMALS = 9
"""Largest number of decimals that is tried."""

MAX_RATE_ERROR = 0.1
"""Largest difference of a step from the step of the given rate, as a share of the latter."""


def times_of(
    path: Path, table: Table, name: str, rate: float | None, n: int, few: str
) -> tuple[Floats, list[str]]:
    """Return the times of a record, evenly spaced, shape (n,) [s], and warnings about them.

    Args:
        path: the file, for error messages.
        table: its columns.
        name: name of the column of times.
        rate: sampling rate [Hz], which replaces the steps of the column; None takes them from the column.
        n: number of rows.
        few: names of the columns for error messages.

    Raises:
        ParameterError: the column and the rate are missing, or the column's unit is not one of time.
        DataFileError: the times are not finite, or not evenly spaced.
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
    if unit and unit.casefold() not in SECONDS_BY_UNIT:
        raise ParameterError(
            f"map: expected times of {path.name} in s, ms, us, ns, min, h or d, got {unit}; if {name} has no "
            "times, give the rate (--rate-a, --rate-b)"
        )
    if name in table.unread:
        raise DataFileError(f"record {str(path)!r}: {name}: {table.unread[name]}{RATE_REMEDY}")
    column = table.columns[name]
    if not np.isfinite(column).all():
        row = int(np.argmin(np.isfinite(column)))
        raise DataFileError(
            f"record {str(path)!r}: {name}: expected finite numbers, got {column[row]} in {table.place(row)}"
            f"{RATE_REMEDY}"
        )
    even = _even(path, name, column)
    by_unit = SECONDS_BY_UNIT[(unit or "s").casefold()]
    rate_in = (n - 1) / float(even[-1] - even[0])
    if MIN_RATE_HZ <= rate_in / by_unit <= MAX_RATE_HZ:
        return even * by_unit, []
    if unit:
        return even * by_unit, [
            f"times of {name} in {unit} imply {rate_in / by_unit:g} Hz, implausible for a force plate; if "
            "the unit is wrong, change it in the file, or give the rate (--rate-a, --rate-b)"
        ]
    said = f"times of {name} have no unit; in s they imply {rate_in:g} Hz"
    # Steps of 1 may count samples as well as milliseconds.
    for other in GUESSED_UNITS if rate_in != 1 else ():
        by_other = SECONDS_BY_UNIT[other]
        if MIN_RATE_HZ <= rate_in / by_other <= MAX_RATE_HZ:
            return even * by_other, [
                f"{said}, so they are read in {other}, {rate_in / by_other:g} Hz; if they are in s, write "
                f"{name} [s] above them, and if they count samples, give the rate (--rate-a, --rate-b)"
            ]
    return even, [
        f"{said}, implausible for a force plate; if they are in ms, write {name} [ms] above them, and if "
        "they count samples, give the rate (--rate-a, --rate-b)"
    ]


def _spelled(table: Table, name: str) -> str:
    """Return a column's name as the table spells it, if only small and large letters differ."""
    alike = [column for column in table.names if column.casefold() == name.casefold()]
    return alike[0] if name not in table.names and len(alike) == 1 else name


def _start(table: Table, name: str, rate: float) -> tuple[float, list[str]]:
    """Return the first time [s] of a record with a given rate, from its column of times, or 0 if the column
    cannot tell; and warnings about it."""
    column = table.columns.get(name)
    if column is None or not np.isfinite(column[[0, -1]]).all() or column[-1] == column[0]:
        return 0.0, []
    unit = table.units.get(name, "").casefold()
    step = float(column[-1] - column[0]) / (len(column) - 1)
    if unit:
        scale = SECONDS_BY_UNIT.get(unit)
    else:
        # Without a unit, that which agrees with the rate.
        units = (1.0, *(SECONDS_BY_UNIT[name] for name in GUESSED_UNITS))
        agrees = (seconds for seconds in units if abs(step * seconds * rate - 1) < MAX_RATE_ERROR)
        scale = next(agrees, None)
    if scale is not None and (unit or abs(step * scale * rate - 1) < MAX_RATE_ERROR):
        notes = []
        if abs(step * scale * rate - 1) > MAX_RATE_ERROR:
            notes = [
                f"times of {name} imply {1 / (step * scale):g} Hz, not the given {rate:g} Hz, which is used; "
                "the record begins at the first of these times"
            ]
        return float(column[0]) * scale, notes
    return 0.0, [f"steps of {name}, {step:g}, fit {rate:g} Hz in no unit of time; the record begins at 0 s"]


def _even(path: Path, name: str, column: Floats) -> Floats:
    """Return a column of times without the rounding of its last digit; raise `DataFileError` unless the times
    are evenly spaced."""
    steps = np.diff(column)
    mean = float(column[-1] - column[0]) / len(steps)
    if mean > 0 and np.abs(steps - mean).max() <= MAX_UNEVENNESS * mean:
        return column
    digit = _last_digit(column)
    # With a digit as coarse as a step, a missing sample would look like rounding.
    uneven = int((np.abs(steps - mean) > digit / 2).sum())
    hidden = digit > MAX_DIGIT_SHARE * steps.min() and uneven < MIN_UNEVEN_STEPS
    if mean > 0 and digit > 0 and not hidden:
        smooth = _line(column, digit / 2)
        if smooth is not None:
            return smooth
    worst = int(np.abs(steps - mean).argmax())
    raise DataFileError(
        f"record {str(path)!r}: {name}: expected evenly spaced times, got steps of {steps.min():g} to "
        f"{steps.max():g}, of {steps[worst]:g} after {column[worst]:g} in row {worst + 1}{RATE_REMEDY}"
    )


def _last_digit(column: Floats) -> float:
    """Return one unit of the numbers' last decimal, 0 if they are not rounded.

    Programs that write a fixed number of digits write fewer decimals of larger numbers. Each power of ten is
    therefore examined alone, and the coarsest unit is returned.
    """
    size = np.floor(np.log10(np.maximum(np.abs(column), 1.0))).astype(int)
    coarsest = 0.0
    powers, counts = np.unique(size, return_counts=True)
    # A few numbers may be round by chance.
    for power in powers[counts >= min(MIN_NUMBERS_FOR_DIGIT, counts.max())]:
        values = column[size == power]
        for decimals in range(MAX_DECIMALS + 1):
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
        Times within `most` of the column's, None if no even times are. Their rate is the roundest whole
        number that fits, if one does.
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
        for round_to in ROUND_RATES_HZ:
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
