"""Schemes that integrate the coordinates of Eq. 8; the paper's is explicit Euler (Eq. 9)."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Acceleration = Callable[[float, Vector, Vector], Vector]
Scheme = Callable[[Acceleration, Vector, Vector, float], tuple[Vector, Vector]]


def euler(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """Explicit Euler, first order: the paper's scheme (Eq. 9)."""
    return q + h * qd, qd + h * acceleration(0.0, q, qd)


def semi_implicit_euler(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """Semi-implicit Euler, first order: the new rate moves the coordinates."""
    qd = qd + h * acceleration(0.0, q, qd)
    return q + h * qd, qd


def midpoint(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """Explicit midpoint rule, second order."""
    q1, v1 = euler(acceleration, q, qd, h / 2)
    return q + h * v1, qd + h * acceleration(h / 2, q1, v1)


def rk4(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """The classical Runge-Kutta scheme, fourth order."""
    a0 = acceleration(0.0, q, qd)
    v1 = qd + h / 2 * a0
    a1 = acceleration(h / 2, q + h / 2 * qd, v1)
    v2 = qd + h / 2 * a1
    a2 = acceleration(h / 2, q + h / 2 * v1, v2)
    v3 = qd + h * a2
    a3 = acceleration(h, q + h * v2, v3)
    return q + h / 6 * (qd + 2 * v1 + 2 * v2 + v3), qd + h / 6 * (a0 + 2 * a1 + 2 * a2 + a3)


INTEGRATORS = MappingProxyType(
    {"euler": euler, "semi_implicit_euler": semi_implicit_euler, "midpoint": midpoint, "rk4": rk4}
)
"""The schemes by name."""
