"""Force records from files, ours or a laboratory's: columns, units, signs, and what limbs are called.

Text tables (.csv, .txt, .tsv) have one line of names, with units as in `force_y [N]` or `Fz (kN)`, and rows
of numbers; Parquet has the unit in a field's metadata; .mot and .sto are OpenSim's, in N and s; of a .c3d the
force plates are read, see `c3d.read_c3d`. Columns that our files and OpenSim's use are found by their names;
others are named by a mapping.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.parts import GRAVITY
from hoof_env.errors import (
    DataFileError,
    HoofEnvError,
    MissingExtraError,
    ParameterError,
    check_choice,
    check_number,
)
from hoof_env.lab.c3d import read_c3d
from hoof_env.lab.forces import limb_name

Floats = NDArray[np.float64]
Columns = dict[str, Floats]

FORCE_UNITS = ("N", "kN", "N/kg", "BW", "%BW")
"""Of measured forces; BW are body weights."""

TIMES = {"s": 1.0, "ms": 1e-3}
REVERSED = {"auto": None, "none": (1, 1), "x": (-1, 1), "y": (1, -1), "xy": (-1, -1)}
"""Which components count the other way; "auto" turns both where the vertical force points down, as that of
the limb on the plate does."""

UNEVEN = 0.01  # most that sampling intervals may differ from each other, of their mean
HEAD = re.compile(r"\s*(?P<name>.*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])])?\s*")
OPENSIM = re.compile(r"(?:(?P<before>.+)_)?ground_force_(?:(?P<behind>.+)_)?vy")


@dataclass
class Table:
    """Columns of shape (n,) and their units, as far as the file says, and the weight [N], if it does."""

    columns: Columns
    units: dict[str, str] = field(default_factory=dict)
    weight: float | None = None


@dataclass
class ForceRecord:
    """Ground reaction forces of limbs, world frame and signs of `hoof_env.lab`.

    Attributes:
        name: of the file.
        time: shape (n,), evenly spaced [s].
        limbs: forces forward and upward by limb, shape (n, 2), in `unit`.
        unit: one of `FORCE_UNITS`.
        weight: of the animal [N], or None if unknown.
        turned: whether "auto" has turned both components.
    """

    name: str
    time: Floats
    limbs: dict[str, Floats]
    unit: str
    weight: float | None = None
    turned: bool = False

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


def read_record(
    path: Path,
    mapping: Mapping[str, Any] | None = None,
    unit: str = "auto",
    reverse: str = "auto",
    rate: float | None = None,
    mass: float | None = None,
) -> ForceRecord:
    """A force record from a file.

    Args:
        path: the file.
        mapping: columns of the file by what they are: "time", "force_x" and "force_y" of one limb,
            "left_fore_force_x" and so on of several; a "-" before a column turns it round. A name of ours
            for a limb of the file, as in left_fore="plate_1", renames that.
        unit: of the forces, one of `FORCE_UNITS`; "auto" is what the file says.
        reverse: one of `REVERSED`.
        rate: samples a second [Hz], instead of a column of time.
        mass: of the animal [kg], if the file does not say its weight.

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
    table, given = _load(path), dict(mapping or {})
    limbs, time = _named(path, table, given)
    forces = {limb: [_column(path, table, name) for name in pair] for limb, pair in limbs.items()}
    first = {name.removeprefix("-") for pair in limbs.values() for name in pair if name}
    said = {table.units.get(name) for name in first}
    if unit == "auto":
        known = [one for one in FORCE_UNITS if one in said]
        if len(said) != 1 or not known:
            found = ", ".join(sorted(str(one) for one in said if one)) or "none"
            raise ParameterError(
                f"units: expected one of {', '.join(FORCE_UNITS)} for {path.name}, which says {found}"
            )
        unit = known[0]
    stacked = {limb: np.column_stack(pair) for limb, pair in forces.items()}
    times = _times(path, table, time, rate, len(next(iter(stacked.values()))))
    signs, turned = REVERSED[reverse], False
    if signs is None:
        turned = sum(float(force[:, 1].sum()) for force in stacked.values()) < 0
        signs = (-1, -1) if turned else (1, 1)
    weight = table.weight if mass is None else mass * GRAVITY
    turned_limbs = {limb: force * np.array(signs) + 0.0 for limb, force in stacked.items()}
    return ForceRecord(path.name, times, turned_limbs, unit, weight, turned)


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
    if not table.columns or min(len(values) for values in table.columns.values()) < 2:
        raise DataFileError(f"record {str(path)!r}: expected two rows of numbers or more, found fewer")
    return table


def _read_text(path: Path) -> Table:
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    if not lines:
        return Table({})
    between = max("\t;,", key=lines[0].count)
    return _table(path, lines[0], lines[1:], between, first=2)


def _read_opensim(path: Path) -> Table:
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    ends = [k for k, line in enumerate(lines) if line.strip().lower() == "endheader"]
    if not ends or len(lines) < ends[0] + 2:
        raise DataFileError(f"record {str(path)!r}: expected a line endheader and names below it")
    top = ends[0] + 1
    table = _table(path, lines[top].strip(), [line.strip() for line in lines[top + 1 :]], "\t", top + 2)
    forces = {name: "N" for name in table.columns if "force" in name and re.search(r"_(v[xyz]|[xyz])$", name)}
    return Table(table.columns, forces | {"time": "s"})


