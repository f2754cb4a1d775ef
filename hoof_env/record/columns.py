"""Columns of a record: an array for each field of an `Instant`, from the engine's state and report."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.gait import PARAMETERS
from hoof_env.ground.terrain import Terrain
from hoof_env.record.instant import OF_TRUNK, POINTS, UNITS
from hoof_env.record.surroundings import Hips

Columns = dict[str, NDArray[np.float64]]
"""Arrays of shape (n,) by the names of `Instant`'s fields, for n instants in the order of time."""


RECORD = {name: unit for name, unit in UNITS.items() if name not in PARAMETERS[1:]} | {"free_moment": "N m"}
"""Units of an exported record's columns: fields of `Instant` without the swing's parameters, which are known
at the end of a control step only. The free moment about the centre of pressure is 0."""


def columns_of(
    record: Mapping[str, NDArray[Any]],
    hips: Hips,
    terrain: Terrain | None = None,
    *,
    commands: NDArray[np.float64] | None = None,
    hoof_length: float = 0.0,
) -> Columns:
    """Return the columns of a body from the engine's record of one environment: `OF_TRUNK`, and for each leg
    the columns of `columns_of_engine` with the leg's prefix.

    Args:
        record: `engine.state | engine.report` for one instant, or the result of `engine.run`.
        hips: crank centres by the prefixes of the legs.
        terrain: the engine's terrain; level if None.
        commands: commanded gait parameters, shape (n, legs, parameters), or (1, legs, parameters) for all
            instants; None if unknown.
        hoof_length: length of the hooves' springs [m]; see `columns_of_engine`.
    """
    columns: Columns = {name: np.atleast_1d(record[name][..., 0]).astype(float) for name in OF_TRUNK}
    for i, (prefix, hip) in enumerate(hips.items()):
        wanted = None if commands is None else commands[:, i, :4]
        own = columns_of_engine(record, terrain, command=wanted, leg=i, hip=hip, hoof_length=hoof_length)
        columns |= {f"{prefix}{name}": values for name, values in own.items()}
    return columns


def body_units(of_leg: Mapping[str, str], prefixes: Iterable[str]) -> dict[str, str]:
    """Return the units of a body's columns from the units of a single leg's: each leg's columns have its
    prefix, and the trunk has separate columns."""
    found = {name: UNITS[name] for name in OF_TRUNK}
    own = {name: unit for name, unit in of_leg.items() if name not in OF_TRUNK}
    return found | {f"{prefix}{name}": unit for prefix in prefixes for name, unit in own.items()}


def joined(parts: Sequence[Columns], units: Collection[str]) -> Columns:
    """Join the parts of an episode to one record with the columns of `units`, in their order; the free
    moment, which is not a column of an episode, comes last."""
    record = {name: np.concatenate([part[name] for part in parts]) for name in units if name in parts[0]}
    moments = [name for name in units if name.endswith("free_moment")]
    return record | {name: np.zeros(len(record["time"])) for name in moments}


