"""Outlines of legs and trunks in metres, which films and pages share; they need no library that draws."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from hoof_env.gait import LIMITS
from hoof_env.leg.assembly import solve
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import pose
from hoof_env.record.instant import Instant

TRUNK_M = (1.05, 0.42, 0.16)  # the trunk about O: half its length, its height above and below [m]
USUAL_HIP_M = 1.5
"""Least hip height with trunk and arrows in full size [m]; for lower hips they shrink in proportion."""

AROUND_M = np.linspace(-1.5, 1.5, 31)  # places about O, whose mean ground is the camera's level [m]
ARROW_M = 1.3  # length of an arrow of the full scale, drawn in full size [m]
MIN_FORCE_SHARE = 0.004  # least drawn force / full scale [-]
HOLD_M = 0.1  # height above the trunk of the rail or plate that holds it [m]
HORN_SHARE = 0.45  # part of the hoof triangle, from the sole up, that is horn; above it is the pastern [-]

SOLE_M = 0.14  # least length of a sole that springs hold below the leg [m]

Part = tuple[tuple[float, float], tuple[float, float], float, float]
"""Part of an animal with round ends: from and to about the trunk's centre of mass, radii [m]."""

BODY: tuple[Part, ...] = (
    ((-0.62, 0.10), (-0.05, 0.02), 0.34, 0.33),
    ((-0.05, 0.02), (0.72, 0.02), 0.33, 0.36),
    ((0.80, 0.16), (1.38, 0.74), 0.28, 0.15),
    ((1.40, 0.78), (1.78, 0.46), 0.15, 0.085),
)
"""Barrel, neck and head of a horse with hips 1.4 m high."""
EAR: Part = ((1.36, 0.86), (1.38, 1.06), 0.05, 0.015)
TAIL: Part = ((-0.93, 0.22), (-1.15, -0.42), 0.05, 0.025)
HORSE_HIP_M = 1.4
FAR = (0, 2)
"""Left legs of a horse, which are drawn behind its trunk: it heads right, and shows its right side."""


class LegOutline:
    """Places of a leg's named points.

    Args:
        geometry: the leg.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry

    def points(self, now: Instant) -> NDArray[np.complex128]:
        """Return the place of each of `Mechanism.points` in the world at an instant, x + i y [m], shape
        (points,)."""
        z = solve(self._geometry, [now.crank_angle])[0][0]
        z *= np.exp(1j * now.swing_angle)
        z.real *= self._geometry.travel
        hip = complex(now.x, now.y)
        turned: NDArray[np.complex128] = hip + z * np.exp(1j * now.pitch)
        return turned


def drawn_sole(toe: complex, heel: complex) -> tuple[complex, complex]:
    """Return toe and heel of the sole that is drawn at the ends of a hoof's springs, at least `SOLE_M` apart:
    legs were identified from forces, which say little about the length of their soles."""
    along = toe - heel
    half = max(abs(along), SOLE_M) / 2 * (along / abs(along) if along else 1.0)
    middle = (toe + heel) / 2
    return middle + half, middle - half


def reach(geometry: Geometry) -> tuple[float, float]:
    """Return how far from O, and how far above it, the leg reaches within its limits [m]."""
    out = 0.0
    up = 0.0
    bounds = [LIMITS[name] for name in ("swing_offset", "swing_sin", "swing_cos")]
    for theta in np.linspace(0, 2 * np.pi, 72, endpoint=False):
        z = pose(geometry, theta).points @ (1, 1j)
        phi = [offset + a * np.sin(theta) + b * np.cos(theta) for offset, a, b in product(*bounds)]
        turns = np.exp(1j * geometry.travel * np.linspace(min(phi), max(phi), 72))
        out, up = max(out, np.abs(z).max()), max(up, np.outer(z, turns).imag.max())
    return out, up
