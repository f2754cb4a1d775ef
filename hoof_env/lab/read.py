"""Force records from files, ours or a laboratory's: columns, signs, axes, and what limbs are called.

`lab.tables` reads the files and `lab.clock` the times. Columns that our files and OpenSim's use are found by
their names; others are named by a mapping. Columns that nobody asks for may hold anything.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.parts import GRAVITY
from hoof_env.errors import (
    DataFileError,
    HoofEnvError,
    ParameterError,
    check_choice,
    check_number,
    parse_json,
)
from hoof_env.lab.clock import times_of
from hoof_env.lab.doubts import backward, sideways
from hoof_env.lab.forces import limb_name
from hoof_env.lab.tables import READERS, Table

Floats = NDArray[np.float64]

FORCE_UNITS = ("N", "kN", "N/kg", "BW", "%BW")
"""Of measured forces; BW are body weights."""

SPELLINGS = {one.casefold(): one for one in FORCE_UNITS} | {
    "newton": "N", "newtons": "N", "nt": "N", "kilonewton": "kN", "kilonewtons": "kN", "bodyweight": "BW",
    "body weight": "BW", "body weights": "BW", "xbw": "BW", "n/bw": "BW", "% bw": "%BW",
    "% body weight": "%BW", "%bodyweight": "%BW",
}  # fmt: skip
"""Other words for units, in small letters."""

REVERSED = {"auto": None, "none": (1, 1), "x": (-1, 1), "y": (1, -1), "xy": (-1, -1)}
"""Which components count the other way; "auto" turns both of every limb whose vertical force points down, as
that of the limb on the plate does."""

AXES = ("auto", "x", "y", "z", "-x", "-y", "-z")
"""Of a file, for the upward and the forward direction."""

STRONG = 0.2
IDLE = 0.05
ONE_WAY = 0.5
"""Share of the highest vertical force of a limb from which on samples tell its direction, so that an offset
does not; share of that of all limbs up to which a limb has no direction; and what is left of the forces of
one that has, where those of both directions are added."""

OPENSIM = re.compile(
    r"(?:(?P<before>.+?)_)??(?:ground_)?(?:reaction_)?force_?(?:(?P<behind>.+)_)?v(?P<axis>[xyz])",
    re.IGNORECASE,
)
OURS = re.compile(r"(?P<limb>(?:.*_)?)force_(?P<axis>[xyz])")


ZERO = np.zeros(2)


@dataclass
class ForceRecord:
    """Ground reaction forces of limbs, world frame and signs of `hoof_env.lab`.

    Attributes:
        name: of the file.
        time: shape (n,), evenly spaced, by the clock of the file [s].
        limbs: forces forward and upward by limb, shape (n, 2), in `unit`; forward is not a number where the
            file has no such force.
        unit: one of `FORCE_UNITS`.
        weight: of the animal [N], or None if unknown.
        signs: what components forward and upward of a limb in the file are multiplied with; (1, 1) of others.
        turned: limbs of which "auto" has turned both components.
        notes: what makes the record doubtful, and the remedies.
    """

    name: str
    time: Floats
    limbs: dict[str, Floats]
    unit: str
    weight: float | None = None
    signs: dict[str, tuple[int, int]] = field(default_factory=dict)
    turned: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def rate(self) -> float:
        """Samples a second [Hz]."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))

    def per(self, unit: str) -> float | None:
        """What its forces are multiplied with to be in "N" or "BW"; None if that takes a weight that is not
        known."""
        whole = {"N": 1.0, "kN": 1e3}.get(self.unit)
        bw = {"N/kg": 1 / GRAVITY, "BW": 1.0, "%BW": 0.01}.get(self.unit)
        if unit == "N":
            return whole if whole else self.weight and bw and bw * self.weight
        return bw if bw else self.weight and whole and whole / self.weight


class Term(NamedTuple):
    """A column, and whether it is added (1) or subtracted (-1)."""

    sign: int
    column: str


@dataclass
class Source:
    """Where a force comes from.

    Attributes:
        forward, upward: columns whose sum it is; no forward ones, if there is no such force.
        axes: columns by axis of the file, where the file's own names tell them.
    """

    forward: list[Term]
    upward: list[Term]
    axes: dict[str, str] = field(default_factory=dict)


def parse_mapping(option: str, items: Sequence[str]) -> dict[str, Any]:
    """Read what `--map-a` and the like take: NAME=COLUMN items, or JSON objects, into one mapping. Names of
    limbs may be anything, as 1=l.

    >>> parse_mapping("--map-a", ["time=abs time", "1=l"])
    {'time': 'abs time', '1': 'l'}

    Raises:
        ParameterError: an item is neither, or a name is given twice.
    """
    found: dict[str, Any] = {}
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
            if key in found:
                raise ParameterError(
                    f"{option}: expected {key} once, got {key}={found[key]} and {key}={value}"
                )
            found[key] = value
    return found


