"""Readers of force records, which give tables of columns with units; `lab.columns` has their meaning.

Text tables (.csv, .txt, .tsv) have names, with units as in `force_y [N]` or `Fz (kN)` or in a row of their
own below them, and rows of numbers separated by tabs, semicolons, commas or blanks, see `lab.text`. A comma
may be a decimal sign, unless it separates the cells. Parquet has the unit in the metadata of a field. Files
.mot and .sto are OpenSim's, in N and s. Of a .c3d the force plates are read, see `lab.c3d_read`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, MissingExtraError, parse_json
from hoof_env.lab.c3d_read import read_plates
from hoof_env.lab.clock import moment, seconds_of
from hoof_env.lab.opensim import STATED
from hoof_env.lab.text import (
    TITLE_PATTERN,
    Row,
    Text,
    cells_of,
    is_missing,
    is_number,
    lines_of,
    number,
    parse,
    width_of,
)

THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
"""Pattern of a number whose comma may be a decimal sign or one between thousands."""

WHOLE = re.compile(r"[+-]?[1-9]\d{0,2}")
"""Pattern of a whole number below 1000."""

OWN_COLUMNS = ("toe_normal", "cop_x", "crank_angle", "command_crank_speed")
"""Ends of names of columns that together only the tables of this package have."""

Columns = dict[str, NDArray[np.float64]]

# An entry of an OpenSim header, as nRows=1001, or of SIMM, as datarows 1001.
ENTRY = re.compile(r"\s*(\w+)(?:\s*=\s*|\s+)(.*?)\s*")
COUNTS = {"nRows": "rows", "nColumns": "columns", "datarows": "rows", "datacolumns": "columns"}
"""Entries of a header with the number of rows and columns that follow, of OpenSim and of SIMM."""


@dataclass
class Table:
    """Columns of a file.

    Attributes:
        columns: arrays of shape (n,) by name. A name that occurs several times is followed by "#1" and so on,
            and an empty name is "#3" in the third column.
        units: units by name, as far as the file states them.
        weight: weight of the animal [N], or None if the file does not state it.
        unread: reason why a column cannot be read as numbers, by name.
        order: names in the order of the columns, if the file has an order.
        repeated: error message for a name that occurs several times, by that name.
        up: axis of the forces that points upward, as "y" or "-y".
        plates: names of limbs or plates of a c3d; their forces are the columns `NAME_x` and so on.
        line: number of the line of names, 0 if there is none.
        lines: numbers of the lines of the rows, empty in files without lines.
        notes: messages about parts of the file that are not read or not used.
        own: True if this package wrote the file.
    """

    columns: Columns
    units: dict[str, str] = field(default_factory=dict)
    weight: float | None = None
    unread: dict[str, str] = field(default_factory=dict)
    order: list[str] = field(default_factory=list)
    repeated: dict[str, str] = field(default_factory=dict)
    up: str = "y"
    plates: list[str] = field(default_factory=list)
    line: int = 0
    lines: list[int] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    own: bool = False

    @property
    def names(self) -> list[str]:
        """Names of all columns, including columns that cannot be read."""
        return self.order or [*self.columns, *self.unread]

    def place(self, row: int) -> str:
        """Return the place of a row, from 0, as text: its line, or its number in files without lines."""
        return f"line {self.lines[row]}" if self.lines else f"row {row + 1}"

    def drop_empty(self) -> None:
        """Leave out rows without any value."""
        empty = np.ones(self.rows, bool)
        for values in self.columns.values():
            empty &= np.isnan(values)
        if empty.any() and self.lines and not self.unread:
            self.columns = {name: values[~empty] for name, values in self.columns.items()}
            self.lines = [line for line, gone in zip(self.lines, empty, strict=True) if not gone]

    @property
    def rows(self) -> int:
        """Number of rows of the columns that are numbers."""
        return len(next(iter(self.columns.values()), ()))


def _read_text(path: Path) -> Table:
    """Read a .csv, .txt or .tsv."""
    table = _table(path, parse(lines_of(path)))
    table.own = _are_own(table.order)
    # Our files in body weights have the weight in a column, as they have no other place for it.
    weights = table.columns.get("weight", np.empty(0))
    if weights.size and table.units.get("weight") == "N":
        _set_weight(table, "column weight", weights[0])
    return table


def _are_own(names: Sequence[str]) -> bool:
    """Return True if these are names of columns of a table of this package."""
    return all(any(name.endswith(end) for name in names) for end in OWN_COLUMNS)


def _set_weight(table: Table, name: str, value: Any) -> None:
    """Set the weight of a table, or note that what the file states under a name is none."""
    try:
        weight = float(value)
    except (TypeError, ValueError):
        weight = np.nan
    if np.isfinite(weight) and weight > 0:
        table.weight = weight
    else:
        table.notes.append(
            f"{name}: expected a weight in N, got {value!s:.40}; --mass-a or --mass-b gives the mass"
        )


def _read_opensim(path: Path) -> Table:
    """Read a .mot or .sto; notes name counts in its header that are stale."""
    lines = lines_of(path)
    top = next((k + 1 for k, line in enumerate(lines) if line.strip().lower() == "endheader"), len(lines))
    below = [k for k in range(top, len(lines)) if lines[k].strip()]
    if not below:
        raise DataFileError(f"record {str(path)!r}: expected a line endheader and names below it")
    first = lines[below[min(1, len(below) - 1)]]
    between = _between(lines[below[0]], first)
    titles = cells_of(lines[below[0]], between)
    if all(is_number(title) for title in titles):  # no names
        titles = []
    rows = [(k + 1, cells_of(lines[k], between)) for k in below[1 if titles else 0 :]]
    stated = {match[1].lower(): match[2] for line in lines[:top] if (match := ENTRY.fullmatch(line))}
    counts = {"rows": len(rows), "columns": len(titles) or len(rows[0][1])}
    notes = []
    for entry, what in COUNTS.items():
        count = stated.get(entry.lower(), "")
        if re.fullmatch(r"-?\d+", count) and int(count) != counts[what]:
            remedy = "; if it is cut off, copy it again" if int(count) > counts[what] else ""
            notes.append(
                f"its header says {entry}={count}, the file has {counts[what]} {what}, which are read{remedy}"
            )
    line = below[0] + 1 if titles else 0
    table = _table(path, Text(titles, rows, line=line, decimal_comma=between != ",", notes=notes))
    # OpenSim's files state no units; columns of forces are recognised by their names.
    for name in table.names:
        if "force" in name.lower() and re.search(r"(_v[xyz]|_[xyz])(#\d+)?$", name):
            table.units[name] = "N"
    table.units["time"] = "s"
    if "weight_n" in stated:
        _set_weight(table, "weight_n", stated["weight_n"])
    table.own = all(name in stated for name in STATED)
    return table


def _between(names: str, row: str) -> str | None:
    """Return the separator of OpenSim's names: tabs, beside which names may have blanks, or blanks."""
    for between in ("\t", None, ","):
        width = len(cells_of(names.rstrip(), between))
        cells = cells_of(row, between)
        if 1 < width <= len(cells) and not any(cell.strip() for cell in cells[width:]):
            return between
    return None


