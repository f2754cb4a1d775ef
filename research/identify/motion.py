"""One crank revolution on a fixed trunk, from kinematics alone: what the search evaluates thousands of times.

The crank and the swing are prescribed, so the ground moves nothing and its force follows from the paths of
toe and heel. `leg_paths` finds every point of the linkage over a revolution; a dyad that cannot close is
stretched out and the miss reported, so that a search can climb back to legs that assemble. `swing_hoof` turns
and places the hoof; `features.measure_gait` reads off it what the paper prints.
"""

from __future__ import annotations

import numpy as np

from hoof_env.leg.geometry import load_geometry, tables
from hoof_env.leg.kinematics import cross, dot
from hoof_env.leg.linkage import POINTS
from hoof_env.simd.compile import kernel

NUMBER = {name: i for i, name in enumerate(POINTS)}
"""Points by name, as indices into arrays of all of them."""

_O, _C, _P, _G = (NUMBER[name] for name in "OCPG")

STEPS = tables(load_geometry("first_fit"))[0]
"""The construction of any leg, `geometry.tables`."""


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
def leg_paths(crank, pivot, values, z, dz):  # type: ignore[no-untyped-def]
    """Fill `z`, `dz` (complex, shape (11, n)) over one revolution, column k at theta = 2 pi k / (n - 1), with
    derivatives by theta. Returns the largest gap of a dyad over its reach [-], at most 0 where all close,
    and the smallest |sine| of the angle between the links of a dyad [-].

    Args:
        crank: OP [m].
        pivot: C relative to O, complex [m].
        values: as from `geometry.tables`.
    """
    n = z.shape[1]
    miss, transmission = 0.0, 1.0
    for k in range(n):
        theta = 2.0 * np.pi * k / (n - 1)
        z[_O, k], dz[_O, k] = 0j, 0j
        z[_C, k], dz[_C, k] = pivot, 0j
        z[_P, k] = crank * complex(np.cos(theta), -np.sin(theta))
        dz[_P, k] = -1j * z[_P, k]
        for j in range(STEPS.shape[0]):
            p, a, b, origin = STEPS[j, 1], STEPS[j, 2], STEPS[j, 3], STEPS[j, 4]
            if STEPS[j, 0] == 1:
                gap, sine = close_dyad(p, a, b, values[j, 0], values[j, 1], values[j, 2], k, z, dz)
                miss, transmission = max(miss, gap), min(transmission, sine)
            else:
                z[p, k] = z[origin, k] + values[j, 0] * (z[b, k] - z[a, k])
                dz[p, k] = dz[origin, k] + values[j, 0] * (dz[b, k] - dz[a, k])
    return miss, transmission


@kernel
def swing_hoof(z, dz, gait, setup, at, velocity, ankle):  # type: ignore[no-untyped-def]
    """Place toe and heel in the world for one gait; returns the lowest height of every other joint [m].

    Args:
        z, dz: from `leg_paths`.
        gait: (crank speed [rad/s], offset, sine and cosine coefficient of the swing [rad]).
        setup: the leg, see `measure.Setup`.
        at, velocity: outputs, complex, shape (2, n): toe and heel relative to O [m, m/s].
        ankle: output, shape (n,): height of G relative to O [m].
    """
    n = z.shape[1]
    lowest = np.inf
    for k in range(n):
        theta = 2.0 * np.pi * k / (n - 1)
        s, c = np.sin(theta), np.cos(theta)
        phi = gait[1] + gait[2] * s + gait[3] * c
        slope = gait[2] * c - gait[3] * s
        turn = complex(np.cos(phi), np.sin(phi))
        for i in range(2):
            p = setup.toe if i == 0 else setup.heel
            placed = z[p, k] * turn
            moving = (dz[p, k] + 1j * slope * z[p, k]) * turn * gait[0]
            at[i, k] = complex(setup.travel * placed.real, placed.imag)
            velocity[i, k] = complex(setup.travel * moving.real, moving.imag)
        ankle[k] = (z[_G, k] * turn).imag
        for p in range(z.shape[0]):
            if p != setup.toe and p != setup.heel:
                lowest = min(lowest, (z[p, k] * turn).imag)
    return lowest
