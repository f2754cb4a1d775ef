"""Closed-form motion of the linkage: position, velocity and acceleration of every point and body.

Planar vectors are complex numbers. `solve_points` finds every point in the frame of the leg, with its first
and second derivative by the crank angle theta, dyad by dyad and without iteration. `place` turns these into
motion in the world, for any motion of the crank and of the leg's frame. `pose` wraps both for people.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import check_number
from hoof_env.leg.geometry import Geometry, tables
from hoof_env.leg.linkage import HEADS, NUMBER, POINTS, TAILS
from hoof_env.simd.compile import kernel

_O, _C, _P = NUMBER["O"], NUMBER["C"], NUMBER["P"]


@kernel
def dot(a: complex, b: complex) -> float:
    """Scalar product of two planar vectors."""
    return a.real * b.real + a.imag * b.imag


@kernel
def cross(a: complex, b: complex) -> float:
    """Out-of-plane component of the vector product of two planar vectors."""
    return a.real * b.imag - a.imag * b.real


@kernel
def intersect(e1: complex, e2: complex, k1: float, k2: float) -> complex:
    """The vector p with e1 . p = k1 and e2 . p = k2."""
    return 1j * (k2 * e1 - k1 * e2) / cross(e1, e2)


@kernel
def solve_points(theta, crank, pivot, steps, values, z, dz, ddz):  # type: ignore[no-untyped-def]
    """Fill `z`, `dz`, `ddz` (complex, shape (11,)) with every point and its derivatives by the crank angle,
    in the frame of the leg with O at the origin [m, m/rad, m/rad^2].

    The crank turns clockwise, P = crank * exp(-i theta); `pivot` is C, `steps` and `values` are
    `geometry.tables`.
    """
    z[_O], dz[_O], ddz[_O] = 0.0, 0.0, 0.0
    z[_C], dz[_C], ddz[_C] = pivot, 0.0, 0.0
    z[_P] = crank * complex(np.cos(theta), -np.sin(theta))
    dz[_P] = -1j * z[_P]
    ddz[_P] = -z[_P]
    for k in range(steps.shape[0]):
        p, a, b = steps[k, 1], steps[k, 2], steps[k, 3]
        r1 = values[k, 0]
        span, dspan, ddspan = z[b] - z[a], dz[b] - dz[a], ddz[b] - ddz[a]
        if steps[k, 0] == 1:
            r2, side = values[k, 1], values[k, 2]
            d2 = dot(span, span)
            along = 0.5 + (r1 * r1 - r2 * r2) / (2.0 * d2)
            across = side * np.sqrt(r1 * r1 / d2 - along * along)
            z[p] = z[a] + span * complex(along, across)
            e1, e2 = z[p] - z[a], z[p] - z[b]
            dz[p] = intersect(e1, e2, dot(e1, dz[a]), dot(e2, dz[b]))
            w1, w2 = dz[p] - dz[a], dz[p] - dz[b]
            ddz[p] = intersect(e1, e2, dot(e1, ddz[a]) - dot(w1, w1), dot(e2, ddz[b]) - dot(w2, w2))
        else:
            origin = steps[k, 4]
            z[p] = z[origin] + r1 * span
            dz[p] = dz[origin] + r1 * dspan
            ddz[p] = ddz[origin] + r1 * ddspan


@kernel
def mirror(z: complex, travel: float) -> complex:
    """Turn a vector of the leg's frame into the world, whose x axis points forward: x -> travel * x."""
    return complex(travel * z.real, z.imag)


@kernel
def place(z, dz, ddz, theta_rate, theta_acc, phi, phi_rate, phi_acc, travel):  # type: ignore[no-untyped-def]
    """Motion relative to O, in world axes, of a point given in the frame of the leg.

    The frame has turned by phi (in its own sense, before the mirror). Returns position [m], velocity [m/s]
    and acceleration [m/s^2], all complex.
    """
    turn = complex(np.cos(phi), np.sin(phi))
    by_theta = dz * turn
    by_phi = 1j * z * turn
    velocity = by_theta * theta_rate + by_phi * phi_rate
    acceleration = (
        by_theta * theta_acc
        + by_phi * phi_acc
        + turn * (ddz * theta_rate**2 + 2j * dz * theta_rate * phi_rate - z * phi_rate**2)
    )
    return mirror(z * turn, travel), mirror(velocity, travel), mirror(acceleration, travel)


