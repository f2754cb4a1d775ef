"""The closed form of a linkage: where points are that two lengths, or a body, hold to points known before.

The same functions serve `Vectors`, at one crank angle or at many, and planes of `hoof_env.simd`, the lanes of
kernels. Two lengths r1, r2 from points a, b give a point p = a + e1 = b + e2 with |e1| = r1, |e2| = r2; its
rate obeys e . p' = e . a' for both, and its acceleration e . p'' = e . a'' - |p' - a'|^2.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import Floats
from hoof_env.simd import perpendicular, rounded, sqrt
from hoof_env.simd.values import Plane


class Vectors:
    """Planar vectors, each coordinate a NumPy number or an array, that multiply like complex numbers.

    Every operation rounds once, whatever the processor; NumPy's own complex numbers may fuse some of them.
    """

    __slots__ = ("imag", "real")
    __array_ufunc__ = None  # NumPy's numbers leave products to this class

    def __init__(self, real: Any, imag: Any) -> None:
        self.real = real
        self.imag = imag

    def __add__(self, other: Vectors) -> Vectors:
        return Vectors(self.real + other.real, self.imag + other.imag)

    def __sub__(self, other: Vectors) -> Vectors:
        return Vectors(self.real - other.real, self.imag - other.imag)

    def __mul__(self, other: Any) -> Vectors:
        a, b = self.real, self.imag
        if not isinstance(other, Vectors):
            return Vectors(a * other, b * other)
        c, d = other.real, other.imag
        return Vectors(a * c - b * d, a * d + b * c)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Vectors:
        return Vectors(self.real / other, self.imag / other)

    def __neg__(self) -> Vectors:
        return Vectors(-self.real, -self.imag)

    def turned_left(self) -> Vectors:
        """Return them turned left by a right angle."""
        return Vectors(-self.imag, self.real)


Planar = TypeVar("Planar", Vectors, Plane)


def left_of(z: Planar) -> Planar:
    """Return planar vectors turned left by a right angle; `simd.perpendicular` takes planes alone."""
    return z.turned_left() if isinstance(z, Vectors) else perpendicular(z)


def dot(a: Planar, b: Planar) -> Any:
    """Return the scalar product of planar vectors, which `simd.dot` takes as planes alone."""
    return a.real * b.real + a.imag * b.imag


def cross(a: Planar, b: Planar) -> Any:
    """Return the out-of-plane component of the vector product of two planar vectors."""
    return a.real * b.imag - a.imag * b.real


def intersect(e1: Planar, e2: Planar, k1: Any, k2: Any) -> Planar:
    """Return the vector p with e1 . p = k1 and e2 . p = k2."""
    return rounded(left_of(k2 * e1 - k1 * e2) / cross(e1, e2))


def meet(first: Planar, second: Planar, one2: Any, excess: Any, side: Any) -> Planar:
    """Return the point at two lengths from two points; NaN where the points are too far apart or too close.

    `one2` is the square of the length from `first`, `excess` its excess over the square of the second; `side`
    is +1 to the left of the line from `first` to `second`, -1 to the right.
    """
    span = second - first
    d2 = dot(span, span)
    along = 0.5 + excess / (2.0 * d2)
    across = side * sqrt(one2 / d2 - along * along)
    return first + (span * along + left_of(span) * across)


def meet_rate(e1: Planar, e2: Planar, first_rate: Planar, second_rate: Planar) -> Planar:
    """Return the rate of such a point, which is e1 from `first` and e2 from `second`."""
    return intersect(e1, e2, dot(e1, first_rate), dot(e2, second_rate))


def meet_acceleration(
    e1: Planar, e2: Planar, w1: Planar, w2: Planar, first_acceleration: Planar, second_acceleration: Planar
) -> Planar:
    """Return the acceleration of such a point, whose rates relative to the two points are w1 and w2."""
    k1 = dot(e1, first_acceleration) - dot(w1, w1)
    k2 = dot(e2, second_acceleration) - dot(w2, w2)
    return intersect(e1, e2, k1, k2)


def carry(origin: Planar, toward: Planar, place: Planar) -> Planar:
    """Return a point of a body by its place in axes from `origin` to `toward`, in their distance; also its
    rate from theirs, and its acceleration."""
    return origin + (toward - origin) * place


def solve_points(
    theta: Floats, crank: float, fixed: NDArray[np.complex128], steps: Any, values: Any
) -> list[tuple[Vectors, Vectors, Vectors]]:
    """Return every point and its two derivatives by the crank angle, at crank angles `theta`, in the frame of
    the leg with the crank's centre at the origin [m, m/rad, m/rad^2].

    The crank turns clockwise, its pin is at crank * exp(-i theta); `fixed` are the fixed points, `steps` and
    `values` are `assembly.tables`. A fixed point has one vector for all angles.
    """
    zero = Vectors(np.float64(0.0), np.float64(0.0))
    points = [(Vectors(place.real, place.imag), zero, zero) for place in fixed]
    cosine, sine = cos_sin(theta)
    if theta.size == 1:
        cosine, sine = cosine[0], sine[0]  # numbers, which take a fifth of the time of arrays of one
    pin = Vectors(crank * cosine, 0.0 - crank * sine)
    points.append((pin, -pin.turned_left(), -pin))
    with np.errstate(all="ignore"):
        for (is_dyad, _, first, second), value in zip(steps.tolist(), values.tolist(), strict=True):
            (a, da, dda), (b, db, ddb) = points[first], points[second]
            if is_dyad:
                z = meet(a, b, *value)
                e1, e2 = z - a, z - b
                dz = meet_rate(e1, e2, da, db)
                ddz = meet_acceleration(e1, e2, dz - da, dz - db, dda, ddb)
            else:
                place = Vectors(value[0], value[1])
                z, dz, ddz = carry(a, b, place), carry(da, db, place), carry(dda, ddb, place)
            points.append((z, dz, ddz))
    return points


def cos_sin(angle: Floats) -> tuple[Floats, Floats]:
    """Return the cosine and sine of angles [rad] by the C library; NaN where an angle is not finite.

    NumPy's vectorised functions have other last bits on some processors.
    """
    finite = np.isfinite(angle)
    angles = np.where(finite, angle, 0.0).tolist()
    parts = (np.array(list(map(function, angles))) for function in (math.cos, math.sin))
    cosine, sine = (np.where(finite, part, np.nan) for part in parts)
    return cosine, sine
