"""Force columns of a record, limb by limb: centre of pressure on the surface, threshold and body weights."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.ground.terrain import Terrain

Columns = dict[str, NDArray[np.float64]]
"""Arrays of shape (n,) by name."""

Complex = NDArray[np.complex128]

FORCE = ("force_x", "force_y", "cop_x", "cop_y")
"""Columns of a limb that a force plate measures in the plane [N, N, m, m]; `hoof_env.lab` has the frame."""

THRESHOLD = 20.0
"""Force along the ground's normal below which a limb counts as unloaded [N]. Laboratories take 20 N for
humans and ponies, and 50 N for horses on noisy plates. A simulated force has no noise, and the lower
threshold loses less impulse."""

REACH = 0.5
"""Longest distance by which a centre of pressure is moved along its force [m]; a hoof is smaller."""

UNITS = {"N": "newtons", "BW": "body weights"}
"""Units of forces in files."""


def limbs_of(names: Iterable[str]) -> list[str]:
    """Return the prefixes of `force_y` in the names of a record: `left_fore_` and so on, or "" for one leg.

    Raises:
        ParameterError: no name ends in `force_y`.
    """
    prefixes = [name.removesuffix("force_y") for name in names if name.endswith("force_y")]
    # The forces at toe and heel are parts of a limb's force.
    limbs = [limb for limb in prefixes if not limb.endswith(("toe_", "heel_"))]
    if not limbs:
        raise ParameterError(f"record: expected a column force_y, got {', '.join(names) or 'none'}")
    return limbs


def limb_name(limb: str) -> str:
    """Return the name of a limb for messages and files, "leg" for a single leg, from its prefix."""
    return limb.removesuffix("_") or "leg"


def loaded(record: Mapping[str, NDArray[np.float64]], limb: str) -> NDArray[np.bool_]:
    """Return a mask of the rows in which a limb bears load, shape (n,)."""
    return np.hypot(record[f"{limb}force_x"], record[f"{limb}force_y"]) > 0


def onto_surface(record: Columns, terrain: Terrain) -> Columns:
    """Move every centre of pressure of a record along its force onto the ground's surface, which changes no
    moment. A centre stays where it is if the line of its force meets no ground within `REACH`."""
    moved: Columns = {}
    for limb in limbs_of(record):
        bears = loaded(record, limb)
        at = record[f"{limb}cop_x"][bears] + 1j * record[f"{limb}cop_y"][bears]
        force = record[f"{limb}force_x"][bears] + 1j * record[f"{limb}force_y"][bears]
        along = (force / np.abs(force)).astype(complex)
        way = _to_surface(at, along, terrain)
        met = at + np.where(np.isfinite(way), way, 0.0) * along
        for axis, values in (("x", met.real), ("y", met.imag)):
            column = np.zeros(len(bears))
            column[bears] = values
            moved[f"{limb}cop_{axis}"] = column
    return record | moved


def _to_surface(at: Complex, along: Complex, terrain: Terrain) -> NDArray[np.float64]:
    """Return the signed shortest ways along unit vectors from points to the surface, infinite beyond `REACH`.

    Every piece of the ground is straight, so that a line meets it in closed form. The pieces around a point
    are tried in turn, as steps from piece to piece by Newton's method diverge on zigzag ground.

    Args:
        at: points as x + i y, shape (n,) [m].
        along: unit vectors as x + i y, shape (n,).
        terrain: the ground.

    Returns:
        Ways, shape (n,) [m].
    """
    if not len(at):
        return np.zeros(0)
    height = terrain.heights
    # The ground goes on level at both ends: piece 0 lies before the first knot, the last behind the last.
    slope = np.diff(height, prepend=height[0], append=height[-1]) / terrain.spacing
    last = len(height)
    nearest = np.clip(np.floor((at.real - terrain.start) / terrain.spacing) + 1, 0, last).astype(int)
    far = min(last, math.ceil(REACH / terrain.spacing) + 1)
    best = np.full(len(at), np.inf)
    # Outward from the piece below the point, so that among equal distances the nearest piece wins.
    for step in sorted(range(-far, far + 1), key=abs):
        cell = nearest + step
        inside = (cell >= 0) & (cell <= last)
        cell = np.clip(cell, 0, last)
        # The knot at which a piece begins; the first piece ends at its knot.
        knot = np.maximum(cell - 1, 0)
        begin = terrain.start + knot * terrain.spacing
        rise = along.imag - slope[cell] * along.real
        gap = height[knot] + slope[cell] * (at.real - begin) - at.imag
        way = np.divide(gap, rise, out=np.full(len(at), np.inf), where=rise != 0)
        reach = np.abs(way) <= REACH
        x = at.real + np.where(reach, way, 0.0) * along.real
        # With some slack, so that rounding does not let a line through a knot miss both pieces.
        slack = 1e-9 * terrain.spacing + 1e-12 * np.abs(begin)
        on = (cell == 0) | (x >= begin - slack)
        on &= (cell == last) | (x <= np.where(cell == 0, begin, begin + terrain.spacing) + slack)
        nearer = inside & reach & on & (np.abs(way) < np.abs(best))
        best[nearer] = way[nearer]
    return best


def above_threshold(record: Columns, threshold: float, terrain: Terrain) -> Columns:
    """Set force and centre of pressure of a limb to 0 where its force is below a threshold, as software of
    force plates does; the forces at toe and heel stay.

    Args:
        record: the record.
        threshold: least force along the ground's normal, which a plate in the ground measures [N].
        terrain: the ground.

    Raises:
        ParameterError: the threshold is out of range.
    """
    check_number("threshold", threshold, low=0.0, high=1e6)
    kept: Columns = {}
    for limb in limbs_of(record):
        across, normal = _normal(terrain, record[f"{limb}cop_x"])
        bears = record[f"{limb}force_x"] * across + record[f"{limb}force_y"] * normal >= threshold
        kept |= {f"{limb}{name}": np.where(bears, record[f"{limb}{name}"], 0.0) for name in FORCE}
    return record | kept


def _normal(terrain: Terrain, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit normal of the surface at `x` [m], its components forward and up, shape of `x`."""
    grid = terrain.grid
    cell = np.clip(np.floor((x - grid.origin) * grid.per_metre), 0, len(grid.cells) - 1).astype(int)
    return grid.cells[cell, 2], grid.cells[cell, 3]


def in_units(record: Columns, about: Mapping[str, Any], unit: str) -> tuple[Columns, dict[str, Any]]:
    """Convert the forces of a record and its description to a unit.

    Args:
        record: the record, with forces in N.
        about: its description, with the units of its columns and the weight of the whole animal, "weight_n".
        unit: "N" changes nothing; "BW" divides forces by the weight, and moments are then in BW m.

    Raises:
        ParameterError: the unit is neither.
    """
    if check_choice("units", unit, UNITS) == "N":
        return record, dict(about)
    units = {name: old.replace("N", "BW") if _is_load(old) else old for name, old in about["units"].items()}
    weight = about["weight_n"]
    scaled = {}
    for name, values in record.items():
        scaled[name] = values / weight if _is_load(about["units"][name]) else values
    return scaled, {**about, "units": units}


def _is_load(unit: str) -> bool:
    """Return True if a unit is one of forces or moments."""
    return unit in ("N", "N m")
