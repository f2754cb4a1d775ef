"""Closed-form motion of the linkage: position, velocity and acceleration of every point and body.

Planar vectors are complex numbers. `closed_form.solve_points` finds every point in the frame of the leg, with
its first and second derivative by the crank angle theta, step by step and without iteration. `place` turns
these into motion in the world, for any motion of the crank and of the leg's frame. `pose` wraps both for
people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, brief, check_choice, check_number, one_of
from hoof_env.leg.assembly import centres, solve
from hoof_env.leg.checks import count_of
from hoof_env.leg.closed_form import Vectors
from hoof_env.leg.mechanism import Mechanism

if TYPE_CHECKING:
    from hoof_env.leg.geometry import Geometry


def mirror(z: complex, travel: float) -> complex:
    """Turn a vector of the leg's frame into the world, whose x axis points forward: x -> travel * x."""
    return complex(travel * z.real, z.imag)


def place(
    z: Vectors,
    dz: Vectors,
    ddz: Vectors,
    theta_rate: float,
    theta_acc: float,
    phi: float,
    phi_rate: float,
    phi_acc: float,
    travel: float,
) -> tuple[Vectors, Vectors, Vectors]:
    """Motion relative to O, in world axes, of points given in the frame of the leg.

    The frame has turned by phi (in its own sense, before the mirror). Returns position [m], velocity [m/s]
    and acceleration [m/s^2].
    """
    turn = Vectors(math.cos(phi), math.sin(phi))
    by_theta = dz * turn
    by_phi = z.turned_left() * turn
    velocity = by_theta * theta_rate + by_phi * phi_rate
    acceleration = (
        by_theta * theta_acc
        + by_phi * phi_acc
        + turn
        * (
            ddz * (theta_rate * theta_rate)
            + (2.0 * dz).turned_left() * theta_rate * phi_rate
            - z * (phi_rate * phi_rate)
        )
    )
    position, velocity, acceleration = (
        Vectors(travel * w.real, w.imag) for w in (z * turn, velocity, acceleration)
    )
    return position, velocity, acceleration


@dataclass(frozen=True)
class FrameMotion:
    """Motion of the leg's frame: its turn phi about O (before the mirror) and the motion of O in the world.

    Units: rad, rad/s, rad/s^2; m, m/s, m/s^2 for (x, y) pairs.

    Raises:
        ParameterError: a value is not finite, or no pair of numbers where one is expected.
    """

    phi: float = 0.0
    phi_rate: float = 0.0
    phi_acc: float = 0.0
    position: tuple[float, float] = (0.0, 0.0)
    velocity: tuple[float, float] = (0.0, 0.0)
    acceleration: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("phi", "phi_rate", "phi_acc"):
            object.__setattr__(self, name, check_number(f"frame.{name}", getattr(self, name)))
        for name in ("position", "velocity", "acceleration"):
            pair = getattr(self, name)
            if count_of(pair) != 2:
                raise ParameterError(f"frame.{name}: expected two numbers (x, y), got {brief(pair)}")
            object.__setattr__(self, name, tuple(check_number(f"frame.{name}", part) for part in pair))


@dataclass(frozen=True)
class Pose:
    """Places, angles and their derivatives in the world (x forward, y up, angles counter-clockwise).

    Attributes:
        mechanism: structure of the leg, with the names of points and bodies.
        points, point_velocities, point_accelerations: shape (points, 2), rows in the order of
            `Mechanism.points` [m, m/s, m/s^2].
        centres, centre_velocities, centre_accelerations: of mass, shape (bodies, 2), rows in the order of
            `Mechanism.bodies` [m, m/s, m/s^2].
        angles, angular_velocities, angular_accelerations: from tail to head, shape (bodies,)
            [rad, rad/s, rad/s^2].
    """

    mechanism: Mechanism
    points: NDArray[np.float64]
    point_velocities: NDArray[np.float64]
    point_accelerations: NDArray[np.float64]
    centres: NDArray[np.float64]
    centre_velocities: NDArray[np.float64]
    centre_accelerations: NDArray[np.float64]
    angles: NDArray[np.float64]
    angular_velocities: NDArray[np.float64]
    angular_accelerations: NDArray[np.float64]

    def __repr__(self) -> str:
        points, bodies = ", ".join(self.mechanism.points), len(self.angles)
        return f"<Pose: points, shape {self.points.shape}, of {points}; {bodies} bodies; point(name) is one>"

    def point(self, name: str) -> NDArray[np.float64]:
        """Position (x, y) of a named point [m].

        Raises:
            ParameterError: the mechanism has no such point.
        """
        check_choice("point", name, self.mechanism.points)
        return self.points[self.mechanism.number[name]]


def pose(
    geometry: Geometry,
    theta: float,
    theta_rate: float = 0.0,
    theta_acc: float = 0.0,
    frame: FrameMotion | None = None,
) -> Pose:
    """Position, velocity and acceleration of every point and body for one state of crank and frame.

    Args:
        geometry: the leg.
        theta, theta_rate, theta_acc: crank angle relative to the leg's frame, positive clockwise in that
            frame [rad, rad/s, rad/s^2].
        frame: motion of the leg's frame; at rest at the origin if None.

    Raises:
        ParameterError: an angle, rate or acceleration is not finite, or leg or frame have another type.
    """
    theta = check_number("theta", theta)
    theta_rate, theta_acc = check_number("theta_rate", theta_rate), check_number("theta_acc", theta_acc)
    frame = FrameMotion() if frame is None else one_of("frame", frame, FrameMotion)
    mechanism = getattr(geometry, "mechanism", None)
    if not isinstance(mechanism, Mechanism):
        raise ParameterError(f"geometry: expected Geometry, got {brief(geometry)}")
    z, dz, ddz = (Vectors(w.real[0], w.imag[0]) for w in solve(geometry, [theta]))
    swing = frame.phi, frame.phi_rate, frame.phi_acc
    motion = place(z, dz, ddz, theta_rate, theta_acc, *swing, float(geometry.travel))
    drift = frame.position, frame.velocity, frame.acceleration
    r, v, a = (_complex(w) + complex(*of_frame) for w, of_frame in zip(motion, drift, strict=True))
    link, dlink, ddlink = (w[mechanism.heads] - w[mechanism.tails] for w in (r, v, a))
    length2 = np.abs(link) ** 2
    return Pose(
        mechanism=mechanism,
        points=_xy(r),
        point_velocities=_xy(v),
        point_accelerations=_xy(a),
        centres=_xy(centres(geometry, r, mirrored=True)),
        centre_velocities=_xy(centres(geometry, v, mirrored=True)),
        centre_accelerations=_xy(centres(geometry, a, mirrored=True)),
        angles=np.angle(link),
        angular_velocities=(np.conj(link) * dlink).imag / length2,
        angular_accelerations=(np.conj(link) * ddlink).imag / length2,
    )


def _complex(z: Vectors) -> NDArray[np.complex128]:
    result = np.empty(len(z.real), np.complex128)
    result.real, result.imag = z.real, z.imag
    return result


def _xy(z: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.stack([z.real, z.imag], axis=-1)
