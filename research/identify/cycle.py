"""One crank revolution on a fixed trunk, from kinematics alone: what the search evaluates thousands of times.

The crank and the swing are prescribed, so the ground moves nothing and its force follows from the paths of
toe and heel. `leg_paths` finds every point of the linkage over a revolution; a dyad that cannot close is
stretched out and the miss reported, so that a search can climb back to legs that assemble. `swing_hoof` turns
and places the hoof; `features.measure_gait` reads off it what the paper prints.
"""

from __future__ import annotations

import numpy as np

from hoof_env.leg.kinematics import cross, dot
from hoof_env.leg.linkage import POINTS
from hoof_env.simd.compile import kernel

_NUMBER = {name: i for i, name in enumerate(POINTS)}
_O, _C, _P, _G = (_NUMBER[name] for name in "OCPG")

EXTENSION, DYAD, TRIAD = 0, 1, 2
"""Kinds of step of a construction. The first two are those of `geometry.tables`."""


@kernel
def close_dyad(p, a, b, r1, r2, side, k, z, dz):  # type: ignore[no-untyped-def]
    """Point p at r1 from a and r2 from b, as in `kinematics.solve_points`; returns (miss, |sine|)."""
    span = z[b, k] - z[a, k]
    d2 = dot(span, span) + 1e-12
    along = 0.5 + (r1 * r1 - r2 * r2) / (2.0 * d2)
    d = np.sqrt(d2)
    miss = max(d - r1 - r2, abs(r1 - r2) - d) / (r1 + r2)
    across = np.sqrt(max(r1 * r1 / d2 - along * along, 1e-8))
    z[p, k] = z[a, k] + span * complex(along, side * across)
    e1, e2 = z[p, k] - z[a, k], z[p, k] - z[b, k]
    k1, k2 = dot(e1, dz[a, k]), dot(e2, dz[b, k])
    dz[p, k] = 1j * (k2 * e1 - k1 * e2) * (1.0 / (cross(e1, e2) + side * 1e-12))
    return miss, d2 * across / (r1 * r2)


@kernel
def close_triad(e, d, p, f, value, angles, k, z, dz):  # type: ignore[no-untyped-def]
    """Points e and f where link 9 holds an inner point Q of link 7; returns (miss, sine-like margin).

    E turns about D and F about C; |EF| and |PQ| with Q = E + part (F - E) are given. There is no closed form:
    Newton on the two angles from `angles`, which is left at the solution, moved on by one sample.

    Args:
        value: (DE, EF, CF, PQ, part) [m, -].
        angles: directions of D-E and C-F [rad], shape (2,), in and out.
    """
    de, ef, cf, pq, part = value[0], value[1], value[2], value[3], value[4]
    miss, det = 1.0, 0.0
    link, hold, one, two = 0j, 0j, 0j, 0j
    for _ in range(30 if k == 0 else 10):  # later samples begin near
        one = de * complex(np.cos(angles[0]), np.sin(angles[0]))
        two = cf * complex(np.cos(angles[1]), np.sin(angles[1]))
        z[e, k], z[f, k] = z[d, k] + one, z[_C, k] + two
        link = z[e, k] - z[f, k]
        hold = z[e, k] - part * link - z[p, k]
        off1, off2 = 0.5 * (dot(link, link) - ef * ef), 0.5 * (dot(hold, hold) - pq * pq)
        a11, a12 = dot(link, 1j * one), -dot(link, 1j * two)
        a21, a22 = (1.0 - part) * dot(hold, 1j * one), part * dot(hold, 1j * two)
        det = a11 * a22 - a12 * a21
        floor = 1e-6 * de * ef * cf * pq
        safe = det if abs(det) > floor else (floor if det >= 0.0 else -floor)
        turn1, turn2 = (a12 * off2 - a22 * off1) / safe, (a21 * off1 - a11 * off2) / safe
        size = max(abs(turn1), abs(turn2))
        if size < 1e-13 or max(abs(off1), abs(off2)) < 1e-16:
            miss = 0.0
            break
        slow = min(1.0, 0.3 / size)
        angles[0] += slow * turn1
        angles[1] += slow * turn2
    if miss > 0.0:
        gap = (abs(abs(link) - ef) + abs(abs(hold) - pq)) / (ef + pq)
        miss = gap if gap > 1e-9 else 0.0
    if abs(det) < 1e-9 * de * ef * cf * pq:
        dz[e, k], dz[f, k] = dz[d, k], dz[_C, k]
        return miss, 0.0
    base = (1.0 - part) * dz[d, k] + part * dz[_C, k] - dz[p, k]
    known1, known2 = -dot(link, dz[d, k] - dz[_C, k]), -dot(hold, base)
    a11, a12 = dot(link, 1j * one), -dot(link, 1j * two)
    a21, a22 = (1.0 - part) * dot(hold, 1j * one), part * dot(hold, 1j * two)
    rate1, rate2 = (a22 * known1 - a12 * known2) / det, (a11 * known2 - a21 * known1) / det
    dz[e, k], dz[f, k] = dz[d, k] + 1j * rate1 * one, dz[_C, k] + 1j * rate2 * two
    ahead = 2.0 * np.pi / (z.shape[1] - 1)
    angles[0] += min(max(rate1 * ahead, -0.3), 0.3)
    angles[1] += min(max(rate2 * ahead, -0.3), 0.3)
    return miss, np.sqrt(abs(det) / (de * ef * cf * pq))