def _table(path: Path, text: Text) -> Table:
    """Convert cells to a table of numbers.

    Each column is parsed for itself, so that a column of words or with gaps does not prevent reading the
    others. A row with too few or too many cells raises `DataFileError`.
    """
    titles = text.titles
    rows = text.rows
    # A separator at the end of the line leaves an empty name.
    while titles and not titles[-1].strip():
        titles = titles[:-1]
    parts = [match for title in titles if (match := TITLE_PATTERN.fullmatch(title))]
    width = len(parts) or (width_of(rows[0][1]) if rows else 0)
    names = [part["name"] for part in parts] or [""] * width
    for k, cells in rows:
        if len(cells) < width or any(cell.strip() for cell in cells[width:]):
            under = f"{width} names in line {text.line}" if text.line else f"{width} in line {rows[0][0]}"
            remedy = _remedy(text, rows, k, len(cells) - width)
            raise DataFileError(
                f"record {str(path)!r}: line {k}: expected numbers, got {len(cells)} cells under {under}"
                f"{remedy}"
            )
    keys, repeated = _keys(names, text)
    below = [*text.units[:width], *[""] * (width - len(text.units))]
    units = {}
    for key, part, under in zip(keys, parts, below, strict=False):
        # A unit behind the name goes before one in the row below.
        if unit := part["unit"] or under:
            units[key] = unit
    lines = [k for k, _ in rows]
    table = Table({}, units, order=keys, repeated=repeated, line=text.line, lines=lines, notes=text.notes)
    # A decimal point anywhere in the table shows that its commas are not decimal signs.
    points = text.decimal_comma and any(
        "." in cell and is_number(cell, False) for _, cells in rows for cell in cells[:width]
    )
    for at, key in enumerate(keys):
        try:
            table.columns[key] = _numbers(rows, at, text.decimal_comma, points)
        except ValueError as error:
            if moment(rows[0][1][at]) is None:
                table.unread[key] = str(error)
            else:
                _add_moments(table, key, rows, at)
    return table