def read_record(
    path: Path,
    mapping: Mapping[str, Any] | None = None,
    unit: str = "auto",
    reverse: str = "auto",
    rate: float | None = None,
    mass: float | None = None,
    up: str = "auto",
    forward: str = "auto",
) -> ForceRecord:
    """A force record from a file.

    Args:
        path: the file.
        mapping: columns of the file by what they are: "time", "force_x" and "force_y" of one limb,
            "left_fore_force_x" and so on of several; a "-" before a column turns it round, and a "+" between
            columns adds them, as those of several plates. "Fz#2" is the second column of the name Fz, "#3"
            the third of the file. A name of ours for a limb of the file, as in left_fore="plate_1", renames
            that; left_fore="plate_1+plate_3" is the sum of both.
        unit: of the forces, one of `FORCE_UNITS`; "auto" is what the file says.
        reverse: one of `REVERSED`.
        rate: samples a second [Hz], instead of the steps of a column of time.
        mass: of the animal [kg], if the file does not say its weight.
        up: the file's axis that points upward, one of `AXES`; "auto" is y, or the normal of a c3d's plates.
        forward: the file's axis in which the animal travels; "auto" is x, or y where x is upward.

    Raises:
        DataFileError: the file is missing, broken or empty, or has numbers that are none.
        MissingExtraError: its format needs a package that is not there.
        ParameterError: an argument does not fit the file.
    """
    check_choice("reverse", reverse, REVERSED)
    check_choice("units", unit, ("auto", *FORCE_UNITS))
    for name, number in (("rate", rate), ("mass", mass)):
        if number is not None:
            check_number(name, number, low=0.0, exclusive_low=True)
    check_choice("up", up, AXES)
    check_choice("forward", forward, AXES)
    path = Path(path)
    table = _load(path)
    upward = table.up if up == "auto" else up
    ahead = ("y" if upward[-1] == "x" else "x") if forward == "auto" else forward
    if upward[-1] == ahead[-1]:
        raise ParameterError(
            f"forward: expected another axis than upward ({upward}) of {path.name}, got {ahead}; name both "
            "(--up-a, --forward-a, --up-b, --forward-b)"
        )
    sources, time, notes = _named(path, table, dict(mapping or {}), ahead, upward)
    if (up, forward) != ("auto", "auto") and not any(one.axes for parts in sources.values() for one in parts):
        raise ParameterError(
            f"up, forward: expected none beside columns of {path.name} that --map names; name those of the "
            "axes there, with a minus for its other end"
        )
    columns = {
        limb: [
            np.column_stack([_sum(path, table, one.forward), _sum(path, table, one.upward)]) for one in parts
        ]
        for limb, parts in sources.items()
    }
    unit = _unit(path, table, unit, sources)
    times, doubts = times_of(path, table, time, rate, len(next(iter(columns.values()))[0]), _few(table.names))
    chosen = REVERSED[reverse]
    down: dict[str, list[bool]] = _downward(columns) if chosen is None else {}
    if chosen is None:
        _check_sums(path, table, sources)
    signs: dict[str, tuple[int, int]] = {}
    forces: dict[str, Floats] = {}
    for limb, parts in columns.items():
        each = [chosen or ((-1, -1) if down[limb][k] else (1, 1)) for k in range(len(parts))]
        signs[limb] = each[0]
        forces[limb] = sum((np.array(sign) * part for sign, part in zip(each, parts, strict=True)), ZERO)
    turned = tuple(limb for limb, which in down.items() if any(which))
    notes += table.notes + doubts
    notes += sideways(forces, _others(table, sources), ahead, upward, (up, forward))
    notes += backward(forces, times, ahead, any(one.axes for parts in sources.values() for one in parts))
    weight = table.weight if mass is None else mass * GRAVITY
    return ForceRecord(path.name, times, forces, unit, weight, signs, turned, tuple(notes))


def _unit(path: Path, table: Table, unit: str, sources: dict[str, list[Source]]) -> str:
    """The unit of all forces: `unit`, or what the file says where that is "auto"."""
    if unit != "auto":
        return unit
    terms = [term for parts in sources.values() for one in parts for term in (*one.forward, *one.upward)]
    said = {table.units.get(term.column, "") for term in terms}
    known = {SPELLINGS.get(" ".join(one.casefold().split())) for one in said}
    if len(known) == 1 and (only := known.pop()):
        return only
    found = ", ".join(sorted(one for one in said if one)) or "none"
    raise ParameterError(
        f"units: expected one of {', '.join(FORCE_UNITS)} for {path.name}, which says {found}; name "
        "it by --units-a or --units-b"
    )


