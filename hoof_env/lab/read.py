"""Force records from files, ours or a laboratory's, in the world frame of `hoof_env.lab`: axes, signs, units.

`lab.tables` reads the files, `lab.columns` finds the columns of each limb, `lab.sample_times` reads the
times, and `lab.axis_checks` warns of suspect axes. Columns that are not used may hold anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.errors import (
    DataFileError,
    HoofEnvError,
    ParameterError,
    check_choice,
    check_number,
    printable,
)
from hoof_env.lab.axis_checks import suspect_axes, suspect_direction
from hoof_env.lab.columns import Source, Term, few, sources_of
from hoof_env.lab.columns import parse_mapping as parse_mapping
from hoof_env.lab.gaps import GAPS, fill
from hoof_env.lab.sample_times import times_of
from hoof_env.lab.tables import READERS, Table

Floats = NDArray[np.float64]

FORCE_UNITS = ("N", "kN", "N/kg", "BW", "%BW")
"""Units of measured forces; BW are body weights."""

SPELLINGS = {unit.casefold(): unit for unit in FORCE_UNITS} | {
    "newton": "N",
    "newtons": "N",
    "nt": "N",
    "kilonewton": "kN",
    "kilonewtons": "kN",
    "bodyweight": "BW",
    "body weight": "BW",
    "body weights": "BW",
    "xbw": "BW",
    "n/bw": "BW",
    "% bw": "%BW",
    "% body weight": "%BW",
    "%bodyweight": "%BW",
}
"""Units by their spellings in files, in small letters."""

REVERSED = {"auto": None, "none": (1, 1), "x": (-1, 1), "y": (1, -1), "xy": (-1, -1)}
"""Signs of the forward and the upward component by option; "auto" turns both components of each limb with a
vertical force that points down, as the force of the limb on the plate does."""

AXES = ("auto", "x", "y", "z", "-x", "-y", "-z")
"""Axes of a file, for the upward and the forward direction."""

LOADED_SHARE = 0.2
"""Share of a limb's highest vertical force below which samples do not count for its direction, so that an
offset does not decide it."""

UNLOADED_SHARE = 0.05
"""Share of the highest vertical force of all limbs below which a limb has no direction."""

MIN_NET_SHARE = 0.5
"""Share of the sum of absolute forces that the sum of forces must exceed for a limb to have a direction."""


ZERO = np.zeros(2)


@dataclass
class ForceRecord:
    """Ground reaction forces of limbs, in the world frame and with the signs of `hoof_env.lab`.

    Attributes:
        name: name of the file.
        time: times by the clock of the file, evenly spaced, shape (n,) [s].
        limbs: forces forward and upward by limb, shape (n, 2), in `unit`; the forward force is NaN if the
            file has none.
        unit: unit of the forces, one of `FORCE_UNITS`.
        weight: weight of the animal [N], or None if unknown.
        signs: factors of the forward and the upward component in the file by limb; (1, 1) for others.
        turned: limbs of which "auto" has turned both components.
        notes: warnings about the record, and their remedies.
        own: True if this package wrote the file: its signs are right.
    """

    name: str
    time: Floats
    limbs: dict[str, Floats]
    unit: str
    weight: float | None = None
    signs: dict[str, tuple[int, int]] = field(default_factory=dict)
    turned: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    own: bool = False

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))

    def per(self, unit: str) -> float | None:
        """Return the factor that converts the forces to `unit`, "N" or "BW"; None if the conversion needs the
        weight and it is unknown."""
        newtons = {"N": 1.0, "kN": 1e3}.get(self.unit)
        body_weights = {"N/kg": 1 / GRAVITY, "BW": 1.0, "%BW": 0.01}.get(self.unit)
        if unit == "N":
            return newtons if newtons else self.weight and body_weights and body_weights * self.weight
        return body_weights if body_weights else self.weight and newtons and newtons / self.weight


def read_record(
    path: Path,
    mapping: Mapping[str, Any] | None = None,
    unit: str = "auto",
    reverse: str = "auto",
    rate: float | None = None,
    mass: float | None = None,
    up: str = "auto",
    forward: str = "auto",
    gaps: str = "auto",
) -> ForceRecord:
    """Read a force record from a file.

    Args:
        path: the file.
        mapping: columns of the file by their meaning: "time", "force_x" and "force_y" of one limb,
            "left_fore_force_x" and so on of several; a "-" before a column flips its sign, and a "+" between
            columns adds them, for several plates. "Fz#2" is the second column with the name Fz, "#3"
            the third column of the file. A new name for a limb of the file, as in left_fore="plate_1",
            renames that limb; left_fore="plate_1+plate_3" is the sum of both.
        unit: unit of the forces, one of `FORCE_UNITS`; "auto" takes the unit that the file states.
        reverse: components to be turned round, one of `REVERSED`.
        rate: sampling rate [Hz], instead of the steps of a column of times.
        mass: mass of the animal [kg], if the file does not state its weight.
        up: the file's axis that points upward, one of `AXES`; "auto" is y, or the normal of a c3d's plates.
        forward: the file's axis in which the animal travels; "auto" is x, or y if x is upward.
        gaps: what missing values are, one of `lab.gaps.GAPS`; "auto" takes those in swing as 0.

    Raises:
        DataFileError: the file is missing, broken or empty, or has numbers that are not finite.
        MissingExtraError: its format needs a package that is not installed.
        ParameterError: an argument does not fit the file.
    """
    _check_arguments(unit, reverse, rate, mass, up, forward)
    check_choice("gaps", gaps, GAPS)
    path = Path(path)
    table = _load(path)
    upward, ahead = _axes(path.name, table, up, forward)
    sources, time, notes = sources_of(path, table, dict(mapping or {}), ahead, upward)
    # Columns that a mapping names have no axes of the file; their directions are the mapping's.
    has_axes = any(part.axes for parts in sources.values() for part in parts)
    if (up, forward) != ("auto", "auto") and not has_axes:
        raise ParameterError(
            f"up, forward: expected neither with columns of {path.name} that --map names; name the columns "
            "of the axes there, with a minus for the opposite direction"
        )
    if any(name.casefold() == time.casefold() for name in table.columns):
        table.drop_empty()  # the steps of the times say whether one is missing
    notes += fill(path, table, sources, gaps)
    columns = _components(path, table, sources)
    unit = _unit(path, table, unit, sources)
    rows = len(next(iter(columns.values()))[0])
    times, time_notes = times_of(path, table, time, rate, rows, few(table.names))
    if REVERSED[reverse] is None:
        _check_sums(path, table, sources)
    forces, signs, down = _turned(columns, reverse)
    turned = tuple(limb for limb, which in down.items() if any(which))
    notes += table.notes + time_notes
    notes += suspect_axes(forces, _others(table, sources), ahead, upward, (up, forward))
    if not table.own:
        notes += suspect_direction(forces, times, ahead, has_axes)
    # A given mass takes precedence over the weight in the file.
    weight = table.weight if mass is None else mass * GRAVITY
    name = printable(path.name)
    return ForceRecord(name, times, forces, unit, weight, signs, turned, tuple(notes), table.own)


def _check_arguments(
    unit: str, reverse: str, rate: float | None, mass: float | None, up: str, forward: str
) -> None:
    """Raise an error if an argument of `read_record` is wrong, whatever the file."""
    check_choice("reverse", reverse, REVERSED)
    check_choice("units", unit, ("auto", *FORCE_UNITS))
    for name, number in (("rate", rate), ("mass", mass)):
        if number is not None:
            check_number(name, number, low=0.0, exclusive_low=True)
    check_choice("up", up, AXES)
    check_choice("forward", forward, AXES)


def _axes(name: str, table: Table, up: str, forward: str) -> tuple[str, str]:
    """Return the axes of a file that point upward and forward; raise if they are one."""
    upward = table.up if up == "auto" else up
    ahead = ("y" if upward[-1] == "x" else "x") if forward == "auto" else forward
    if upward[-1] == ahead[-1]:
        raise ParameterError(
            f"forward: expected another axis than upward ({upward}) of {name}, got {ahead}; name both "
            "(--up-a, --forward-a, --up-b, --forward-b)"
        )
    return upward, ahead


def _components(path: Path, table: Table, sources: dict[str, list[Source]]) -> dict[str, list[Floats]]:
    """Return the forward and upward component of each part of each limb's force, shape (n, 2)."""
    columns: dict[str, list[Floats]] = {}
    for limb, parts in sources.items():
        columns[limb] = [
            np.column_stack([_sum(path, table, part.forward), _sum(path, table, part.upward)])
            for part in parts
        ]
    return columns


