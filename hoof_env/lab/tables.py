"""Files of force records as tables of columns with units; what the columns mean is up to `lab.read`.

Text tables (.csv, .txt, .tsv) have names, with units as in `force_y [N]` or `Fz (kN)` or in a row of their
own below them, and rows of numbers between tabs, semicolons, commas or blanks, see `lab.text`; commas
may be decimal, unless they are between the cells. Parquet has the unit in the metadata of a field; .mot and
.sto are those of OpenSim, in N and s; of a .c3d the force plates are read, see `lab.c3d_read`.
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
from hoof_env.lab.text import TITLE, Row, Text, cells_of, is_number, lines_of, number, parse

Columns = dict[str, NDArray[np.float64]]

ENTRY = re.compile(r"\s*(\w+)\s*=\s*(.*?)\s*")
COUNTS = {"nrows": "rows", "ncolumns": "columns"}
"""Entries of an OpenSim header that say how much follows."""


@dataclass
class Table:
    """Columns of a file.

    Attributes:
        columns: arrays of shape (n,) by name. A name that stands several times has "#1" and so on behind it,
            and one that is empty is "#3" in the third column.
        units: by name, as far as the file says.
        weight: of the animal [N], if the file says it.
        unread: by name, of columns that are no numbers, what is wrong with them.
        order: names by column.
        repeated: what to say to one who asks for a name that stands several times, by that name.
        up: the axis of its forces that points upward; "-" before it is its other end.
        plates: of a c3d, names of limbs or plates, whose forces are `NAME_x` and so on.
        line: the number of the line of names, 0 if there is none.
        notes: what is remarkable about the file.
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
        """Of all columns."""
        return self.order or [*self.columns, *self.unread]

    @property
    def rows(self) -> int:
        """Of the columns that are numbers."""
        return len(next(iter(self.columns.values()), ()))


def _read_text(path: Path) -> Table:
    table = _table(path, parse(lines_of(path)))
    weights = table.columns.get("weight", np.empty(0))
    if weights.size and table.units.get("weight") == "N":  # as our files in body weights have it
        table.weight = float(weights[0])
    return table


def _read_opensim(path: Path) -> Table:
    lines = lines_of(path)
    top = next((k + 1 for k, line in enumerate(lines) if line.strip().lower() == "endheader"), len(lines))
    below = [k for k in range(top, len(lines)) if lines[k].strip()]
    if not below:
        raise DataFileError(f"record {str(path)!r}: expected a line endheader and names below it")
    titles = lines[below[0]].split()
    rows = [(k + 1, cells_of(lines[k], None)) for k in below[1:]]
    said = {match[1].lower(): match[2] for line in lines[:top] if (match := ENTRY.fullmatch(line))}
    for (entry, what), found in zip(COUNTS.items(), (len(rows), len(titles)), strict=True):
        if said.get(entry, "").isdigit() and int(said[entry]) != found:
            raise DataFileError(
                f"record {str(path)!r}: expected {said[entry]} {what}, as its header says, found {found}: "
                "is the file cut off?"
            )
    table = _table(path, Text(titles, rows, line=below[0] + 1, decimal_comma=True))
    for name in table.names:
        if "force" in name.lower() and re.search(r"(_v[xyz]|_[xyz])(#\d+)?$", name):
            table.units[name] = "N"
    table.units["time"] = "s"
    table.weight = float(said["weight_n"]) if "weight_n" in said else None
    return table


def _table(path: Path, text: Text) -> Table:
    """Columns, every one for itself, so that one of words or with gaps harms nobody who does not ask for it.
    `DataFileError` of a row that lacks cells or has too many."""
    titles = text.titles
    rows = text.rows
    while titles and not titles[-1].strip():  # behind a separator at the end of the line
        titles = titles[:-1]
    parts = [match for title in titles if (match := TITLE.fullmatch(title))]
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
    units = {
        key: unit for key, part, under in zip(keys, parts, below, strict=False)
        if (unit := part["unit"] or under)
    }  # fmt: skip
    table = Table({}, units, order=keys, repeated=repeated, line=text.line, notes=text.notes)
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
    """A key for each column, and what to say of names that do not tell columns apart."""
    times = Counter(names)
    seen = Counter[str]()
    keys = []
    repeated = {}
    for at, name in enumerate(names):
        seen[name] += 1
        keys.append(f"#{at + 1}" if not name else f"{name}#{seen[name]}" if times[name] > 1 else name)
    for name in (name for name, count in times.items() if name and count > 1):
        choices = ", ".join(
            key + (f" ({text.groups[at]})" if at < len(text.groups) and text.groups[at] else "")
            for at, key in enumerate(keys) if names[at] == name
        )  # fmt: skip
        where = f"names in line {text.line}: " if text.line else ""
        repeated[name] = (
            f"{where}expected names that differ, got {name!r} {times[name]} times; choose {choices}"
        )
    return keys, repeated


def _numbers(rows: list[Row], at: int, decimal_comma: bool, points: bool) -> NDArray[np.float64]:
    """The numbers of a column; `ValueError` names the first line that has none, or a comma in a table that
    has decimal points."""
    values = np.empty(len(rows))
    for n, (k, cells) in enumerate(rows):
        try:
            values[n] = number(cells[at], decimal_comma and not points)
        except ValueError:
            beside = " beside numbers with decimal points" if points and "," in cells[at] else ""
            raise ValueError(f"line {k}: expected numbers, got {cells[at]!r}{beside}") from None
    return values


def _read_parquet(path: Path) -> Table:
    try:
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError('Parquet needs pyarrow: pip install "hoof-env[export]"') from None
    found = parquet.read_table(path)
    units = {one.name: (one.metadata or {}).get(b"unit", b"").decode() for one in found.schema}
    about = parse_json((found.schema.metadata or {}).get(b"hoof_env", b"{}"))
    table = Table({}, units, about.get("weight_n"))
    for name in found.column_names:
        try:
            table.columns[name] = np.asarray(found[name].to_numpy(), float)
        except (TypeError, ValueError):
            table.unread[name] = f"{name}: expected numbers, got {found[name].type}"
    return table


def _read_c3d(path: Path) -> Table:
    """Columns `NAME_x` and so on of each plate along the laboratory's axes, and the time."""
    found = read_plates(path)
    columns = {
        f"{limb}_{axis}": force[:, k] for limb, force in found.forces.items() for k, axis in enumerate("xyz")
    }
    units = {f"{limb}_{axis}": unit for limb, unit in found.units.items() for axis in "xyz"}
    return Table(
        columns | {"time": found.time}, units | {"time": "s"}, found.weight, up=found.up,
        plates=[*found.forces], notes=found.notes,
    )  # fmt: skip


READERS: dict[str, Callable[[Path], Table]] = {
    **dict.fromkeys((".csv", ".txt", ".tsv"), _read_text),
    **dict.fromkeys((".mot", ".sto"), _read_opensim),
    ".parquet": _read_parquet, ".c3d": _read_c3d,
}  # fmt: skip