def _downward(forces: dict[str, list[Floats]]) -> dict[str, list[bool]]:
    """Of each limb, which of its parts have a vertical force that points down. Each is looked at alone, as
    one plate may lie the other way round; what is hardly loaded, or noise, points nowhere."""
    highest = {limb: [float(np.abs(part[:, 1]).max()) for part in parts] for limb, parts in forces.items()}
    least = IDLE * max(max(ones) for ones in highest.values())
    return {
        limb: [_points_down(part[:, 1], least) for part in parts] for limb, parts in forces.items()
    }  # fmt: skip


def _points_down(vertical: Floats, least: float) -> bool:
    highest = float(np.abs(vertical).max())
    strong = vertical[np.abs(vertical) > STRONG * highest]
    return highest > least and bool(strong.sum() < -ONE_WAY * np.abs(strong).sum())


def _check_sums(path: Path, table: Table, sources: dict[str, list[Source]]) -> None:
    """`ParameterError` where columns whose vertical forces point opposite ways are to be added. A mapping
    with a minus says that they were looked at."""
    for limb, parts in sources.items():
        sums = [one.upward for one in parts if len(one.upward) > 1]
        for terms in (terms for terms in sums if all(term.sign > 0 for term in terms)):
            columns = {term.column: table.columns[term.column] for term in terms}
            least = IDLE * max(float(np.abs(values).max()) for values in columns.values())
            down = [name for name, values in columns.items() if _points_down(values, least)]
            up = [name for name, values in columns.items() if _points_down(-values, least)]
            if down and up:
                raise ParameterError(
                    f"map: expected columns of {path.name} that point the same way for {limb}, got "
                    f"{', '.join(up)} upward and {', '.join(down)} downward; a minus before a column turns "
                    "it round"
                )


def _load(path: Path) -> Table:
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
    except Exception as error:  # of readers that are not ours, which raise all kinds
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataFileError(f"record {str(path)!r}: cannot read it ({reason:.200})") from None
    if not table.names or any(len(values) < 2 for values in table.columns.values()):
        raise DataFileError(f"record {str(path)!r}: expected two rows of numbers or more, found fewer")
    return table


def _named(
    path: Path, table: Table, given: dict[str, Any], ahead: str, upward: str
) -> tuple[dict[str, list[Source]], str, list[str]]:
    """Where the force of each limb comes from, the column of the time, and what to say of limbs that a
    mapping leaves out."""
    columns = {key: str(value) for key, value in given.items() if key.endswith(("force_x", "force_y"))}
    renames = {key: str(value) for key, value in given.items() if key != "time" and key not in columns}
    known = _recognised(table, ahead, upward)
    if table.plates:
        _add_world_axes(table, known)
    named: dict[str, Source] = {}
    for limb in dict.fromkeys(key.removesuffix("_x").removesuffix("_y") for key in columns):
        vertical = columns.get(f"{limb}_y")
        if vertical is None:
            raise ParameterError(f"map: expected {limb}_y beside {limb}_x={columns[f'{limb}_x']}")
        forward = columns.get(f"{limb}_x")
        named[limb_name(limb.removesuffix("force"))] = Source(
            _terms(path, table, forward) if forward else [], _terms(path, table, vertical)
        )
    if not named and not known:
        repeated = [text for name, text in table.repeated.items() if _limb_and_axis(name)]
        if repeated:
            raise DataFileError(f"record {str(path)!r}: {'; '.join(repeated)}")
        where = f" in line {table.line}" if table.line else ""
        raise ParameterError(
            f"map: expected columns of {path.name} for time, force_x and force_y, as in force_y=Fz; its names"
            f"{where} are {_few(table.names)}"
        )
    limbs, notes = _renamed(path, named, known, renames)
    return limbs, str(given.get("time", "time")), notes


def _recognised(table: Table, ahead: str, upward: str) -> dict[str, Source]:
    """Limbs whose columns have names of ours or OpenSim's, or plates; those with a vertical force."""
    found: dict[str, dict[str, str]] = {
        limb: {axis: f"{limb}_{axis}" for axis in "xyz"} for limb in table.plates
    }
    for name in table.names if not table.plates else ():
        if (of := _limb_and_axis(name)) is not None:
            found.setdefault(of[0], {})[of[1]] = name
    signs = [-1 if axis.startswith("-") else 1 for axis in (ahead, upward)]
    return {
        limb: Source(
            [Term(signs[0], axes[ahead[-1]])] if ahead[-1] in axes else [],
            [Term(signs[1], axes[upward[-1]])],
            axes,
        )
        for limb, axes in found.items() if upward[-1] in axes
    }  # fmt: skip


