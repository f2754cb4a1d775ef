"""Layout of text files of numbers: encoding, separators of cells, and places of names and units.

Above the numbers there may be anything, as BioWare, Vicon Nexus and other programs write it. The names are in
the last line above the numbers, or in the line before it if the last has units only. A table ends at a blank
line that words follow; after that, another table begins.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

from hoof_env.errors import DataFileError
from hoof_env.lab.clock import moment

# A name, with its unit in brackets behind it if it has one.
TITLE_PATTERN = re.compile(r"\s*(?P<name>.*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])])?\s*")
WORD_PATTERN = re.compile(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?")
"""Pattern of a name between blanks, with its unit."""

COMMENT_PATTERN = re.compile(r"\s*(#|%|//)+\s*")
"""Pattern of a comment sign before the names, which NumPy writes."""

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
"""Words of a row of units below the names."""

MISSING = frozenset(("", "nan", "na", "n/a", "#n/a", "nat", "null", "none", "-", "--", ".", "missing"))
"""Words of cells without a number, in small letters."""

NAN_PATTERN = re.compile(r"[+-]?(1\.#(qnan|snan|ind)0*|nan(\(\w*\))?)")
"""Pattern of NaN as C libraries print it, in small letters: -1.#IND and -nan(ind) of Windows."""

SEPARATORS = ("\t", ";", ",", None)
"""Separators of cells; None stands for blanks."""

MIN_TABLE_ROWS = 10
"""Number of successive rows of numbers that make a table, unless the file has fewer."""

Row = tuple[int, list[str]]
"""Number of a line in its file, and its cells."""


@dataclass
class Text:
    """A table of a text file as cells.

    Attributes:
        titles: names by column, some with a unit.
        rows: rows of numbers.
        units: units by column, from a row of their own; empty if there is none.
        groups: texts above the names by column, such as the plate of several columns; may be empty.
        line: number of the line of names, 0 if there is none.
        decimal_comma: True if a comma may be a decimal sign.
        notes: messages about parts of the file that are not read.
    """

    titles: list[str]
    rows: list[Row]
    units: list[str] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    line: int = 0
    decimal_comma: bool = False
    notes: list[str] = field(default_factory=list)


def lines_of(path: Path) -> list[str]:
    """Read the lines of a text file in UTF-8, in UTF-16 with its byte order mark, or else in the code page of
    Windows, in which every byte is a character; raise `DataFileError` for bytes 0, which no text has."""
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
    """Convert a cell to a number; raise `ValueError` if it is not one."""
    return float(cell.replace(",", ".") if decimal_comma else cell)


def is_missing(cell: str) -> bool:
    """Return True if a cell says that there is no number."""
    word = cell.strip().casefold()
    return word in MISSING or NAN_PATTERN.fullmatch(word) is not None


def is_number(cell: str, decimal_comma: bool = True) -> bool:
    """Return True if a cell is a number."""
    try:
        number(cell, decimal_comma)
    except ValueError:
        return False
    return True


def cells_of(line: str, between: str | None) -> list[str]:
    """Split a line at a separator, one of `SEPARATORS`."""
    return line.split() if between is None else next(csv.reader([line], delimiter=between), [])


def _separator(line: str, least: int) -> tuple[bool, str | None]:
    """Find the separator with which the largest share of a line's cells are numbers.

    Args:
        line: the line.
        least: least number of cells.

    Returns:
        True if most cells are numbers, the first one included; and the separator.
    """
    best = 0.0
    separator = None
    for between in SEPARATORS:
        if between is not None and between not in line:
            continue
        cells = cells_of(line, between)
        # The first cell of a row is a number or a time, and most others are, as far as there are any.
        known = [_is_value(cell, between) for cell in cells if not is_missing(cell)]
        enough = len(cells) >= least and bool(known) and not is_missing(cells[0]) and known[0]
        share = sum(known) / len(known) if enough else 0.0
        if share > best:
            best = share
            separator = between
    return best > 0.5, separator


def is_empty(cells: list[str]) -> bool:
    """Return True if a row has cells, and no value in any."""
    return len(cells) > 1 and all(map(is_missing, cells))


def _split(line: str) -> list[list[str]]:
    """Return the cells of a line at each separator that it contains, but blanks."""
    return [cells_of(line, between) for between in SEPARATORS if between is not None and between in line]


def _is_value(cell: str, between: str | None) -> bool:
    """Return True if a cell between separators is a number or a time."""
    return is_number(cell, between != ",") or moment(cell) is not None


