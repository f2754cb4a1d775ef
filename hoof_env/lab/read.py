"""Force records from files, ours or a laboratory's: columns, signs, times, and what limbs are called.

`lab.tables` reads the files. Columns that our files and OpenSim's use are found by their names; others are
named by a mapping. Columns that nobody asks for may hold anything.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.parts import GRAVITY
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError, check_choice, check_number
from hoof_env.lab.forces import limb_name
from hoof_env.lab.tables import READERS, Table

Floats = NDArray[np.float64]

FORCE_UNITS = ("N", "kN", "N/kg", "BW", "%BW")
"""Of measured forces; BW are body weights."""

TIMES = {"s": 1.0, "ms": 1e-3}
REVERSED = {"auto": None, "none": (1, 1), "x": (-1, 1), "y": (1, -1), "xy": (-1, -1)}
"""Which components count the other way; "auto" turns both of every limb whose vertical force points down, as
that of the limb on the plate does."""

STRONG, IDLE = 0.2, 0.05
"""Share of the highest vertical force of a limb from which on samples tell its direction, so that an offset
does not; and share of that of all limbs up to which a limb has no direction."""

UNEVEN = 0.01  # most that sampling intervals may differ from each other, of their mean
OPENSIM = re.compile(r"(?:(?P<before>.+)_)?ground_force_(?:(?P<behind>.+)_)?vy")


@dataclass
class ForceRecord:
    """Ground reaction forces of limbs, world frame and signs of `hoof_env.lab`.

    Attributes:
        name: of the file.
        time: shape (n,), evenly spaced [s].
        limbs: forces forward and upward by limb, shape (n, 2), in `unit`; forward is not a number where the
            file has no such force.
        unit: one of `FORCE_UNITS`.
        weight: of the animal [N], or None if unknown.
        signs: what components forward and upward of a limb in the file are multiplied with; (1, 1) of others.
        turned: limbs of which "auto" has turned both components.
    """

    name: str
    time: Floats
    limbs: dict[str, Floats]
    unit: str
    weight: float | None = None
    signs: dict[str, tuple[int, int]] = field(default_factory=dict)
    turned: tuple[str, ...] = ()

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
    columns = {limb: [_column(path, table, name) for name in pair] for limb, pair in limbs.items()}
    first = {name.removeprefix("-") for pair in limbs.values() for name in pair if name}
    said = {table.units.get(name) for name in first}
    if unit == "auto":
        known = [one for one in FORCE_UNITS if one in said]
        if len(said) != 1 or not known:
            found = ", ".join(sorted(str(one) for one in said if one)) or "none"
            raise ParameterError(
                f"units: expected one of {', '.join(FORCE_UNITS)} for {path.name}, which says {found}; name "
                "it by --units-a or --units-b"
            )
        unit = known[0]
    stacked = {limb: np.column_stack(pair) for limb, pair in columns.items()}
    times = _times(path, table, time, rate, len(next(iter(stacked.values()))))
    chosen = REVERSED[reverse]
    down = _downward(stacked) if chosen is None else []
    signs = {limb: chosen or ((-1, -1) if limb in down else (1, 1)) for limb in stacked}
    weight = table.weight if mass is None else mass * GRAVITY
    forces = {limb: force * np.array(signs[limb]) + 0.0 for limb, force in stacked.items()}
    return ForceRecord(path.name, times, forces, unit, weight, signs, tuple(down))


def _downward(forces: dict[str, Floats]) -> list[str]:
    """Limbs whose vertical force points down. Each limb is looked at alone, as one plate may lie the other
    way round; what is hardly loaded points nowhere."""
    highest = {limb: float(np.abs(force[:, 1]).max()) for limb, force in forces.items()}
    least = IDLE * max(highest.values())
    return [
        limb for limb, force in forces.items()
        if highest[limb] > least and force[np.abs(force[:, 1]) > STRONG * highest[limb], 1].sum() < 0
    ]  # fmt: skip


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
        for name in table.names:
            if (match := OPENSIM.fullmatch(name)) is not None:
                limb = match["before"] or match["behind"] or "leg"
                limbs[limb] = (_forward(table, name), name)
            elif name.endswith("force_y") and not name.removesuffix("_force_y").endswith(("toe", "heel")):
                limbs[limb_name(name.removesuffix("force_y"))] = (_forward(table, name), name)
    if not limbs:
        raise ParameterError(
            f"map: expected columns of {path.name} for time, force_x and force_y, as in force_y=Fz; it has "
            f"{_few(table.names)}"
        )
    for new, old in known.items():
        if old not in limbs:
            raise ParameterError(f"map: expected a limb of {path.name} ({_few(limbs)}), got {new}={old}")
    back = {old: new for new, old in known.items()}
    return {back.get(limb, limb): pair for limb, pair in limbs.items()}, time


def _forward(table: Table, upward: str) -> str:
    """The column beside the vertical force; "" if there is none."""
    name = upward.removesuffix("y") + "x"
    return name if name in table.names else ""


def _few(names: Any) -> str:
    shown = list(names)
    return ", ".join(shown[:8]) + (f" and {len(shown) - 8} more" if len(shown) > 8 else "")


def _column(path: Path, table: Table, name: str) -> Floats:
    """The column of that name, turned round where "-" is before it; not a number if there is none."""
    if not name:
        return np.full(table.rows, np.nan)
    bare = name if name in table.names else name.removeprefix("-")
    if bare in table.unread:
        raise DataFileError(f"record {str(path)!r}: {table.unread[bare]}")
    if bare not in table.columns:
        raise ParameterError(f"map: expected a column of {path.name} ({_few(table.names)}), got {bare!r}")
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
    if name not in table.names:
        raise ParameterError(
            f"map: expected a column of {path.name} for time, as in time=Seconds, or its rate (--rate-a, "
            f"--rate-b); it has "
            f"{_few(table.names)}"
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
            f"{steps.min():g} to {steps.max():g} s; if they are only rounded, give the rate instead "
            "(--rate-a, --rate-b)"
        )
    return time