def _limb_and_axis(name: str) -> tuple[str, str] | None:
    """The limb and the axis of a column of forces by its name, ours or OpenSim's; None of another column."""
    if (match := OURS.fullmatch(name)) is not None:
        limb = limb_name(match["limb"])
        return None if limb.endswith(("toe", "heel")) else (limb, match["axis"])
    if (match := OPENSIM.fullmatch(name)) is not None:
        return match["before"] or match["behind"] or "leg", match["axis"].lower()
    return None


def _add_world_axes(table: Table, known: dict[str, Source]) -> None:
    """Columns `plate_1_force_x` and `plate_1_force_y` beside those of the laboratory's axes, for mappings."""
    for limb, source in known.items():
        for name, (term,) in (("x", source.forward), ("y", source.upward)):
            column = f"{limb}_force_{name}"
            table.columns[column] = term.sign * table.columns[term.column]
            table.units[column] = table.units[term.column]


def _renamed(
    path: Path, named: dict[str, Source], known: dict[str, Source], renames: dict[str, str]
) -> tuple[dict[str, list[Source]], list[str]]:
    """Limbs by their new names, each from one of the file or several, and what to say of those that are left
    out because another has their name now."""
    pool = known | named
    origin: dict[str, str] = {}  # new name by limb of the file
    parts: dict[str, list[str]] = {}
    for new, text in renames.items():
        terms = _split(text, pool)
        if isinstance(terms, str) or any(sign < 0 for sign, _ in terms):
            raise ParameterError(f"map: expected a limb of {path.name} ({_few(pool)}), got {new}={text}")
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
    for limb in dict.fromkeys([*(named or known), *origin]):
        if limb in origin:
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
    """Names with "+" or "-" between them, or what cannot be read of them. Names may hold either sign: the
    longest name that fits counts."""
    ordered = sorted(names, key=len, reverse=True)
    rest = text.strip()
    found: list[Term] = []
    while True:
        sign = -1 if rest.startswith("-") and not any(rest.startswith(name) for name in ordered) else 1
        bare = rest if sign > 0 else rest[1:].lstrip()
        if sign > 0 and found and bare.startswith("+"):  # as in a+ +b
            bare = bare[1:].lstrip()
        fits = [name for name in ordered if bare.startswith(name) and bare[len(name) :].lstrip()[:1] in "+-"]
        if not fits:
            return bare or text
        found.append(Term(sign, fits[0]))
        rest = bare[len(fits[0]) :].lstrip()
        if not rest:
            return found
        rest = rest[1:].lstrip() if rest[0] == "+" else rest


def _terms(path: Path, table: Table, text: str) -> list[Term]:
    """The columns that a mapping names, by their keys; `ParameterError` of one that is not there."""
    numbers = {f"#{k}": key for k, key in enumerate(table.order, 1)}
    keys = dict.fromkeys([*table.columns, *table.unread, *table.repeated])
    terms = _split(text, numbers | keys)
    if isinstance(terms, str):
        where = f" in line {table.line}" if table.line else ""
        of = f" in {text!r}" if terms != text else ""
        raise ParameterError(
            f"map: expected a column of {path.name} (names{where}: {_few(table.names)}), got {terms!r}{of}"
        )
    for term in terms:
        if term.column in table.repeated:
            raise DataFileError(f"record {str(path)!r}: {table.repeated[term.column]}")
    return [Term(sign, name if name in keys else numbers[name]) for sign, name in terms]


def _few(names: Any) -> str:
    shown = list(names)
    return ", ".join(shown[:8]) + (f" and {len(shown) - 8} more" if len(shown) > 8 else "") or "none"


def _sum(path: Path, table: Table, terms: list[Term]) -> Floats:
    """The sum of columns; not a number if there is none."""
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
                f"record {str(path)!r}: {name}: expected finite numbers, got {values[row]} in row {row + 1}"
            )
        total += sign * values
    return total


def _others(table: Table, sources: dict[str, list[Source]]) -> dict[str, dict[str, Floats]]:
    """Sizes of the forces of limbs along all axes that the file has."""
    found: dict[str, dict[str, Floats]] = {}
    for limb, parts in sources.items():
        shared = [axis for axis in "xyz" if all(one.axes.get(axis, "") in table.columns for one in parts)]
        sizes = {axis: sum(np.abs(table.columns[one.axes[axis]]) for one in parts) for axis in shared}
        found[limb] = {axis: np.asarray(size) for axis, size in sizes.items() if np.isfinite(size).all()}
    return found
