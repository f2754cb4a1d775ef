"""How a text file of numbers is laid out: in which encoding, what separates cells, where names and units are.

Above the numbers there may be anything, as BioWare, Vicon Nexus and other programs write it. The names are in
the last line above the numbers, or in the one before if the last has units alone. A table ends where a blank
line and then words follow: what comes then is another table.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

from hoof_env.errors import DataFileError

TITLE = re.compile(r"\s*(?P<name>.*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])])?\s*")
WORD = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
"""A name between blanks, with its unit."""

COMMENT = re.compile(r"\s*(#|%|//)+\s*")
"""What names may have before them, as NumPy writes it."""

UNIT_WORDS = frozenset(
    word
    for line in (
        "s sec secs second seconds ms msec millisecond milliseconds us min h hz",
        "n nt newton newtons kn kilonewton kilonewtons lb lbs lbf kgf kp bw %bw xbw n/kg n/bw % kg g",
        "nm n.m n*m n-m n·m nmm n.mm n*mm n-mm n·mm knm nm/kg n.m/kg m mm cm in ft deg ° rad v mv volt volts",
        "m/s mm/s m/s^2 m/s2 m/s² mm/s^2 mm/s² deg/s rad/s w w/kg a.u. au - none count counts bits",
    )
    for word in line.split()
)
"""What a row of units below the names consists of."""

SEPARATORS = ("\t", ";", ",", None)
"""Between cells; None are blanks."""

SURE = 10
"""Rows of numbers below each other that are the table, or as many as there are in a shorter file."""

Row = tuple[int, list[str]]
"""A line's number in its file, and its cells."""


@dataclass
class Text:
    """A table of a text file as cells.

    Attributes:
        titles: names by column, with units behind some.
        units: by column, from a row of their own; empty if there is none.
        groups: what stands above the names by column, such as the plate they belong to; may be empty.
        line: the number of the line of names, 0 if there is none.
        rows: of numbers.
        decimal_comma: whether a comma may be a decimal sign.
        notes: what is not read.
    """

    titles: list[str]
    rows: list[Row]
    units: list[str] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    line: int = 0
    decimal_comma: bool = False
    notes: list[str] = field(default_factory=list)


def lines_of(path: Path) -> list[str]:
    """The lines of a text file in UTF-8, UTF-16 with its mark, or else the code page of Windows, in which
    every byte is some sign. `DataFileError` of bytes 0, which no text has."""
    raw = path.read_bytes()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return raw.decode("utf-16", errors="replace").splitlines()
    if b"\0" in raw:
        raise DataFileError(
            f"record {str(path)!r}: expected text, found bytes 0 in line "
            f"{raw[: raw.index(0)].count(10) + 1}; save it as UTF-8"
        )
    try:
        return raw.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace").splitlines()


def number(cell: str, decimal_comma: bool = True) -> float:
    """The number in a cell; `ValueError` if it is none."""
    return float(cell.replace(",", ".") if decimal_comma else cell)


def is_number(cell: str, decimal_comma: bool = True) -> bool:
    """Whether a cell is a number."""
    try:
        number(cell, decimal_comma)
    except ValueError:
        return False
    return True


def cells_of(line: str, between: str | None) -> list[str]:
    """The cells of a line."""
    return line.split() if between is None else next(csv.reader([line], delimiter=between), [])


def _separator(line: str, least: int) -> tuple[bool, str | None]:
    """Whether most cells of a line are numbers, the first of them too, `least` cells or more; and what is
    between its cells."""
    best = 0.0
    found = None
    for between in SEPARATORS:
        if between is not None and between not in line:
            continue
        cells = [cell for cell in cells_of(line, between) if cell.strip()]
        known = [is_number(cell, between != ",") for cell in cells]
        share = sum(known) / len(known) if known and known[0] and len(known) >= least else 0.0
        if share > best:
            best = share
            found = between
    return best > 0.5, found


