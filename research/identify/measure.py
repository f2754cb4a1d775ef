"""From a vector x to every measured number: kernels, whose arrays `objective.Objective` keeps.

One crank revolution on a fixed trunk, thousands of times: crank and swing are prescribed, so the ground moves
nothing and its force follows from the paths of toe and heel. `leg_paths` finds every point of the linkage; a
dyad that cannot close is stretched out and the miss reported, so that a search can climb back to legs that
assemble. `swing_hoof` turns and places the hoof; `features.measure_gait` reads off it what the paper prints.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.gait import LIMITS
from hoof_env.leg.kinematics import cross, dot
from hoof_env.leg.linkage import BODIES, CONSTRUCTION, LENGTHS, POINTS, Dyad
from hoof_env.simd.compile import kernel
from research.identify.demands import LENGTH_RANGE
from research.identify.euler import Bodies, euler_cycle
from research.identify.features import Cycle, cubic, measure_gait
from research.identify.leg import LEVEL, NUMBER, SPEED, STEPS

Array = NDArray[np.float64]

PAPER_SAMPLES, PAPER_STEP = 1001, 1e-3  # of the paper's solver: instants in one second, time step [s]

_LOG_RANGE = (math.log(LENGTH_RANGE[0]), math.log(LENGTH_RANGE[1]))
_COUNT, _SOLE = len(LENGTHS), LENGTHS.index("IJ")
_PIVOT_X, _PIVOT_Y, _REST = _COUNT, _COUNT + 1, LEVEL + 1
_LOW, _HIGH = (
    np.array([LIMITS[name][end] for name in ("swing_offset", "swing_sin", "swing_cos")]) for end in (0, 1)
)
_MIDDLE = 0.5 * float(_LOW[0] + _HIGH[0])
_USED = [(s.from_first, s.from_second) if isinstance(s, Dyad) else (s.distance, s.span) for s in CONSTRUCTION]
_SOURCES = np.array([[LENGTHS.index(name) for name in pair] for pair in _USED])  # of each step
_O, _C, _P, _G = (NUMBER[name] for name in "OCPG")


class Setup(NamedTuple):
    """What a search does not change."""

    signs: Array  # side of each step's dyad, 0 for an extension, shape (8,)
    travel: float
    toe: int  # number of the point
    heel: int
    stiffness: float  # K of Eq. 14 [N/m^n]
    exponent: float  # n of Eq. 14 [-]
    alpha: float  # Baumgarte's, of the paper's solver [1/s]
    beta: float
    by_toe: bool  # see `measure_exact`


class Arrays(NamedTuple):
    """Scratch of a solver: numbers of the construction (8, 3), gaits (2, 4), paths of all points (11, n), of
    toe and heel (2, n) and of the ankle (n,), forces of both gaits (2, 6, n)."""

    values: Array
    gaits: Array
    z: NDArray[np.complex128]
    dz: NDArray[np.complex128]
    at: NDArray[np.complex128]
    velocity: NDArray[np.complex128]
    ankle: Array
    work: Array


def new_arrays(n: int) -> Arrays:
    gaits = np.zeros((2, 4))
    gaits[:, 0] = SPEED
    z, dz = np.zeros((2, len(POINTS), n), np.complex128)
    at, velocity = np.zeros((2, 2, n), np.complex128)
    return Arrays(np.zeros((len(STEPS), 3)), gaits, z, dz, at, velocity, np.zeros(n), np.zeros((2, 6, n)))


def new_bodies() -> Bodies:
    q, qd, qdd = np.zeros((3, len(BODIES), 3))
    return Bodies(q, qd, qdd, np.zeros(len(BODIES)))


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

    `crank`: OP [m]; `pivot`: C relative to O, complex [m]; `values`: as from `geometry.tables`.
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

    `gait`: (crank speed [rad/s], offset, sine and cosine coefficient of the swing [rad]). Outputs: `at` and
    `velocity` of toe and heel, complex, shape (2, n), and the height `ankle` of G, relative to O [m, m/s].
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


@kernel
def excess(value, low, high):  # type: ignore[no-untyped-def]
    return max(value - high, low - value, 0.0)


@kernel
def unpack(x, setup, arrays, leg):  # type: ignore[no-untyped-def]
    """Turn x into `arrays.values` and `arrays.gaits`, and fill what `leg` has of them; returns OP [m]."""
    lengths, values, gaits = np.exp(x[:_COUNT]), arrays.values, arrays.gaits
    leg.length_excess = 0.0
    for i in range(_COUNT):
        leg.length_excess += excess(x[i], _LOG_RANGE[0], _LOG_RANGE[1]) if i != _SOLE else 0.0
    for j in range(STEPS.shape[0]):
        one, two = lengths[_SOURCES[j, 0]], lengths[_SOURCES[j, 1]]
        if STEPS[j, 0] == 1:
            values[j, 0], values[j, 1], values[j, 2] = one, two, setup.signs[j]
        else:
            values[j, 0] = one / two
    for g in range(2):
        beyond = 0.0
        for i in range(3):
            value = x[_REST + 3 * g + i]
            gaits[g, i + 1] = value
            if i > 0 or g > 0 or not setup.by_toe:  # else the walk's offset is not yet known
                beyond += excess(value, _LOW[i], _HIGH[i])
        if g == 0:
            leg.walk_excess = beyond
        else:
            leg.run_excess = beyond
    leg.sole = lengths[_SOLE]
    leg.pivot_excess = max(abs(complex(x[_PIVOT_X], x[_PIVOT_Y])) - LENGTH_RANGE[1], 0.0)
    return lengths[0]


@kernel
def offset_at(z, dz, gait, toe, t, speed):  # type: ignore[no-untyped-def]
    """Swing offset [rad] with which the toe sinks at so many m/s at time t [s].

    Turning the frame turns the toe's velocity: the offset follows in closed form. Of the two that there are,
    about half a turn apart, it is the one nearer to the middle of the limits. A toe that is too slow gets the
    nearest it can. The offset in `gait` is ignored.
    """
    h = 2.0 * np.pi / (z.shape[1] - 1)
    theta = min(max(gait[0] * t, 0.0), 6.28)
    k = int(theta / (2.0 * np.pi) * (z.shape[1] - 1))
    arm, moving = cubic(z[toe, k], z[toe, k + 1], dz[toe, k], dz[toe, k + 1], h, theta / h - k)
    s, c = np.sin(theta), np.cos(theta)
    moving = gait[0] * (moving + 1j * (gait[2] * c - gait[3] * s) * arm)
    down = np.arcsin(min(max(-speed / max(abs(moving), 1e-9), -1.0), 1.0))
    behind = np.angle(moving) + gait[2] * s + gait[3] * c + _MIDDLE
    one, other = down - behind, np.pi - down - behind
    one -= 2.0 * np.pi * np.round(one / (2.0 * np.pi))
    other -= 2.0 * np.pi * np.round(other / (2.0 * np.pi))
    return _MIDDLE + (one if abs(one) < abs(other) else other)


@kernel
def height_at(at, velocity, h, t):  # type: ignore[no-untyped-def]
    """Height [m] of the swing's centre above a ground that the toe crosses at time t [s]; h: of a sample."""
    part = min(max(t / h, 0.0), at.shape[1] - 1.001)
    k = int(part)
    y, _ = cubic(at[0, k].imag, at[0, k + 1].imag, velocity[0, k].imag, velocity[0, k + 1].imag, h, part - k)
    return -y


