"""Instants: all that a picture, or a record of forces, shows of one time; none refers to an engine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics.names import NamedColumns
from hoof_env.gait import PARAMETERS
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry
from hoof_env.render.picture import LegPicture, Picture

Columns = dict[str, NDArray[np.float64]]
"""Arrays of shape (n,) by the names of `Instant`'s fields, for n instants in the order of time."""


Second = Annotated[float, "s"]
Metre = Annotated[float, "m"]
MetrePerSecond = Annotated[float, "m/s"]
Radian = Annotated[float, "rad"]
RadianPerSecond = Annotated[float, "rad/s"]
Newton = Annotated[float, "N"]


Hips = Mapping[str, tuple[float, float]]
"""Crank centre of each leg from the trunk's own place [m], by the prefix of the leg's names."""

ONE_HIP: Hips = MappingProxyType({"": (0.0, 0.0)})
"""Hips of a single leg, whose names have no prefix and whose O is the place of the trunk."""


class Surroundings(NamedTuple):
    """Surroundings of the motion that pictures and files show.

    Attributes:
        geometry, terrain: the leg and what it stands on.
        trunk: its kind, one of `dynamics.parts.TRUNKS`.
        weight_n: weight of trunk and legs [N], 0 if it is not known.
        lift_off_n: normal force on a hoof that tells stance from swing [N].
        hips: crank centres by the prefixes of the legs.
        picture: scene, panel and drawing that show the body.
    """

    geometry: Geometry
    terrain: Terrain = Terrain.flat()
    trunk: str = "suspended"
    weight_n: float = 0.0
    lift_off_n: float = 0.0
    hips: Hips = ONE_HIP
    picture: Picture = LegPicture()


class Instant(NamedTuple):
    """One instant of one leg, in the world: x forward, y up, angles counter-clockwise; SI units and radians.

    `x`, `y` are the place of the crank centre O, where the trunk of one leg is, and `vx`, `vy` its velocity;
    `pitch` turns the trunk. Crank angle and swing angle are in the leg's own sense. A normal
    and a friction force act along the ground's normal and tangent on a hoof point, and together they are
    (force_x, force_y); depth is penetration, negative in the air. The hoof's own (force_x, force_y) is the
    sum; its point of application, the centre of pressure (cop_x, cop_y), is where the moment of both forces
    is zero, and it is 0, 0 without load, as force plates report it. What an engine does not say is NaN.
    """

    time: Second
    x: Metre
    y: Metre
    vx: MetrePerSecond
    vy: MetrePerSecond
    pitch: Radian
    crank_angle: Radian
    crank_angle_rate: RadianPerSecond
    swing_angle: Radian
    swing_offset: Radian
    swing_sin: Radian
    swing_cos: Radian
    command_crank_speed: RadianPerSecond
    command_swing_offset: Radian
    command_swing_sin: Radian
    command_swing_cos: Radian
    toe_x: Metre
    toe_y: Metre
    toe_depth: Metre
    toe_normal: Newton
    toe_friction: Newton
    toe_force_x: Newton
    toe_force_y: Newton
    heel_x: Metre
    heel_y: Metre
    heel_depth: Metre
    heel_normal: Newton
    heel_friction: Newton
    heel_force_x: Newton
    heel_force_y: Newton
    force_x: Newton
    force_y: Newton
    cop_x: Metre
    cop_y: Metre

    @property
    def normal(self) -> float:
        """Normal force on the hoof [N]."""
        return self.toe_normal + self.heel_normal

    @property
    def grf(self) -> float:
        """Size of the ground reaction force [N]."""
        return float((self.force_x**2 + self.force_y**2) ** 0.5)


class BodyInstant(NamedTuple):
    """One instant of a body: place, velocity and pitch of its trunk, and the instant of each leg."""

    time: Second
    x: Metre
    y: Metre
    vx: MetrePerSecond
    vy: MetrePerSecond
    pitch: Radian
    legs: tuple[Instant, ...]


OF_TRUNK = BodyInstant._fields[:-1]
"""Columns of a body besides those of its legs."""

POINTS = ("toe", "heel")

UNITS = {name: kind.__metadata__[0] for name, kind in get_type_hints(Instant, include_extras=True).items()}
"""Unit of each field of `Instant`."""


def leg_instants(columns: Mapping[str, NDArray[np.float64]], prefix: str = "") -> list[Instant]:
    """Return the instants of the leg whose columns have this prefix, one for each row."""
    values = (columns[f"{prefix}{name}"].tolist() for name in Instant._fields)
    return list(map(Instant._make, zip(*values, strict=True)))