@dataclass(frozen=True)
class FrameMotion:
    """Motion of the leg's frame: its turn phi about O (before the mirror) and the motion of O in the world.

    Units: rad, rad/s, rad/s^2; m, m/s, m/s^2 for (x, y) pairs.

    Raises:
        ParameterError: a value is not finite.
    """

    phi: float = 0.0
    phi_rate: float = 0.0
    phi_acc: float = 0.0
    position: tuple[float, float] = (0.0, 0.0)
    velocity: tuple[float, float] = (0.0, 0.0)
    acceleration: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            for part in value if isinstance(value, tuple) else (value,):
                check_number(f"frame.{name}", part)


@dataclass(frozen=True)
class Pose:
    """Places, angles and their derivatives in the world (x forward, y up, angles counter-clockwise).

    Attributes:
        points, point_velocities, point_accelerations: shape (11, 2), rows in the order of `linkage.POINTS`
            [m, m/s, m/s^2].
        centres, centre_velocities, centre_accelerations: shape (14, 2), rows in the order of
            `linkage.BODIES` [m, m/s, m/s^2].
        angles, angular_velocities, angular_accelerations: shape (14,) [rad, rad/s, rad/s^2].
    """

    points: NDArray[np.float64]
    point_velocities: NDArray[np.float64]
    point_accelerations: NDArray[np.float64]
    centres: NDArray[np.float64]
    centre_velocities: NDArray[np.float64]
    centre_accelerations: NDArray[np.float64]
    angles: NDArray[np.float64]
    angular_velocities: NDArray[np.float64]
    angular_accelerations: NDArray[np.float64]

    def point(self, name: str) -> NDArray[np.float64]:
        """Position (x, y) of a named point [m]."""
        return self.points[NUMBER[name]]


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
        ParameterError: an angle, rate or acceleration is not finite.
    """
    theta = check_number("theta", theta)
    theta_rate, theta_acc = check_number("theta_rate", theta_rate), check_number("theta_acc", theta_acc)
    frame = frame or FrameMotion()
    z, dz, ddz = (np.empty(len(POINTS), dtype=np.complex128) for _ in range(3))
    steps, values = tables(geometry)
    solve_points(theta, geometry.lengths["OP"], complex(*geometry.pivot), steps, values, z, dz, ddz)
    motion = [
        place(z[k], dz[k], ddz[k], theta_rate, theta_acc,
              float(frame.phi), float(frame.phi_rate), float(frame.phi_acc), float(geometry.travel))
        for k in range(len(POINTS))
    ]  # fmt: skip
    r = np.array([m[0] for m in motion]) + complex(*frame.position)
    v = np.array([m[1] for m in motion]) + complex(*frame.velocity)
    a = np.array([m[2] for m in motion]) + complex(*frame.acceleration)
    link, dlink, ddlink = (w[HEADS] - w[TAILS] for w in (r, v, a))
    length2 = np.abs(link) ** 2
    return Pose(
        points=_xy(r),
        point_velocities=_xy(v),
        point_accelerations=_xy(a),
        centres=_xy((r[HEADS] + r[TAILS]) / 2),
        centre_velocities=_xy((v[HEADS] + v[TAILS]) / 2),
        centre_accelerations=_xy((a[HEADS] + a[TAILS]) / 2),
        angles=np.angle(link),
        angular_velocities=(np.conj(link) * dlink).imag / length2,
        angular_accelerations=(np.conj(link) * ddlink).imag / length2,
    )


def _xy(z: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.stack([z.real, z.imag], axis=-1)