@kernel
def compare_gaits(walk, run, both):  # type: ignore[no-untyped-def]
    both.angle_variation = run.angle_variation / walk.angle_variation
    both.step = run.step - walk.step
    both.heel_gap = run.heel_gap - walk.heel_gap
    both.turn = run.push_2 - run.push_1


@kernel
def measure_exact(x, setup, arrays, leg, features, both):  # type: ignore[no-untyped-def]
    """Fill `leg`, `features` (walk, run) and `both` by kinematics alone, and the arrays.

    With `setup.by_toe` x holds for the hip's height the time at which the walking toe touches down, and for
    the walk's swing offset the logarithm of its approach speed there.
    """
    z, dz, gaits = arrays.z, arrays.dz, arrays.gaits
    at, velocity, ankle = arrays.at, arrays.velocity, arrays.ankle
    crank, height = unpack(x, setup, arrays, leg), x[LEVEL]
    leg.miss, leg.transmission = leg_paths(crank, complex(x[_PIVOT_X], x[_PIVOT_Y]), arrays.values, z, dz)
    leg.lowest = np.inf
    if setup.by_toe:
        speed = np.exp(min(x[_REST], 5.0))
        gaits[0, 1] = offset_at(z, dz, gaits[0], setup.toe, x[LEVEL], speed)
        leg.walk_excess += excess(gaits[0, 1], _LOW[0], _HIGH[0])
    for g in range(2):
        h = 2.0 * np.pi / gaits[g, 0] / (at.shape[1] - 1)
        lowest = swing_hoof(z, dz, gaits[g], setup, at, velocity, ankle)
        if g == 0 and setup.by_toe:
            height = height_at(at, velocity, h, x[LEVEL])
        leg.lowest = min(leg.lowest, lowest + height)
        cycle = Cycle(at, velocity, ankle, height, h, False, setup.stiffness, setup.exponent)
        measure_gait(cycle, arrays.work[g], features[g])
    leg.hip_height, leg.sole_part = height, leg.sole / max(height, 0.1)
    compare_gaits(features[0], features[1], both)


@kernel
def measure_paper(x, height, setup, exact, bodies, arrays, features, both):  # type: ignore[no-untyped-def]
    """Fill `features` and `both` through the paper's solver, after `measure_exact` has filled the arrays
    `exact` and found the hip's `height` [m]."""
    crank, pivot = np.exp(x[0]), complex(x[_PIVOT_X], x[_PIVOT_Y])
    values, at, velocity, ankle = exact.values, arrays.at, arrays.velocity, arrays.ankle
    for g in range(2):
        gait = exact.gaits[g]
        if euler_cycle(crank, pivot, values, setup, gait, 0.0, PAPER_STEP, bodies, at, velocity, ankle):
            h = 2.0 * np.pi / gait[0] / (at.shape[1] - 1)
            cycle = Cycle(at, velocity, ankle, height, h, True, setup.stiffness, setup.exponent)
            measure_gait(cycle, arrays.work[g], features[g])
    compare_gaits(features[0], features[1], both)
