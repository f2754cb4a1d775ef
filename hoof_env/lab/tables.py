"""Readers of force records, which give tables of columns with units; `lab.columns` has their meaning.

Text tables (.csv, .txt, .tsv) have names, with units as in `force_y [N]` or `Fz (kN)` or in a row of their
own below them, and rows of numbers separated by tabs, semicolons, commas or blanks, see `lab.text`. A comma
may be a decimal sign, unless it separates the cells. Parquet has the unit in the metadata of a field. Files
.mot and .sto are OpenSim's, in N and s. Of a .c3d the force plates are read, see `lab.c3d_read`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, MissingExtraError, parse_json
from hoof_env.lab.c3d_read import read_plates
from hoof_env.lab.text import TITLE_PATTERN, Row, Text, cells_of, is_number, lines_of, number, parse

Columns = dict[str, NDArray[np.float64]]

# An entry of an OpenSim header, as nRows=1001.
ENTRY = re.compile(r"\s*(\w+)\s*=\s*(.*?)\s*")
COUNTS = {"nrows": "rows", "ncolumns": "columns"}
"""Entries of an OpenSim header with the number of rows and columns that follow."""


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
        notes: messages about parts of the file that are not read or not used.
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
    notes: list[str] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        """Names of all columns, those that cannot be read included."""
        return self.order or [*self.columns, *self.unread]

    @property
    def rows(self) -> int:
        """Number of rows of the columns that are numbers."""
        return len(next(iter(self.columns.values()), ()))


def _read_text(path: Path) -> Table:
    """Read a .csv, .txt or .tsv."""
    table = _table(path, parse(lines_of(path)))
    # Our files in body weights have the weight in a column, as they have no other place for it.
    weights = table.columns.get("weight", np.empty(0))
    if weights.size and table.units.get("weight") == "N":
        table.weight = float(weights[0])
    return table


def _read_opensim(path: Path) -> Table:
    """Read a .mot or .sto; raise `DataFileError` unless its rows and columns are as many as stated."""
    lines = lines_of(path)
    top = next((k + 1 for k, line in enumerate(lines) if line.strip().lower() == "endheader"), len(lines))
    below = [k for k in range(top, len(lines)) if lines[k].strip()]
    if not below:
        raise DataFileError(f"record {str(path)!r}: expected a line endheader and names below it")
    titles = lines[below[0]].split()
    rows = [(k + 1, cells_of(lines[k], None)) for k in below[1:]]
    stated = {match[1].lower(): match[2] for line in lines[:top] if (match := ENTRY.fullmatch(line))}
    for (entry, what), count in zip(COUNTS.items(), (len(rows), len(titles)), strict=True):
        if stated.get(entry, "").isdigit() and int(stated[entry]) != count:
            raise DataFileError(
                f"record {str(path)!r}: expected {stated[entry]} {what}, as its header says, found {count}: "
                "is the file cut off?"
            )
    table = _table(path, Text(titles, rows, line=below[0] + 1, decimal_comma=True))
    # OpenSim's files state no units; columns of forces are recognised by their names.
    for name in table.names:
        if "force" in name.lower() and re.search(r"(_v[xyz]|_[xyz])(#\d+)?$", name):
            table.units[name] = "N"
    table.units["time"] = "s"
    table.weight = float(stated["weight_n"]) if "weight_n" in stated else None
    return table


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
    width = len(parts) or (len(rows[0][1]) if rows else 0)
    names = [part["name"] for part in parts] or [""] * width
    for k, cells in rows:
        if len(cells) < width or any(cell.strip() for cell in cells[width:]):
            raise DataFileError(
                f"record {str(path)!r}: line {k}: expected numbers, got {len(cells)} cells under {width} "
                "names" + (f" in line {text.line}" if text.line else "")
            )
    keys, repeated = _keys(names, text)
    below = [*text.units[:width], *[""] * (width - len(text.units))]
    units = {}
    for key, part, under in zip(keys, parts, below, strict=False):
        # A unit behind the name goes before one in the row below.
        if unit := part["unit"] or under:
            units[key] = unit
    table = Table({}, units, order=keys, repeated=repeated, line=text.line, notes=text.notes)
    # A decimal point anywhere in the table shows that its commas are not decimal signs.
    points = text.decimal_comma and any(
        "." in cell and is_number(cell, False) for _, cells in rows for cell in cells[:width]
    )
    for at, key in enumerate(keys):
        try:
            table.columns[key] = _numbers(rows, at, text.decimal_comma, points)
        except ValueError as error:
            table.unread[key] = str(error)
    return table


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
    """Read the numbers of a column.

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
    values = np.empty(len(rows))
    for n, (k, cells) in enumerate(rows):
        try:
            values[n] = number(cells[at], decimal_comma and not points)
        except ValueError:
            mixed = " beside numbers with decimal points" if points and "," in cells[at] else ""
            raise ValueError(f"line {k}: expected numbers, got {cells[at]!r}{mixed}") from None
    return values


def _read_parquet(path: Path) -> Table:
    """Read a .parquet; raise `MissingExtraError` if pyarrow is not installed."""
    try:
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError('Parquet needs pyarrow: pip install "hoof-env[export]"') from None
    content = parquet.read_table(path)
    units = {entry.name: (entry.metadata or {}).get(b"unit", b"").decode() for entry in content.schema}
    about = parse_json((content.schema.metadata or {}).get(b"hoof_env", b"{}"))
    table = Table({}, units, about.get("weight_n"))
    for name in content.column_names:
        try:
            table.columns[name] = np.asarray(content[name].to_numpy(), float)
        except (TypeError, ValueError):
            table.unread[name] = f"{name}: expected numbers, got {content[name].type}"
    return table


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
    return Table(
        columns,
        units,
        plates.weight,
        up=plates.up,
        plates=[*plates.forces],
        notes=plates.notes,
    )


READERS: dict[str, Callable[[Path], Table]] = {
    **dict.fromkeys((".csv", ".txt", ".tsv"), _read_text),
    **dict.fromkeys((".mot", ".sto"), _read_opensim),
    ".parquet": _read_parquet,
    ".c3d": _read_c3d,
}
"""Readers by suffix."""