def _first_row(lines: list[str]) -> tuple[int, str | None]:
    """Find the first row of numbers.

    Returns:
        The number of the row and the separator of its cells; the number of lines and None without numbers.
    """
    # Tables of one column last, as single numbers occur in headers, too.
    for least in (2, 1):
        # Runs of rows of numbers: length, first row and separator.
        runs: list[tuple[int, int, str | None]] = []
        for k, line in enumerate(lines):
            # Rows without any value break no run: programs write them in swing.
            if not line.strip() or any(map(is_empty, _split(line))):
                continue
            numeric, between = _separator(line, least)
            if not numeric:
                runs.append((0, k + 1, None))
                continue
            length, begin, first = runs[-1] if runs else (0, 0, None)
            # A run has the separator of its first row: later rows may be read in more than one way.
            runs[-1:] = [(length + 1, begin if length else k, first if length else between)]
            if length + 1 == MIN_TABLE_ROWS:
                return runs[-1][1:]
        # The file is shorter than a sure table: the first of its longest runs.
        if runs and max(runs)[0]:
            most = max(length for length, _, _ in runs)
            return next(run[1:] for run in runs if run[0] == most)
    return len(lines), None


def parse(lines: list[str]) -> Text:
    """Parse the first table in the lines of a file."""
    begin, between = _first_row(lines)
    first = begin
    while begin < len(lines) and first and is_empty(cells_of(lines[first - 1], between)):
        first -= 1
    if first < begin and any(is_empty(cells_of(line, between)) for line in lines[begin:]):
        begin = first  # the first rows have no value, either
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
    # Other lines above the numbers have fewer words, or are numbers, too.
    if table and (len(titles) < width_of(table[0][1]) or all(_is_value(cell, between) for cell in titles)):
        titles, units, groups, line = [], [], [], 0
    notes = [f"line {after}: another table begins there, which is not read"] if after else []
    return Text(titles, table, units, groups, line, between != ",", notes)


def width_of(cells: list[str]) -> int:
    """Return the number of cells of a row without those at its end that are blank."""
    return max((k for k, cell in enumerate(cells, 1) if cell.strip()), default=0)


def _between_names(line: str, between: str | None, row: str) -> str | None:
    """Find the separator of names.

    It is the separator of the numbers if the line of names contains it; else the one that gives as many names
    as a row has cells; else the most frequent one.

    Args:
        line: line of names.
        between: separator of the cells of a row.
        row: first row of numbers, "" without one.
    """
    if between is not None and between in line:
        return between
    width = len(cells_of(row, between)) if row else 0
    fits = [separator for separator in (between, *SEPARATORS) if len(_titles(line, separator)) == width]
    if fits:
        return fits[0]
    most = max("\t;,", key=line.count)
    return most if not row and most in line else None


def _titles(line: str, between: str | None) -> list[str]:
    """Split a line of names, without a comment sign before them, at a separator."""
    bare = COMMENT_PATTERN.sub("", line, count=1) if COMMENT_PATTERN.match(line) else line
    return WORD_PATTERN.findall(bare) if between is None else cells_of(bare, between)


def _are_units(cells: list[str], names: list[str]) -> bool:
    """Return True if a row is one of units below names."""
    words = [cell.strip() for cell in cells if cell.strip()]
    if not words or len(words) > len(names):
        return False
    if all(word.strip(" []()").casefold() in UNIT_WORDS or word[0] in "[(" for word in words):
        return True
    # Unknown units: unlike names, units of several columns are the same.
    return len(cells) == len(names) == len(set(names)) > len(set(words))


def _are_groups(cells: list[str], names: list[str]) -> bool:
    """Return True if a row above the names has texts for groups of them, such as plates."""
    filled = [cell for cell in cells if cell.strip()]
    # A group's text stands in its first column, so that there are gaps; the last ones may be left out.
    return 1 <= len(filled) < len(names) and len(cells) > len(filled) and len(cells) >= len(names) - 2


def _filled(cells: list[str]) -> list[str]:
    """Fill each empty cell with the text of the cell before it."""
    filled = []
    text = ""
    for cell in cells:
        text = cell.strip() or text
        filled.append(text)
    return filled


def _rows(lines: list[str], begin: int, between: str | None) -> tuple[list[Row], int]:
    """Return the rows from line `begin` on, and the number of the line where another table begins, else 0."""
    rows: list[Row] = []
    empty: list[Row] = []
    blank = False
    for k in range(begin, len(lines)):
        cells = cells_of(lines[k], between)
        if not any(cell.strip() for cell in cells):
            blank = True
            # Separators alone are a row without values if others follow.
            empty += [(k + 1, cells)] if len(cells) > 1 else []
            continue
        if blank and not (_separator(lines[k], 1)[0] or is_empty(cells)):
            return rows, k + 1
        rows += [*empty, (k + 1, cells)]
        empty = []
        blank = False
    # At the end such rows may be the padding of a spreadsheet, unless there were others.
    return rows + (empty if empty and any(is_empty(cells) for _, cells in rows) else []), 0
