"""Files of force records as tables of columns with units; what the columns mean is up to `lab.read`.

Text tables (.csv, .txt, .tsv) have one line of names, with units as in `force_y [N]` or `Fz (kN)` or in a row
of their own below it, and rows of numbers between tabs, semicolons (then commas may be decimal), commas or
blanks; Parquet has the unit in a field's metadata; .mot and .sto are OpenSim's, in N and s; of a .c3d the
force plates are read, see `c3d.read_c3d`.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, MissingExtraError, parse_json
from hoof_env.lab.c3d import read_c3d

Columns = dict[str, NDArray[np.float64]]

TITLE = re.compile(r"\s*(?P<name>.*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])])?\s*")
WORD = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
"""A name between blanks, with its unit."""

ENTRY = re.compile(r"\s*(\w+)\s*=\s*(.*?)\s*")
COUNTS = {"nrows": "rows", "ncolumns": "columns"}
"""Entries of an OpenSim header that say how much follows."""


@dataclass
class Table:
    """Columns of shape (n,) and their units, as far as the file says, and the weight [N], if it does;
    `unread` says of columns that are no numbers what is wrong with them."""

    columns: Columns
    units: dict[str, str] = field(default_factory=dict)
    weight: float | None = None
    unread: dict[str, str] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Of all columns."""
        return [*self.columns, *self.unread]

    @property
    def rows(self) -> int:
        """Of the columns that are numbers."""
        return len(next(iter(self.columns.values()), ()))


Row = tuple[int, list[str]]
"""A line's number in its file, and its cells."""


def _read_text(path: Path) -> Table:
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    if not lines:
        return Table({})
    most = max("\t;,", key=lines[0].count)
    between = most if most in lines[0] else None  # blanks
    titles = WORD.findall(lines[0]) if between is None else next(csv.reader([lines[0]], delimiter=between))
    table = _table(path, titles, list(_rows(lines[1:], between, 2)), decimal_comma=between == ";")
    weights = table.columns.get("weight", np.empty(0))
    if weights.size and table.units.get("weight") == "N":  # as our files in body weights have it
        table.weight = float(weights[0])
    return table


def _read_opensim(path: Path) -> Table:
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    ends = [k for k, line in enumerate(lines) if line.strip().lower() == "endheader"]
    if not ends or len(lines) < ends[0] + 2:
        raise DataFileError(f"record {str(path)!r}: expected a line endheader and names below it")
    top = ends[0] + 1
    titles, rows = lines[top].split(), list(_rows(lines[top + 1 :], None, top + 2))
    said = {match[1].lower(): match[2] for line in lines[:top] if (match := ENTRY.fullmatch(line))}
    for (entry, what), found in zip(COUNTS.items(), (len(rows), len(titles)), strict=True):
        if said.get(entry, "").isdigit() and int(said[entry]) != found:
            raise DataFileError(
                f"record {str(path)!r}: expected {said[entry]} {what}, as its header says, found {found}: "
                "is the file cut off?"
            )
    table = _table(path, titles, rows)
    forces = {name: "N" for name in table.names if "force" in name and re.search(r"_(v[xyz]|[xyz])$", name)}
    weight = float(said["weight_n"]) if "weight_n" in said else None
    return Table(table.columns, forces | {"time": "s"}, weight, table.unread)


def _rows(lines: Iterable[str], between: str | None, first: int) -> Iterator[Row]:
    """Lines that are not blank; cells between blanks for None. `first` is the number of the first line."""
    cells = (line.split() for line in lines) if between is None else csv.reader(lines, delimiter=between)
    return ((k, row) for k, row in enumerate(cells, first) if any(cell.strip() for cell in row))


def _table(path: Path, titles: list[str], rows: list[Row], decimal_comma: bool = False) -> Table:
    """Columns with a name; every one for itself, so that one of words or with gaps harms nobody who does not
    ask for it. `DataFileError` of a row that lacks cells or has too many."""
    while titles and not titles[-1].strip():  # behind a separator at the end of the line
        titles = titles[:-1]
    parts = [match for title in titles if (match := TITLE.fullmatch(title))]
    names, width = [part["name"] for part in parts], len(parts)
    table = Table({}, {part["name"]: part["unit"] for part in parts if part["unit"]})
    if rows and not any(_is_number(cell) for cell in rows[0][1]):
        below = [cell.strip(" []()") for cell in rows.pop(0)[1]]
        table.units = {name: unit for name, unit in zip(names, below, strict=False) if unit} | table.units
    for k, cells in rows:
        if len(cells) < width or any(cell.strip() for cell in cells[width:]):
            raise DataFileError(
                f"record {str(path)!r}: line {k}: expected numbers, got {len(cells)} cells under "
                f"{width} names"
            )
    times = Counter(names)
    for at, name in enumerate(names):
        if not name:
            continue
        try:
            if times[name] > 1:
                raise ValueError(f"expected names that differ, got {name!r} {times[name]} times")
            table.columns[name] = _numbers(rows, at, decimal_comma)
        except ValueError as error:
            table.unread[name] = str(error)
    return table


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _numbers(rows: list[Row], at: int, decimal_comma: bool) -> NDArray[np.float64]:
    """The numbers of a column; `ValueError` names the first line that has none."""
    values = np.empty(len(rows))
    for n, (k, cells) in enumerate(rows):
        try:
            values[n] = float(cells[at].replace(",", ".") if decimal_comma else cells[at])
        except ValueError:
            raise ValueError(f"line {k}: expected numbers, got {cells[at]!r}") from None
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
    columns, units, about = read_c3d(path)
    forward = {name: name.removesuffix("_x") + "_force_x" for name in columns if name.endswith("_x")}
    upward = {name: name.removesuffix("_z") + "_force_y" for name in columns if name.endswith("_z")}
    own = {new: old for old, new in (forward | upward).items()}  # the laboratory's z is up
    columns |= {new: columns[old] for new, old in own.items()}
    return Table(columns, units | {new: units[old] for new, old in own.items()}, about.get("weight_n"))


READERS: dict[str, Callable[[Path], Table]] = {
    **dict.fromkeys((".csv", ".txt", ".tsv"), _read_text),
    **dict.fromkeys((".mot", ".sto"), _read_opensim),
    ".parquet": _read_parquet, ".c3d": _read_c3d,
}  # fmt: skip