@kernel
def leg_paths(crank, pivot, oval, steps, values, z, dz):  # type: ignore[no-untyped-def]
    """Fill `z`, `dz` (complex, shape (points, n)) over one revolution; returns (miss, transmission).

    Column k stands at theta = 2 pi k / (n - 1); lengths in m, derivatives by theta. The pivot C follows
    pivot + oval[0] exp(i theta) + oval[1] exp(-i theta), an ellipse; zeros hold it still.

    Args:
        crank: OP [m]. pivot: C relative to O, complex [m]. oval: two complex numbers [m].
        steps, values: as from `geometry.tables`; a step (TRIAD, E, D, P, F) has (DE, EF, CF, PQ, part,
            direction of D-E, of C-F at theta = 0) for values.

    Returns:
        miss: largest gap over the revolution of a dyad that does not close, over the dyad's reach [-].
        transmission: smallest |sine| of the angle between the links of a dyad [-].
    """
    n = z.shape[1]
    miss, transmission = 0.0, 1.0
    angles = np.zeros(2)
    for k in range(n):
        theta = 2.0 * np.pi * k / (n - 1)
        turn = complex(np.cos(theta), np.sin(theta))
        z[_O, k], dz[_O, k] = 0j, 0j
        one, two = oval[0] * turn, oval[1] * np.conj(turn)
        z[_C, k], dz[_C, k] = pivot + one + two, 1j * (one - two)
        z[_P, k] = crank * np.conj(turn)
        dz[_P, k] = -1j * z[_P, k]
        for j in range(steps.shape[0]):
            p, a, b, o = steps[j, 1], steps[j, 2], steps[j, 3], steps[j, 4]
            if steps[j, 0] == EXTENSION:
                z[p, k] = z[o, k] + values[j, 0] * (z[b, k] - z[a, k])
                dz[p, k] = dz[o, k] + values[j, 0] * (dz[b, k] - dz[a, k])
                continue
            if steps[j, 0] == DYAD:
                gap, sine = close_dyad(p, a, b, values[j, 0], values[j, 1], values[j, 2], k, z, dz)
            else:
                if k == 0:
                    angles[0], angles[1] = values[j, 5], values[j, 6]
                gap, sine = close_triad(p, a, b, o, values[j], angles, k, z, dz)
                if k == n - 1:  # on another branch than it began
                    gap = max(gap, abs(z[o, k] - z[o, 0]) / values[j, 2] - 1e-6)
            miss, transmission = max(miss, gap), min(transmission, sine)
    return miss, transmission


@kernel
def swing_hoof(z, dz, gait, about_pivot, travel, toe, heel, at, velocity, ankle):  # type: ignore[no-untyped-def]
    """Place toe and heel in the world for one gait; returns the lowest height of every other joint [m].

    Args:
        z, dz: from `leg_paths`.
        gait: (crank speed [rad/s], offset, sine and cosine coefficient of the swing [rad]).
        about_pivot: the frame turns about C instead of O.
        travel, toe, heel: as in `Geometry`, the corners as point numbers.
        at, velocity: outputs, complex, shape (2, n): toe and heel relative to the centre of the swing.
        ankle: output, shape (n,): height of G relative to that centre [m].
    """
    n = z.shape[1]
    lowest = np.inf
    for k in range(n):
        theta = 2.0 * np.pi * k / (n - 1)
        s, c = np.sin(theta), np.cos(theta)
        phi = gait[1] + gait[2] * s + gait[3] * c
        slope = gait[2] * c - gait[3] * s
        turn = complex(np.cos(phi), np.sin(phi))
        centre, dcentre = 0j, 0j
        if about_pivot:
            centre, dcentre = z[_C, k], dz[_C, k]
        for i in range(2):
            p = toe if i == 0 else heel
            arm = z[p, k] - centre
            placed = arm * turn
            moving = ((dz[p, k] - dcentre) + 1j * slope * arm) * turn * gait[0]
            at[i, k] = complex(travel * placed.real, placed.imag)
            velocity[i, k] = complex(travel * moving.real, moving.imag)
        ankle[k] = ((z[_G, k] - centre) * turn).imag
        for p in range(z.shape[0]):
            if p != toe and p != heel:
                lowest = min(lowest, ((z[p, k] - centre) * turn).imag)
    return lowest