def _turned(
    columns: dict[str, list[Floats]], reverse: str
) -> tuple[dict[str, Floats], dict[str, tuple[int, int]], dict[str, list[bool]]]:
    """Turn the parts of each limb's force as `reverse` says and add them.

    Returns:
        Force of each limb, signs of its first part, and for each part true if it pointed into the ground;
        the latter is empty unless `reverse` is "auto".
    """
    chosen = REVERSED[reverse]
    down: dict[str, list[bool]] = _downward(columns) if chosen is None else {}
    signs: dict[str, tuple[int, int]] = {}
    forces: dict[str, Floats] = {}
    for limb, measured in columns.items():
        # Plates that are added may lie different ways round, so each part is turned for itself.
        each = [chosen or ((-1, -1) if down[limb][k] else (1, 1)) for k in range(len(measured))]
        signs[limb] = each[0]
        forces[limb] = sum((np.array(sign) * part for sign, part in zip(each, measured, strict=True)), ZERO)
    return forces, signs, down


def _unit(path: Path, table: Table, unit: str, sources: dict[str, list[Source]]) -> str:
    """Return the unit of all forces: `unit`, or the one that the file states if that is "auto"; raise
    `ParameterError` unless the file states one known unit for all."""
    if unit != "auto":
        return unit
    stated = set()
    for parts in sources.values():
        for part in parts:
            stated |= {table.units.get(term.column, "") for term in (*part.forward, *part.upward)}
    known = {SPELLINGS.get(" ".join(text.casefold().split())) for text in stated}
    if len(known) == 1 and (only := known.pop()):
        return only
    listed = ", ".join(sorted(text for text in stated if text)) or "none"
    raise ParameterError(
        f"units: expected one of {', '.join(FORCE_UNITS)} for {path.name}, which says {listed}; name "
        "it by --units-a or --units-b"
    )


