"""Force columns of a record, limb by limb: centre of pressure on the surface, threshold, body weights."""

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
"""What a force plate measures of a limb in the plane [N, N, m, m]; see `hoof_env.lab` for the frame."""

THRESHOLD = 20.0
"""Force along the ground's normal below which a limb counts as unloaded [N]. Laboratories take 20 N
for people and ponies, 50 N for horses under noisy plates. A simulated force has no noise, so the smaller one
loses less impulse."""

REACH = 0.5
"""How far along its force a centre of pressure is moved at most [m]; a hoof is smaller."""

UNITS = {"N": "newtons", "BW": "body weights"}
"""Of forces in files."""


def limbs_of(names: Iterable[str]) -> list[str]:
    """What stands before `force_y` in the names of a record: `left_fore_` and so on, or nothing, of one leg.
    `ParameterError` where there is none."""
    found = [name.removesuffix("force_y") for name in names if name.endswith("force_y")]
    limbs = [limb for limb in found if not limb.endswith(("toe_", "heel_"))]
    if not limbs:
        raise ParameterError(f"record: expected a column force_y, got {', '.join(names) or 'none'}")
    return limbs


def limb_name(limb: str) -> str:
    """For people and files; "leg" where there is only one."""
    return limb.removesuffix("_") or "leg"


def loaded(record: Mapping[str, NDArray[np.float64]], limb: str) -> NDArray[np.bool_]:
    """Where a limb bears load, shape (n,)."""
    return np.hypot(record[f"{limb}force_x"], record[f"{limb}force_y"]) > 0


def onto_surface(record: Columns, terrain: Terrain) -> Columns:
    """The record with every centre of pressure moved along its force to where that line meets the ground's
    surface, which changes no moment. A line that meets no ground within `REACH` keeps its point."""
    moved: Columns = {}
    for limb in limbs_of(record):
        bears = loaded(record, limb)
        at = record[f"{limb}cop_x"][bears] + 1j * record[f"{limb}cop_y"][bears]
        force = record[f"{limb}force_x"][bears] + 1j * record[f"{limb}force_y"][bears]
        along = (force / np.abs(force)).astype(complex)
        way = _to_surface(at, along, terrain)
        found = at + np.where(np.isfinite(way), way, 0.0) * along
        for axis, values in (("x", found.real), ("y", found.imag)):
            column = np.zeros(len(bears))
            column[bears] = values
            moved[f"{limb}cop_{axis}"] = column
    return record | moved


def _to_surface(at: Complex, along: Complex, terrain: Terrain) -> NDArray[np.float64]:
    """The shortest way [m] from points along unit vectors to the surface, infinite beyond `REACH`.

    Every piece is straight, so a line meets it in closed form. The pieces around a point are tried in turn,
    as steps from piece to piece by Newton's method run away where the ground zigzags.
    """
    height = np.array(terrain.height)
    slope = np.diff(height, prepend=height[0], append=height[-1]) / terrain.spacing  # level at both ends
    last = len(height)
    own = np.clip(np.floor((at.real - terrain.start) / terrain.spacing) + 1, 0, last).astype(int)
    far = min(last, math.ceil(REACH / terrain.spacing) + 1)
    best = np.full(len(at), np.inf)
    for step in sorted(range(-far, far + 1), key=abs):
        cell = own + step
        inside = (cell >= 0) & (cell <= last)
        cell = np.clip(cell, 0, last)
        knot = np.maximum(cell - 1, 0)  # where the piece begins, but for the first, which ends there
        begin = terrain.start + knot * terrain.spacing
        rise = along.imag - slope[cell] * along.real
        gap = height[knot] + slope[cell] * (at.real - begin) - at.imag
        way = np.divide(gap, rise, out=np.full(len(at), np.inf), where=rise != 0)
        reach = np.abs(way) <= REACH
        x = at.real + np.where(reach, way, 0.0) * along.real
        slack = 1e-9 * terrain.spacing + 1e-12 * np.abs(begin)  # a line through a knot meets either piece
        on = (cell == 0) | (x >= begin - slack)
        on &= (cell == last) | (x <= np.where(cell == 0, begin, begin + terrain.spacing) + slack)
        nearer = inside & reach & on & (np.abs(way) < np.abs(best))
        best[nearer] = way[nearer]
    return best


def above_threshold(record: Columns, threshold: float, terrain: Terrain) -> Columns:
    """The record with force and centre of pressure of a limb set to 0 wherever its force along the normal of
    the ground, which a plate in the ground measures, is below `threshold` [N], as software of force plates
    does; the forces at toe and heel stay."""
    check_number("threshold", threshold, low=0.0, high=1e6)
    kept: Columns = {}
    for limb in limbs_of(record):
        across, normal = _normal(terrain, record[f"{limb}cop_x"])
        bears = record[f"{limb}force_x"] * across + record[f"{limb}force_y"] * normal >= threshold
        kept |= {f"{limb}{name}": np.where(bears, record[f"{limb}{name}"], 0.0) for name in FORCE}
    return record | kept


def _normal(terrain: Terrain, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normal of the surface at `x` [m], forward and up."""
    grid = terrain.to_grid()
    cell = np.clip(np.floor((x - grid.origin) * grid.per_metre), 0, len(grid.cells) - 1).astype(int)
    return grid.cells[cell, 2], grid.cells[cell, 3]


def in_units(record: Columns, about: Mapping[str, Any], unit: str) -> tuple[Columns, dict[str, Any]]:
    """Record and description with forces in "N", as they are, or "BW": over `about["weight_n"]`, the weight
    of the whole animal; moments then are in BW m."""
    if check_choice("units", unit, UNITS) == "N":
        return record, dict(about)
    units = {name: old.replace("N", "BW") if _is_load(old) else old for name, old in about["units"].items()}
    weight = about["weight_n"]
    scaled = {name: values / weight if _is_load(about["units"][name]) else values
              for name, values in record.items()}  # fmt: skip
    return scaled, {**about, "units": units}


def _is_load(unit: str) -> bool:
    return unit in ("N", "N m")