def instants(
    columns: Mapping[str, NDArray[np.float64]], prefixes: Iterable[str] = ONE_HIP
) -> list[BodyInstant]:
    """Return the instants of a body whose legs' columns have these prefixes, one for each row."""
    of_legs = zip(*(leg_instants(columns, prefix) for prefix in prefixes), strict=True)
    of_trunk = zip(*(columns[name].tolist() for name in OF_TRUNK), strict=True)
    return [BodyInstant._make((*trunk, legs)) for trunk, legs in zip(of_trunk, of_legs, strict=True)]


def columns_of(
    record: Mapping[str, NDArray[Any]],
    hips: Hips,
    terrain: Terrain | None = None,
    *,
    commands: NDArray[np.float64] | None = None,
) -> Columns:
    """Return the columns of a body from what `TrunkEngine` says of an environment: `OF_TRUNK`, and those of
    each leg with its prefix.

    Args:
        record: `engine.state | engine.report`, for one instant, or what `engine.run` returns.
        hips: crank centres by the prefixes of the legs.
        terrain: what the engine stands on; level if None.
        commands: gait parameters commanded, shape (n, legs, parameters), or (1, legs, parameters) for all
            instants; None if not known.
    """
    columns: Columns = {name: np.atleast_1d(record[name][..., 0]).astype(float) for name in OF_TRUNK}
    for i, (prefix, hip) in enumerate(hips.items()):
        wanted = None if commands is None else commands[:, i, :4]
        own = columns_of_engine(record, terrain, command=wanted, leg=i, hip=hip)
        columns |= {f"{prefix}{name}": values for name, values in own.items()}
    return NamedColumns(columns)


def body_units(of_leg: Mapping[str, str], prefixes: Iterable[str]) -> dict[str, str]:
    """Return the columns of a body's record with their units, from those of a single leg: those of the trunk,
    and those of each leg with its prefix."""
    found = {name: UNITS[name] for name in OF_TRUNK}
    own = {name: unit for name, unit in of_leg.items() if name not in OF_TRUNK}
    return found | {f"{prefix}{name}": unit for prefix in prefixes for name, unit in own.items()}


def columns_of_engine(
    record: Mapping[str, NDArray[Any]],
    terrain: Terrain | None = None,
    *,
    command: ArrayLike | None = None,
    leg: int = 0,
    hip: tuple[float, float] = (0.0, 0.0),
) -> Columns:
    """Columns of a leg from what `TrunkEngine` says of an environment.

    Args:
        record: `engine.state | engine.report`, for one instant, or what `engine.run` returns.
        terrain: what the engine stands on; level if None.
        command: gait parameters commanded, shape (4,) or (n, 4); None if not known.
        leg: which.
        hip: where its O is, from the trunk's own place [m].
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
    for point in POINTS:
        x, y, normal, friction = (of_leg[f"{point}_{name}"] for name in ("x", "y", "normal", "friction"))
        height, across = ground_at(ground, x)
        force = (normal - 1j * friction) * across  # the tangent is the normal turned clockwise
        columns |= {
            f"{point}_x": x,
            f"{point}_y": y,
            f"{point}_depth": (height - y) * across.imag,
            f"{point}_normal": normal,
            f"{point}_friction": friction,
            f"{point}_force_x": force.real,
            f"{point}_force_y": force.imag,
        }
    return NamedColumns(columns | _together(columns))


_LEG = (
    "crank_angle",
    "crank_angle_rate",
    "swing_angle",
    *PARAMETERS[1:],
    *(f"{point}_{name}" for point in POINTS for name in ("x", "y", "normal", "friction")),
)


def ground_at(terrain: Terrain, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Height [m] of the ground at `x` [m] and its unit normal as a complex number, of the piece that a point
    there meets."""
    place = (x - terrain.start) / terrain.spacing
    heights = terrain.heights
    last = len(heights) - 1
    before = np.clip(np.floor(place), -1, last)  # the knot before x; -1 and the last lead to level ground
    knots = before.astype(int)
    begin = heights[np.maximum(knots, 0)]
    rise = heights[np.minimum(knots + 1, last)] - begin
    normal = (terrain.spacing * 1j - rise) / np.hypot(terrain.spacing, rise)
    return begin + np.where(rise != 0, (place - before) * rise, 0.0), normal


@np.errstate(invalid="ignore", over="ignore")  # what is not finite is left out later
def _together(columns: Columns) -> Columns:
    """Force on the hoof and its centre of pressure: the point nearest to the mean of both hoof points,
    weighted by their normal forces, about which the two forces have no moment."""
    at = [columns[f"{point}_x"] + 1j * columns[f"{point}_y"] for point in POINTS]
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
    return {"force_x": force.real, "force_y": force.imag, "cop_x": cop.real, "cop_y": cop.imag}