def _first_row(lines: list[str]) -> tuple[int, str | None]:
    """Where the numbers begin, and what is between them; (the number of lines, None) if there are none."""
    for least in (2, 1):  # cells in a row
        runs: list[tuple[int, int, str | None]] = []  # how long, from where, separated by what
        for k, line in enumerate(lines):
            if not line.strip():
                continue
            numeric, between = _separator(line, least)
            if not numeric:
                runs.append((0, k + 1, None))
                continue
            length, begin, first = runs[-1] if runs else (0, 0, None)
            runs[-1:] = [(length + 1, begin if length else k, first if length else between)]
            if length + 1 == SURE:
                return runs[-1][1:]
        if runs and max(runs)[0]:
            most = max(length for length, _, _ in runs)
            return next(run[1:] for run in runs if run[0] == most)
    return len(lines), None


def parse(lines: list[str]) -> Text:
    """The table in the lines of a file."""
    begin, between = _first_row(lines)
    above = [k for k in range(begin) if lines[k].strip()]
    if begin == len(lines) and not above:
        return Text([], [])
    titles = []
    units = []
    groups = []
    line = 0
    if above:
        split = _between_names(lines[above[-1]], between, lines[begin] if begin < len(lines) else "")
        rows = [_titles(lines[k], split) for k in above[-3:]]
        if len(rows) > 1 and _are_units(rows[-1], rows[-2]):
            units = [cell.strip(" []()") for cell in rows.pop()]
            above.pop()
        titles = rows[-1]
        line = above[-1] + 1
        if len(rows) > 1 and _are_groups(rows[-2], titles):
            groups = _filled(rows[-2])
    table, after = _rows(lines, begin, between)
    notes = [f"line {after}: another table begins there, which is not read"] if after else []
    return Text(titles, table, units, groups, line, between != ",", notes)


def _between_names(line: str, between: str | None, row: str) -> str | None:
    """What separates names: what separates the cells of a row, unless that is not among the names; then what
    makes as many names as there are cells, or else what there is most of."""
    if between is not None and between in line:
        return between
    width = len(cells_of(row, between)) if row else 0
    fits = [one for one in (between, *SEPARATORS) if len(_titles(line, one)) == width]
    if fits:
        return fits[0]
    most = max("\t;,", key=line.count)
    return most if not row and most in line else None


def _titles(line: str, between: str | None) -> list[str]:
    bare = COMMENT.sub("", line, count=1) if COMMENT.match(line) else line
    return WORD.findall(bare) if between is None else cells_of(bare, between)


def _are_units(cells: list[str], names: list[str]) -> bool:
    """Whether a row is one of units below names."""
    words = [cell.strip() for cell in cells if cell.strip()]
    if not words or len(words) > len(names):
        return False
    if all(word.strip(" []()").casefold() in UNIT_WORDS or word[0] in "[(" for word in words):
        return True
    return len(cells) == len(names) == len(set(names)) > len(set(words))


def _are_groups(cells: list[str], names: list[str]) -> bool:
    """Whether a row above the names says what several of them belong to."""
    said = [cell for cell in cells if cell.strip()]
    return 1 <= len(said) < len(names) and len(cells) > len(said) and len(cells) >= len(names) - 2


def _filled(cells: list[str]) -> list[str]:
    """Each empty cell as the one before it."""
    found = ""
    return [found := cell.strip() or found for cell in cells]


def _rows(lines: list[str], begin: int, between: str | None) -> tuple[list[Row], int]:
    """Rows from a line on, and the number of the line where another table begins, 0 if none does."""
    rows: list[Row] = []
    blank = False
    for k in range(begin, len(lines)):
        cells = cells_of(lines[k], between)
        if not any(cell.strip() for cell in cells):
            blank = True
            continue
        if blank and not _separator(lines[k], 1)[0]:
            return rows, k + 1
        rows.append((k + 1, cells))
        blank = False
    return rows, 0
