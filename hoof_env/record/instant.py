"""Instants: the state of a leg or a body, and the forces on it, at one time. They hold numbers only and refer
to no engine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from hoof_env.record.surroundings import ONE_HIP

Second = Annotated[float, "s"]
Metre = Annotated[float, "m"]
MetrePerSecond = Annotated[float, "m/s"]
Radian = Annotated[float, "rad"]
RadianPerSecond = Annotated[float, "rad/s"]
Newton = Annotated[float, "N"]


class Instant(NamedTuple):
    """One instant of one leg, in the world: x forward, y up, angles counter-clockwise; SI units and radians.

    `x`, `y` are the place of the crank centre O, where the trunk of one leg is, and `vx`, `vy` its velocity;
    `pitch` turns the trunk. Crank angle and swing angle are in the leg's own sense. A normal
    and a friction force act along the ground's normal and tangent on a hoof point, and together they are
    (force_x, force_y); depth is penetration, negative in the air. The hoof's own (force_x, force_y) is the
    sum; its point of application, the centre of pressure (cop_x, cop_y), is where the moment of both forces
    is zero, and it is 0, 0 without load, as force plates report it. Quantities that an engine does not report
    are NaN.
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
"""Columns of a body's trunk."""

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
