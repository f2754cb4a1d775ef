"""Values that are missing in columns of forces: blank cells, `NaN` and the like, and marks as -9999.

Programs write no force where a limb is in the air. Such values are taken as 0; under load a value is unknown,
and an option says what to take.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError
from hoof_env.lab.columns import Source
from hoof_env.lab.tables import Table

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

GAPS = ("auto", "zero", "line")
"""Ways to fill gaps: "auto" takes values in swing as 0 and refuses others, "zero" takes all as 0, "line" lays
a line between the samples around a gap."""

UNLOADED_SHARE = 0.05
"""Share of the highest force up to which a sample is one of swing."""

EDGE_SHARE = 0.4
"""Share of the highest force up to which a sample may be the first or the last of a stance, in files that
lack most of swing: a force rises by much from sample to sample."""

MARKS = tuple(10.0**digits - 1 for digits in range(3, 10))
"""Sizes of numbers that programs write for a missing value: 999, 9999 and so on."""

MIN_MARK_STEP = 0.5
"""Least step between a mark and a sample beside it, as a share of the mark; forces have smaller ones."""


def fill(path: Path, table: Table, sources: dict[str, list[Source]], how: str) -> list[str]:
    """Fill the gaps in the columns of forces of a table.

    Args:
        path: the file, for error messages.
        table: its columns, which are changed.
        sources: columns of each limb's force; a fore-aft force without any value is left out of them.
        how: one of `GAPS`.

    Returns:
        Notes on what was filled.

    Raises:
        DataFileError: a value under load is missing and `how` is "auto", or a vertical force has no value.
    """
    gaps = _Gaps(path, table, how)
    notes = []
    for limb, parts in sources.items():
        for part in parts:
            upward, forward = (
                [term.column for term in terms if term.column in table.columns]
                for terms in (part.upward, part.forward)
            )
            air = np.ones(table.rows, bool)
            for name in upward:
                air &= gaps.fill(name)
            if forward and all(np.isnan(table.columns[name]).all() for name in forward):
                notes.append(f"{', '.join(forward)}: no values, so {limb} has no fore-aft force")
                part.forward = []
            for name in forward if part.forward else ():
                gaps.fill(name, air)
            # Other axes serve for warnings alone.
            for name in set(part.axes.values()) & set(table.columns) - {*upward, *forward}:
                values = table.columns[name]
                gone = np.isnan(values) | np.isin(values, _marks_of(values))
                table.columns[name] = np.where(gone, 0.0, values)
    return notes + gaps.notes


class _Gaps:
    """Filler of the gaps of a table's columns.

    Args:
        path: the file, for error messages.
        table: its columns, which are changed.
        how: one of `GAPS`.
    """

    def __init__(self, path: Path, table: Table, how: str) -> None:
        self._path = path
        self._table = table
        self._how = how
        # Columns by what is said of them: most files have the same gaps in all.
        self._said: dict[str, list[str]] = {}

    @property
    def notes(self) -> list[str]:
        """Notes on what was filled."""
        return [f"{', '.join(dict.fromkeys(names))}: {text}" for text, names in self._said.items()]

    def fill(self, name: str, air: Mask | None = None) -> Mask:
        """Fill the gaps of a column and return the samples without load.

        Args:
            name: the column.
            air: samples in which the limb bears no load; None finds them in the column.
        """
        values = self._table.columns[name]
        if marks := _marks_of(values):
            marked = np.isin(values, marks)
            words = " or ".join(f"{mark:.9g}" for mark in marks)
            self._say(name, f"{int(marked.sum())} of {len(values)} values are {words}, taken as missing")
            self._table.columns[name] = values = np.where(marked, np.nan, values)
        gone = np.isnan(values)
        if gone.all():
            raise DataFileError(
                f"record {str(self._path)!r}: {name}: expected numbers, got none from {self._table.place(0)} "
                "on; name another column by --map-a or --map-b"
            )
        least = UNLOADED_SHARE * float(np.nanmax(np.abs(values)))
        if gone.any():
            swing = gone & (_swing(np.abs(values), gone) if air is None else air)
            self._table.columns[name] = values = self._filled(name, values, gone, swing)
        return np.asarray(np.abs(values) <= least)

    def _filled(self, name: str, values: Floats, gone: Mask, swing: Mask) -> Floats:
        """Return the values of a column with those that are `gone`, of which some are in `swing`."""
        first = self._table.place(int(np.argmax(gone)))
        many = f"{int(gone.sum())} of {len(values)} values are missing"
        if self._how == "line":
            at = np.arange(len(values))
            self._say(name, f"{many}, the first in {first}, and lie on lines between their neighbours")
            return np.where(gone, np.interp(at, at[~gone], values[~gone]), values)
        under_load = gone & ~swing
        if self._how == "auto" and under_load.any():
            place = self._table.place(int(np.argmax(under_load)))
            raise DataFileError(
                f"record {str(self._path)!r}: {name}: expected finite numbers, got nan in {place}, under "
                f"load ({int(under_load.sum())} such values); --gaps-a=line or --gaps-b=line lays lines over "
                "gaps, zero takes them as 0"
            )
        where = " in swing" if self._how == "auto" else ""
        self._say(
            name,
            f"{many}{where}, the first in {first}, and are taken as 0; --gaps-a=line or --gaps-b=line lays "
            "lines over them",
        )
        return np.where(gone, 0.0, values)

    def _say(self, name: str, text: str) -> None:
        self._said.setdefault(text, []).append(name)


def _marks_of(values: Floats) -> list[float]:
    """Return the numbers in a column, shape (n,), that stand for missing values: sizes of `MARKS`, far from
    the samples beside them wherever they occur."""
    found = []
    for mark in {float(value) for value in values[np.isin(np.abs(values), MARKS)]}:
        marked = values == mark
        steps = np.abs(np.diff(values))[marked[1:] != marked[:-1]]
        if not marked.all() and not (steps < MIN_MARK_STEP * abs(mark)).any():
            found.append(mark)
    return sorted(found)


def _swing(sizes: Floats, gone: Mask) -> Mask:
    """Return the missing samples that lie in swing: beside such a gap there is no load, or the first or last
    sample of a stance.

    Args:
        sizes: sizes of a vertical force, NaN where missing, shape (n,).
        gone: missing samples, shape (n,).
    """
    shares = sizes / (np.nanmax(sizes) or 1.0)
    most = EDGE_SHARE if (shares <= UNLOADED_SHARE).sum() < gone.sum() else UNLOADED_SHARE
    swing = np.zeros_like(gone)
    edges = np.flatnonzero(np.diff(gone.astype(int), prepend=0, append=0))
    for first, last in edges.reshape(-1, 2).tolist():
        beside = [shares[k] for k in (first - 1, last) if 0 <= k < len(shares)]
        swing[first:last] = max(beside) <= most
    return swing