def _table(path: Path, head: str, lines: list[str], between: str, first: int) -> Table:
    names = next(csv.reader([head], delimiter=between))
    parts = [match for name in names if (match := HEAD.fullmatch(name))]
    titles = [part["name"] for part in parts]
    if len(set(titles)) < len(titles):
        raise DataFileError(f"record {str(path)!r}: expected names that differ, got {head[:80]!r}")
    rows = []
    for k, row in enumerate(csv.reader(lines, delimiter=between), first):
        if not any(cell.strip() for cell in row):
            continue
        try:
            if len(row) != len(names):
                raise ValueError(f"{len(row)} cells under {len(names)} names")
            rows.append([float(cell.replace(",", ".") if between == ";" else cell) for cell in row])
        except ValueError as error:
            got = str(error).removeprefix("could not convert string to float: ")
            raise DataFileError(f"record {str(path)!r}: line {k}: expected numbers, got {got}") from None
    table = np.array(rows).reshape(-1, len(names))
    units = {part["name"]: part["unit"] for part in parts if part["unit"]}
    return Table(dict(zip(titles, table.T, strict=True)), units)


def _read_parquet(path: Path) -> Table:
    try:
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError('Parquet needs pyarrow: pip install "hoof-env[export]"') from None
    table = parquet.read_table(path)
    units = {one.name: (one.metadata or {}).get(b"unit", b"").decode() for one in table.schema}
    about = json.loads((table.schema.metadata or {}).get(b"hoof_env", b"{}"))
    columns = {name: np.asarray(table[name].to_numpy(), float) for name in table.column_names}
    return Table(columns, units, about.get("weight_n"))


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


def _named(path: Path, table: Table, given: dict[str, Any]) -> tuple[dict[str, tuple[str, str]], str]:
    """Columns forward and upward by limb, and that of the time; "" is none."""
    columns = {key: str(value) for key, value in given.items() if key.endswith(("force_x", "force_y"))}
    time = str(given.get("time", "time"))
    known = {
        key: str(value) for key, value in given.items() if key != "time" and key not in columns
    }  # new names
    limbs: dict[str, tuple[str, str]] = {}
    if columns:
        for limb in dict.fromkeys(key.removesuffix("_x").removesuffix("_y") for key in columns):
            up = columns.get(f"{limb}_y")
            if up is None:
                raise ParameterError(f"map: expected {limb}_y beside {limb}_x={columns[f'{limb}_x']}")
            limbs[limb_name(limb.removesuffix("force"))] = (columns.get(f"{limb}_x", ""), up)
    else:
        for name in table.columns:
            if (match := OPENSIM.fullmatch(name)) is not None:
                limb = match["before"] or match["behind"] or "leg"
                limbs[limb] = (name.removesuffix("y") + "x", name)
            elif name.endswith("force_y") and not name.removesuffix("_force_y").endswith(("toe", "heel")):
                limbs[limb_name(name.removesuffix("force_y"))] = (name.removesuffix("y") + "x", name)
    if not limbs:
        raise ParameterError(
            f"map: expected columns of {path.name} for time, force_x and force_y, as in force_y=Fz; it has "
            f"{_few(table.columns)}"
        )
    for new, old in known.items():
        if old not in limbs:
            raise ParameterError(f"map: expected a limb of {path.name} ({_few(limbs)}), got {new}={old}")
    back = {old: new for new, old in known.items()}
    return {back.get(limb, limb): pair for limb, pair in limbs.items()}, time


def _few(names: Any) -> str:
    shown = list(names)
    return ", ".join(shown[:8]) + (f" and {len(shown) - 8} more" if len(shown) > 8 else "")


def _column(path: Path, table: Table, name: str) -> Floats:
    """The column of that name, turned round where "-" is before it; zeros of none."""
    if not name:
        return np.zeros(len(next(iter(table.columns.values()))))
    bare = name if name in table.columns else name.removeprefix("-")
    if bare not in table.columns:
        raise ParameterError(f"map: expected a column of {path.name} ({_few(table.columns)}), got {bare!r}")
    values = table.columns[bare]
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values)))
        raise DataFileError(
            f"record {str(path)!r}: {bare}: expected finite numbers, got {values[row]} in row {row + 1}"
        )
    return values if bare == name else -values


def _times(path: Path, table: Table, name: str, rate: float | None, n: int) -> Floats:
    """Times of the rows [s], evenly spaced."""
    if rate is not None:
        return np.arange(n) / rate
    if name not in table.columns:
        raise ParameterError(
            f"map: expected a column of {path.name} for time, as in time=Seconds, or its rate; it has "
            f"{_few(table.columns)}"
        )
    said = table.units.get(name) or "s"
    if said not in TIMES:
        raise ParameterError(f"map: expected times of {path.name} in {' or '.join(TIMES)}, got {said}")
    time = _column(path, table, name) * TIMES[said]
    steps = np.diff(time)
    mean = float(steps.mean())
    if mean <= 0 or np.abs(steps - mean).max() > UNEVEN * mean:
        raise DataFileError(
            f"record {str(path)!r}: {name}: expected times that increase evenly, got steps of "
            f"{steps.min():g} to {steps.max():g} s"
        )
    return time