def columns_of_engine(
    record: Mapping[str, NDArray[Any]],
    terrain: Terrain | None = None,
    *,
    command: ArrayLike | None = None,
    leg: int = 0,
    hip: tuple[float, float] = (0.0, 0.0),
    hoof_length: float = 0.0,
) -> Columns:
    """Return the columns of a leg from the engine's record of one environment.

    Args:
        record: `engine.state | engine.report` for one instant, or the result of `engine.run`.
        terrain: the engine's terrain; level if None.
        command: commanded gait parameters, shape (4,) or (n, 4); None if unknown.
        leg: index of the leg.
        hip: its crank centre O relative to the trunk's place [m].
        hoof_length: length of the hooves' springs [m]; toe and heel are the soles' then, and the forces act
            along lines through the leg's hoof points; see `dynamics.parts.HoofSpring`.
    """
    ground = Terrain.flat() if terrain is None else terrain
    of_trunk = {name: np.atleast_1d(record[name][..., 0]).astype(float) for name in OF_TRUNK}
    of_leg = {name: np.atleast_1d(record[name][..., leg, 0]).astype(float) for name in _LEG}
    n = len(of_trunk["time"])
    wanted = np.broadcast_to(np.nan if command is None else np.asarray(command, float), (n, 4))
    if any(hip):
        arm = complex(*hip) * np.exp(1j * of_trunk["pitch"])
        turning = 1j * arm * np.atleast_1d(record["pitch_rate"][..., 0])
        of_trunk["x"], of_trunk["y"] = of_trunk["x"] + arm.real, of_trunk["y"] + arm.imag
        of_trunk["vx"], of_trunk["vy"] = of_trunk["vx"] + turning.real, of_trunk["vy"] + turning.imag
    columns = {
        "time": of_trunk["time"],
        **{name: of_trunk[name] for name in ("x", "y", "vx", "vy", "pitch")},
        **{name: of_leg[name] for name in ("crank_angle", "crank_angle_rate", "swing_angle")},
        **{name: of_leg[name] for name in PARAMETERS[1:]},
        **{f"command_{name}": wanted[:, k].copy() for k, name in enumerate(PARAMETERS)},
    }
    borne_at = []
    for point in POINTS:
        x, y, normal, friction = (of_leg[f"{point}_{name}"] for name in ("x", "y", "normal", "friction"))
        height, across = ground_at(ground, x)
        force = (normal - 1j * friction) * across  # the tangent is the normal turned clockwise
        borne_at.append(x + 1j * y)
        if hoof_length:
            deflection = np.atleast_1d(record[f"{point}_deflection_normal"][..., leg, 0])
            sole = borne_at[-1] - across * (hoof_length - deflection)
            x, y = sole.real, sole.imag
            height, _ = ground_at(ground, x)
        columns |= {
            f"{point}_x": x,
            f"{point}_y": y,
            f"{point}_depth": (height - y) * across.imag,
            f"{point}_normal": normal,
            f"{point}_friction": friction,
            f"{point}_force_x": force.real,
            f"{point}_force_y": force.imag,
        }
    return columns | _together(columns, borne_at)


_LEG = (
    "crank_angle",
    "crank_angle_rate",
    "swing_angle",
    *PARAMETERS[1:],
    *(f"{point}_{name}" for point in POINTS for name in ("x", "y", "normal", "friction")),
)


def ground_at(terrain: Terrain, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return the height [m] of the ground at `x` [m], and the unit normal, a complex number, of the segment
    that a point there touches."""
    place = (x - terrain.start) / terrain.spacing
    heights = terrain.heights
    last = len(heights) - 1
    before = np.clip(np.floor(place), -1, last)  # the knot before x; -1 and the last lead to level ground
    knots = before.astype(int)
    begin = heights[np.maximum(knots, 0)]
    rise = heights[np.minimum(knots + 1, last)] - begin
    normal = (terrain.spacing * 1j - rise) / np.hypot(terrain.spacing, rise)
    return begin + np.where(rise != 0, (place - before) * rise, 0.0), normal


@np.errstate(invalid="ignore", over="ignore")  # rows that are not finite are left out later
def _together(columns: Columns, at: Sequence[NDArray[np.complex128]]) -> Columns:
    """Return the force on the hoof and its centre of pressure: of all points about which the two forces have
    no moment, the nearest to the mean of both hoof points, weighted by their normal forces. The forces act on
    the leg `at` two points; where its soles are below them, the centre is at the height of the soles."""
    forces = [columns[f"{point}_force_x"] + 1j * columns[f"{point}_force_y"] for point in POINTS]
    normals = [columns[f"{point}_normal"] for point in POINTS]
    force = forces[0] + forces[1]
    normal = normals[0] + normals[1]
    loaded = (normal > 0) & (np.abs(force) > 0)
    load = np.where(loaded, normal, 1.0)
    size = np.where(loaded, np.abs(force), 1.0)
    mean = (normals[0] * at[0] + normals[1] * at[1]) / load
    moment = sum((np.conj(z - mean) * f).imag for z, f in zip(at, forces, strict=True))
    # a force F moved by d turns with Im(conj(d) F); d = -i moment F / |F|^2 has exactly `moment`
    cop = np.where(loaded, mean - 1j * moment * force / size**2, 0.0)
    soles = [columns[f"{point}_x"] + 1j * columns[f"{point}_y"] for point in POINTS]
    if not all(np.array_equal(sole, point, equal_nan=True) for sole, point in zip(soles, at, strict=True)):
        height = sum(n * sole.imag for n, sole in zip(normals, soles, strict=True)) / load
        along = np.where(loaded, force / np.where(loaded, force.imag, 1.0), 0.0)
        cop = cop + along * (height - cop.imag)
    return {"force_x": force.real, "force_y": force.imag, "cop_x": cop.real, "cop_y": cop.imag}