def _downward(forces: dict[str, list[Floats]]) -> dict[str, list[bool]]:
    """Return for each limb which of its parts have a vertical force that points down.

    Each part is judged alone, as one plate may lie the other way round. A part that is hardly loaded, or has
    noise only, has no direction.
    """
    highest = max(float(np.abs(part[:, 1]).max()) for parts in forces.values() for part in parts)
    least = UNLOADED_SHARE * highest
    down = {}
    for limb, parts in forces.items():
        down[limb] = [_points_down(part[:, 1], least) for part in parts]
    return down


def _points_down(vertical: Floats, least: float) -> bool:
    """Return True if a vertical force of shape (n,) points down and is higher than `least`."""
    highest = float(np.abs(vertical).max())
    # Only strong samples: an offset in swing lasts longer than a stance.
    strong = vertical[np.abs(vertical) > LOADED_SHARE * highest]
    return highest > least and bool(strong.sum() < -MIN_NET_SHARE * np.abs(strong).sum())


def _check_sums(path: Path, table: Table, sources: dict[str, list[Source]]) -> None:
    """Raise `ParameterError` if columns with vertical forces in opposite directions are to be added."""
    for limb, parts in sources.items():
        for terms in (part.upward for part in parts):
            # A minus in a mapping shows that its author has looked at the signs.
            if len(terms) < 2 or any(term.sign < 0 for term in terms):
                continue
            columns = {term.column: table.columns[term.column] for term in terms}
            least = UNLOADED_SHARE * max(float(np.abs(values).max()) for values in columns.values())
            down = [name for name, values in columns.items() if _points_down(values, least)]
            up = [name for name, values in columns.items() if _points_down(-values, least)]
            if down and up:
                raise ParameterError(
                    f"map: expected columns of {path.name} that point the same way for {limb}, got "
                    f"{', '.join(up)} upward and {', '.join(down)} downward; a minus before a column turns "
                    "it round"
                )


def _load(path: Path) -> Table:
    """Read the table of a file by its suffix; errors are `read_record`'s."""
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise ParameterError(
            f"record: expected a file that ends in {', '.join(sorted(READERS))}, got {str(path)!r}"
        )
    if not path.is_file():
        raise DataFileError(f"record {str(path)!r}: expected a file, found none")
    try:
        table = READERS[suffix](path)
    except HoofEnvError:
        raise
    # Readers of other packages raise exceptions of any type.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataFileError(
            f"record {str(path)!r}: expected a {suffix} that can be read, cannot read it ({reason:.200})"
        ) from None
    if not table.names or any(len(values) < 2 for values in table.columns.values()):
        found = f"found {table.rows} under the names in line {table.line}" if table.line else "found fewer"
        raise DataFileError(
            f"record {str(path)!r}: expected two rows of numbers or more, {found}; tabs, semicolons, commas "
            "or blanks separate the cells of a row"
        )
    return table


def _sum(path: Path, table: Table, terms: list[Term]) -> Floats:
    """Return the sum of columns, shape (n,), NaN without columns; raise `DataFileError` if a value is not
    finite."""
    if not terms:
        return np.full(table.rows, np.nan)
    total = np.zeros(table.rows)
    for sign, name in terms:
        if name in table.unread:
            raise DataFileError(f"record {str(path)!r}: {name}: {table.unread[name]}")
        values = table.columns[name]
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise DataFileError(
                f"record {str(path)!r}: {name}: expected finite numbers, got {values[row]} in "
                f"{table.place(row)}"
            )
        total += sign * values
    return total


def _others(table: Table, sources: dict[str, list[Source]]) -> dict[str, dict[str, Floats]]:
    """Return the absolute forces of limbs, shape (n,), by limb and by axis of the file."""
    sizes: dict[str, dict[str, Floats]] = {}
    for limb, parts in sources.items():
        sizes[limb] = {}
        for axis in "xyz":
            if all(part.axes.get(axis, "") in table.columns for part in parts):
                size = np.asarray(sum(np.abs(table.columns[part.axes[axis]]) for part in parts))
                if np.isfinite(size).all():
                    sizes[limb][axis] = size
    return sizes
