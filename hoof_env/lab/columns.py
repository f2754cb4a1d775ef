"""Meaning of the columns of a force record: which of them are the forces of which limb.

Columns with our names or OpenSim's are recognised; others are named by a mapping, which also renames limbs,
turns columns round and adds them. `lab.read` reads the values.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from hoof_env.errors import DataFileError, ParameterError, parse_json
from hoof_env.lab.forces import limb_name
from hoof_env.lab.tables import Table

# OpenSim's names of a force along an axis: `ground_force_vx`, and of a limb `left_ground_force_vx` or
# `ground_force_left_vx`.
OPENSIM = re.compile(
    r"(?:(?P<before>.+?)_)??(?:ground_)?(?:reaction_)?force_?(?:(?P<behind>.+)_)?v(?P<axis>[xyz])",
    re.IGNORECASE,
)
# Our names: `force_x` of one leg, `left_fore_force_x` of several.
OURS = re.compile(r"(?P<limb>(?:.*_)?)force_(?P<axis>[xyz])")


class Term(NamedTuple):
    """Column of a sum, and the sign with which it counts: 1 is added, -1 is subtracted."""

    sign: int
    column: str


@dataclass
class Source:
    """Columns of a limb's force.

    Attributes:
        forward, upward: terms of the sum for each component; `forward` is empty if the file has no such
            force.
        axes: column by axis of the file, "x" and so on; empty if a mapping names the columns.
    """

    forward: list[Term]
    upward: list[Term]
    axes: dict[str, str] = field(default_factory=dict)


def parse_mapping(option: str, items: Sequence[str]) -> dict[str, Any]:
    """Parse the values of `--map-a` and the like, NAME=COLUMN items or JSON objects, into one mapping. Names
    of limbs may be any text, as 1=l.

    >>> parse_mapping("--map-a", ["time=abs time", "1=l"])
    {'time': 'abs time', '1': 'l'}

    Raises:
        ParameterError: an item is neither, or a name occurs twice.
    """
    mapping: dict[str, Any] = {}
    for item in items:
        name, equals, column = (part.strip() for part in item.partition("="))
        if item.lstrip().startswith("{"):
            try:
                pairs = parse_json(item)
            except ValueError as error:
                raise ParameterError(f"{option}: expected a JSON object, got {item!r} ({error})") from None
        elif equals and name and column:
            pairs = {name: column}
        else:
            raise ParameterError(f"{option}: expected a JSON object or key=value, got {item!r}")
        for key, value in pairs.items():
            if key in mapping:
                raise ParameterError(
                    f"{option}: expected {key} once, got {key}={mapping[key]} and {key}={value}"
                )
            mapping[key] = value
    return mapping


def sources_of(
    path: Path, table: Table, mapping: dict[str, Any], ahead: str, upward: str
) -> tuple[dict[str, list[Source]], str, list[str]]:
    """Find the columns of each limb's force.

    Args:
        path: the file, for error messages.
        table: its columns; world axes of plates are added to them.
        mapping: names of columns and limbs, see `lab.read.read_record`.
        ahead, upward: axes of the file that are forward and upward, as "x" or "-x".

    Returns:
        Sources by limb, to be added if there are several; the name of the column of times; and notes on limbs
        that the mapping leaves out.

    Raises:
        ParameterError: the mapping does not fit the file, or no column is recognised.
        DataFileError: a column's name occurs several times in the file.
    """
    columns = {key: str(value) for key, value in mapping.items() if key.endswith(("force_x", "force_y"))}
    renames = {key: str(value) for key, value in mapping.items() if key != "time" and key not in columns}
    known = _recognised(table, ahead, upward)
    if table.plates:
        _add_world_axes(table, known)
    named: dict[str, Source] = {}
    # A dictionary, as a set would lose the order of the mapping, which is the order of the limbs.
    for limb in dict.fromkeys(key.removesuffix("_x").removesuffix("_y") for key in columns):
        vertical = columns.get(f"{limb}_y")
        if vertical is None:
            raise ParameterError(f"map: expected {limb}_y beside {limb}_x={columns[f'{limb}_x']}")
        forward = columns.get(f"{limb}_x")
        named[limb_name(limb.removesuffix("force"))] = Source(
            _terms(path, table, forward) if forward else [], _terms(path, table, vertical)
        )
    if not named and not known and table.lines and not table.line:
        raise ParameterError(
            f"map: expected a line of names above the numbers of {path.name}, which begin in line "
            f"{table.lines[0]}, found none; columns may be named by number, as time=#1 force_y=#3 (--map-a, "
            f"--map-b), of {few(table.names)}"
        )
    if not named and not known:
        # Forces with names of ours, but several of each: the remedy is another than for unknown names.
        repeated = [text for name, text in table.repeated.items() if _limb_and_axis(name)]
        if repeated:
            raise DataFileError(f"record {str(path)!r}: {'; '.join(repeated)}")
        where = f" in line {table.line}" if table.line else ""
        raise ParameterError(
            f"map: expected columns of {path.name} for time, force_x and force_y, as in force_y=Fz; its names"
            f"{where} are {few(table.names)}"
        )
    limbs, notes = _renamed(path, named, known, renames)
    notes += _shared(limbs)
    return limbs, str(mapping.get("time", "time")), notes


def _shared(limbs: dict[str, list[Source]]) -> list[str]:
    """Return notes on columns that are the vertical force of several limbs, as one plate under two legs."""
    users: dict[str, list[str]] = {}
    for limb, parts in limbs.items():
        for name in {term.column for part in parts for term in part.upward}:
            users.setdefault(name, []).append(limb)
    return [
        f"{name} is the vertical force of {' and of '.join(names)}: stances of one are counted for the other"
        for name, names in users.items()
        if len(names) > 1
    ]


def _recognised(table: Table, ahead: str, upward: str) -> dict[str, Source]:
    """Return the sources of all limbs with a vertical force that are plates, or have columns with names of
    ours or of OpenSim."""
    by_limb: dict[str, dict[str, str]] = {}
    for limb in table.plates:
        by_limb[limb] = {axis: f"{limb}_{axis}" for axis in "xyz"}
    if not table.plates:
        for name in table.names:
            recognised = _limb_and_axis(name)
            if recognised is not None:
                limb, axis = recognised
                by_limb.setdefault(limb, {})[axis] = name
    sign_ahead = -1 if ahead.startswith("-") else 1
    sign_upward = -1 if upward.startswith("-") else 1
    sources = {}
    for limb, axes in by_limb.items():
        if upward[-1] in axes:
            forward = [Term(sign_ahead, axes[ahead[-1]])] if ahead[-1] in axes else []
            sources[limb] = Source(forward, [Term(sign_upward, axes[upward[-1]])], axes)
    return sources


def _limb_and_axis(name: str) -> tuple[str, str] | None:
    """Return limb and axis of a column of forces by its name, ours or OpenSim's, None for another column;
    blanks in the name are taken for underscores."""
    name = "_".join(name.split())
    if (match := OURS.fullmatch(name)) is not None:
        limb = limb_name(match["limb"])
        # Our files have the forces at toe and heel next to the limb's, which are their sums.
        return None if limb.endswith(("toe", "heel")) else (limb, match["axis"])
    if (match := OPENSIM.fullmatch(name)) is not None:
        return match["before"] or match["behind"] or "leg", match["axis"].lower()
    return None


def _add_world_axes(table: Table, known: dict[str, Source]) -> None:
    """Add columns `plate_1_force_x` and `plate_1_force_y`, forward and upward, for mappings to name."""
    for limb, source in known.items():
        for name, (term,) in (("x", source.forward), ("y", source.upward)):
            column = f"{limb}_force_{name}"
            table.columns[column] = term.sign * table.columns[term.column]
            table.units[column] = table.units[term.column]


def _renamed(
    path: Path, named: dict[str, Source], known: dict[str, Source], renames: dict[str, str]
) -> tuple[dict[str, list[Source]], list[str]]:
    """Apply the renames of a mapping.

    Args:
        path: the file, for error messages.
        named: limbs of which the mapping names the columns.
        known: limbs that are recognised in the file.
        renames: one limb of the file, or several as "plate_1+plate_3", by new name.

    Returns:
        Sources by new name, and notes on limbs that are left out because another limb took their name.

    Raises:
        ParameterError: a limb is missing or is used twice.
    """
    pool = known | named
    origin: dict[str, str] = {}  # new name by limb of the file
    parts: dict[str, list[str]] = {}
    for new, text in renames.items():
        terms = _split(text, pool)
        if isinstance(terms, str) or any(sign < 0 for sign, _ in terms):
            raise ParameterError(f"map: expected a limb of {path.name} ({few(pool)}), got {new}={text}")
        if new in named:
            raise ParameterError(f"map: expected {new} once, got {new}_force_y and {new}={text}")
        parts[new] = [old for _, old in terms]
        for old in parts[new]:
            if old in origin:
                raise ParameterError(
                    f"map: expected {old} of {path.name} once, got it for {origin[old]} and for {new}"
                )
            origin[old] = new
    limbs: dict[str, list[Source]] = {}
    notes = []
    # Recognised limbs count only if the mapping names no columns; a rename may fetch one of them all the
    # same.
    for limb in dict.fromkeys([*(named or known), *origin]):
        if limb in origin:
            # The first part of a sum brings in the whole; `setdefault` ignores the other parts.
            limbs.setdefault(origin[limb], [pool[old] for old in parts[origin[limb]]])
        elif limb in parts:
            notes.append(
                f"{limb} of the file is left out, because {limb}={renames[limb]} gives its name to another; "
                f"give it one, too, to keep it, as in {renames[limb]}={limb}"
            )
        else:
            limbs[limb] = [pool[limb]]
    return limbs, notes


def _split(text: str, names: Any) -> list[Term] | str:
    """Parse names with "+" or "-" between them; return the rest that cannot be read as a string.

    Names may contain either sign: the longest name that fits counts.
    """
    ordered = sorted(names, key=len, reverse=True)
    rest = text.strip()
    terms: list[Term] = []
    while True:
        # A leading "-" is a sign unless a name begins with it.
        sign = -1 if rest.startswith("-") and not any(rest.startswith(name) for name in ordered) else 1
        bare = rest if sign > 0 else rest[1:].lstrip()
        if sign > 0 and terms and bare.startswith("+"):  # as in a+ +b
            bare = bare[1:].lstrip()
        # A name ends at a sign or at the end of the text, where the slice is empty and in every string.
        fits = [name for name in ordered if bare.startswith(name) and bare[len(name) :].lstrip()[:1] in "+-"]
        if not fits:
            return bare or text
        terms.append(Term(sign, fits[0]))
        rest = bare[len(fits[0]) :].lstrip()
        if not rest:
            return terms
        # A "+" has done its work; a "-" is the sign of the next name.
        rest = rest[1:].lstrip() if rest[0] == "+" else rest


def _terms(path: Path, table: Table, text: str) -> list[Term]:
    """Return the columns that the text of a mapping names, by their keys in the table.

    Raises:
        ParameterError: a column is missing.
        DataFileError: a name occurs several times in the file.
    """
    numbers = {f"#{k}": key for k, key in enumerate(table.order, 1)}
    keys = dict.fromkeys([*table.columns, *table.unread, *table.repeated])
    terms = _split(text, numbers | keys)
    if isinstance(terms, str):
        where = f" in line {table.line}" if table.line else ""
        within = f" in {text!r}" if terms != text else ""
        raise ParameterError(
            f"map: expected a column of {path.name} (names{where}: {few(table.names)}), got {terms!r}{within}"
        )
    for term in terms:
        if term.column in table.repeated:
            raise DataFileError(f"record {str(path)!r}: {table.repeated[term.column]}")
    return [Term(sign, name if name in keys else numbers[name]) for sign, name in terms]


def few(names: Any) -> str:
    """Return the first eight names and the number of the others, for messages; "none" without names."""
    shown = list(names)
    return ", ".join(shown[:8]) + (f" and {len(shown) - 8} more" if len(shown) > 8 else "") or "none"