def _remedy(text: Text, rows: list[Row], line: int, more: int) -> str:
    """Return what may help against a row in a line with `more` cells than names, for messages."""
    if line == rows[-1][0] and len(rows) > 1:
        return "; is the file cut off there? Delete that line to read the others"
    if more < 0 and line == rows[0][0]:
        return "; names with blanks in them need tabs between the columns"
    return ""


def _add_moments(table: Table, key: str, rows: list[Row], at: int) -> None:
    """Add a column of durations or times of day to a table, in s."""
    try:
        times, day = seconds_of([cells[at] for _, cells in rows])
    except ValueError as error:
        k, cells = rows[int(error.args[0])]
        table.unread[key] = f"line {k}: expected a time as {rows[0][1][at].strip()!r}, got {cells[at]!r}"
        return
    table.columns[key] = np.array(times)
    table.units[key] = "s"
    if day is not None:
        table.notes.append(f"{key}: times are counted from midnight of {day.isoformat()}")


def _keys(names: list[str], text: Text) -> tuple[list[str], dict[str, str]]:
    """Return a key for each column, and an error message for each name that occurs several times."""
    times = Counter(names)
    seen = Counter[str]()
    keys = []
    repeated = {}
    for at, name in enumerate(names):
        seen[name] += 1
        if not name:
            keys.append(f"#{at + 1}")
        elif times[name] > 1:
            keys.append(f"{name}#{seen[name]}")
        else:
            keys.append(name)
    for name in (name for name, count in times.items() if name and count > 1):
        shown = []
        for at, key in enumerate(keys):
            if names[at] == name:
                group = text.groups[at] if at < len(text.groups) else ""
                shown.append(f"{key} ({group})" if group else key)
        choices = ", ".join(shown)
        where = f"names in line {text.line}: " if text.line else ""
        repeated[name] = (
            f"{where}expected names that differ, got {name!r} {times[name]} times; choose {choices}"
        )
    return keys, repeated


def _numbers(rows: list[Row], at: int, decimal_comma: bool, points: bool) -> NDArray[np.float64]:
    """Read the numbers of a column, NaN where one is missing.

    Args:
        rows: rows of cells.
        at: number of the column.
        decimal_comma: True if a comma may be a decimal sign.
        points: True if the table has decimal points, so that a comma is not a decimal sign after all.

    Returns:
        The numbers, shape (n,).

    Raises:
        ValueError: a cell is not a number; the message names its line.
    """
    if decimal_comma and not points:
        _check_commas(rows, at)
    values = np.empty(len(rows))
    for n, (k, cells) in enumerate(rows):
        try:
            values[n] = number(cells[at], decimal_comma and not points)
        except ValueError:
            if is_missing(cells[at]):
                values[n] = np.nan
                continue
            mixed = " beside numbers with decimal points" if points and "," in cells[at] else ""
            raise ValueError(f"line {k}: expected numbers, got {cells[at]!r}{mixed}") from None
    return values


