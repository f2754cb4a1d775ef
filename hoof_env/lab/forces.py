"""Force columns of a record, limb by limb: centre of pressure on the surface, threshold, body weights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.ground.terrain import Terrain

Columns = dict[str, NDArray[np.float64]]
"""Arrays of shape (n,) by name."""

FORCE = ("force_x", "force_y", "cop_x", "cop_y")
"""What a force plate measures of a limb in the plane [N, N, m, m]; see `hoof_env.lab` for the frame."""

THRESHOLD = 20.0
"""Vertical force below which a limb counts as unloaded [N]. Laboratories take 20 N for people and ponies, 50
N for horses under noisy plates. A simulated force has no noise, so the smaller one loses less impulse."""

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
    """The record with every centre of pressure moved along its force onto the ground's surface, which changes
    no moment. Between the pieces of a bent surface it may stay some 1e-9 m away."""
    moved: Columns = {}
    for limb in limbs_of(record):
        bears = loaded(record, limb)
        x, y = (record[f"{limb}cop_{axis}"][bears] for axis in "xy")
        across, up = (record[f"{limb}force_{axis}"][bears] for axis in "xy")
        span = 1e-3  # of x, to read the slope from [m]
        for _ in range(8):  # Newton's method; on one slope the first step arrives
            height = terrain.height_at(x)
            slope = (terrain.height_at(x + span / 2) - terrain.height_at(x - span / 2)) / span
            way = (height - y) / (up - slope * across)  # never 0: the force lies within the cone of friction
            x, y = x + way * across, y + way * up
        for axis, values in (("x", x), ("y", y)):
            column = np.zeros(len(bears))
            column[bears] = values
            moved[f"{limb}cop_{axis}"] = column
    return record | moved


def above_threshold(record: Columns, threshold: float) -> Columns:
    """The record with force and centre of pressure of a limb set to 0 wherever its vertical force is below
    `threshold` [N], as software of force plates does; the forces at toe and heel stay."""
    check_number("threshold", threshold, low=0.0, high=1e6)
    kept: Columns = {}
    for limb in limbs_of(record):
        bears = record[f"{limb}force_y"] >= threshold
        kept |= {f"{limb}{name}": np.where(bears, record[f"{limb}{name}"], 0.0) for name in FORCE}
    return record | kept


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
