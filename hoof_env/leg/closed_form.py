"""The closed form of a linkage: where points are that two lengths, or a body, hold to points known before.

Planar vectors are complex numbers or planes of `hoof_env.simd`: the same functions serve one crank angle and
many lanes. Two lengths r1, r2 from points a, b give a point p = a + e1 = b + e2 with |e1| = r1, |e2| = r2;
its rate obeys e . p' = e . a' for both, and its acceleration e . p'' = e . a'' - |p' - a'|^2.
"""

from __future__ import annotations

import numpy as np

from hoof_env.simd import perpendicular, rounded, sqrt


def dot(a, b):  # type: ignore[no-untyped-def]
    """Return the scalar product of two planar vectors, which `simd.dot` takes as planes alone."""
    return a.real * b.real + a.imag * b.imag


def cross(a, b):  # type: ignore[no-untyped-def]
    """Return the out-of-plane component of the vector product of two planar vectors."""
    return a.real * b.imag - a.imag * b.real


def intersect(e1, e2, k1, k2):  # type: ignore[no-untyped-def]
    """Return the vector p with e1 . p = k1 and e2 . p = k2."""
    return rounded(perpendicular(k2 * e1 - k1 * e2) / cross(e1, e2))


def meet(first, second, one2, excess, side):  # type: ignore[no-untyped-def]
    """Return the point at two lengths from two points; NaN where the points are too far apart or too close.

    `one2` is the square of the length from `first`, `excess` how much it is over that of the other; `side` is
    +1 to the left of the line from `first` to `second`, -1 to the right.
    """
    span = second - first
    d2 = dot(span, span)
    along = 0.5 + excess / (2.0 * d2)
    across = side * sqrt(one2 / d2 - along * along)
    return first + (span * along + perpendicular(span) * across)


def meet_rate(e1, e2, first_rate, second_rate):  # type: ignore[no-untyped-def]
    """Return the rate of such a point, which is e1 from `first` and e2 from `second`."""
    return intersect(e1, e2, dot(e1, first_rate), dot(e2, second_rate))


def meet_acceleration(e1, e2, w1, w2, first_acceleration, second_acceleration):  # type: ignore[no-untyped-def]
    """Return the acceleration of such a point, whose rates relative to the two points are w1 and w2."""
    k1 = dot(e1, first_acceleration) - dot(w1, w1)
    k2 = dot(e2, second_acceleration) - dot(w2, w2)
    return intersect(e1, e2, k1, k2)


def carry(origin, toward, place):  # type: ignore[no-untyped-def]
    """Return a point of a body by its place in axes from `origin` to `toward`, in their distance; also its
    rate from theirs, and its acceleration."""
    return origin + (toward - origin) * place


def solve_all(theta, crank, fixed, steps, values, z, dz, ddz):  # type: ignore[no-untyped-def]
    """Fill `z`, `dz`, `ddz` (complex, rows for crank angles `theta`, one column a point) with every point and its
    derivatives by the crank angle, in the frame of the leg with the crank's centre at the origin [m, m/rad,
    m/rad^2].

    The crank turns clockwise, its pin is at crank * exp(-i theta); `fixed` are the fixed points, `steps` and
    `values` are `geometry.tables`.
    """
    count = fixed.shape[0]
    z[:, :count] = fixed
    dz[:, :count] = 0.0
    ddz[:, :count] = 0.0
    z[:, count] = crank * (np.cos(theta) - 1j * np.sin(theta))
    dz[:, count] = -1j * z[:, count]
    ddz[:, count] = -z[:, count]
    z, dz, ddz = z.T, dz.T, ddz.T
    with np.errstate(all="ignore"):
        for (kind, p, a, b), value in zip(steps.tolist(), values.tolist(), strict=True):
            if kind == 1:
                z[p] = meet(z[a], z[b], *value[:3])
                e1 = z[p] - z[a]
                e2 = z[p] - z[b]
                dz[p] = meet_rate(e1, e2, dz[a], dz[b])
                ddz[p] = meet_acceleration(e1, e2, dz[p] - dz[a], dz[p] - dz[b], ddz[a], ddz[b])
            else:
                place = complex(value[0], value[1])
                z[p] = carry(z[a], z[b], place)
                dz[p] = carry(dz[a], dz[b], place)
                ddz[p] = carry(ddz[a], ddz[b], place)