def _check_commas(rows: list[Row], at: int) -> None:
    """Raise `ValueError` if the commas of a column seem to lie between thousands: 980 beside 1,020. Programs
    with a decimal comma write 980,000, or 1,02."""
    commas = [(k, cells[at].strip()) for k, cells in rows if "," in cells[at]]
    whole = any(WHOLE.fullmatch(cells[at].strip()) for _, cells in rows)
    if commas and whole and all(THOUSANDS.fullmatch(cell) for _, cell in commas):
        k, cell = commas[0]
        raise ValueError(
            f"line {k}: expected numbers, got {cell!r} beside whole numbers without a comma; if it lies"
            " between thousands, write the numbers without it"
        )


def _read_parquet(path: Path) -> Table:
    """Read a .parquet; raise `MissingExtraError` if pyarrow is not installed."""
    try:
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError('Parquet needs pyarrow: pip install "hoof-env[export]"') from None
    content = parquet.read_table(path)
    units = {entry.name: (entry.metadata or {}).get(b"unit", b"").decode() for entry in content.schema}
    about = parse_json((content.schema.metadata or {}).get(b"hoof_env", b"{}"))
    # Other programs that save it again may drop its metadata.
    table = Table({}, units, own="hoof_env" in about or _are_own(content.column_names))
    if "weight_n" in about:
        _set_weight(table, "weight_n", about["weight_n"])
    for name in content.column_names:
        try:
            values = content[name].to_numpy()
            if values.dtype.kind in "mM" or (len(values) and isinstance(values[0], time)):
                _add_clock(table, name, values)
            else:
                table.columns[name] = np.asarray(values, float)
        except (TypeError, ValueError):
            table.unread[name] = f"{name}: expected numbers, got {content[name].type}"
    return table


def _add_clock(table: Table, name: str, values: NDArray[Any]) -> None:
    """Add a column of durations, times of day or dates to a table, in s."""
    second = np.timedelta64(1, "s")
    if values.dtype.kind == "M":
        day = values[0].astype("datetime64[D]")
        table.columns[name] = (values - day) / second
        table.notes.append(f"{name}: times are counted from midnight of {day}")
    else:
        durations = values.dtype.kind == "m"
        table.columns[name] = values / second if durations else np.array(seconds_of([*map(str, values)])[0])
    table.units[name] = "s"


def _read_c3d(path: Path) -> Table:
    """Read the plates of a .c3d: columns `NAME_x` and so on along the laboratory's axes, and the time."""
    plates = read_plates(path)
    columns = {}
    units = {}
    for limb, force in plates.forces.items():
        for k, axis in enumerate("xyz"):
            columns[f"{limb}_{axis}"] = force[:, k]
            units[f"{limb}_{axis}"] = plates.units[limb]
    if plates.time is not None:
        columns["time"] = plates.time
        units["time"] = "s"
    names = [*plates.forces]
    table = Table(columns, units, up=plates.up, plates=names, notes=plates.notes, own=plates.own)
    if plates.weight is not None:
        _set_weight(table, "HOOF_ENV:WEIGHT", plates.weight)
    return table


READERS: dict[str, Callable[[Path], Table]] = {
    **dict.fromkeys((".csv", ".txt", ".tsv"), _read_text),
    **dict.fromkeys((".mot", ".sto"), _read_opensim),
    ".parquet": _read_parquet,
    ".c3d": _read_c3d,
}
"""Readers by suffix."""
