"""From a vector x to every measured number, and from there to errors, shortages and a cost: kernels.

`construction` turns a `Choice` into tables once; `measure_exact` and `measure_paper` then measure a vector,
and `rate_rows` and `rate_demands` judge it. `objective.Objective` keeps the arrays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.gait.parameters import LIMITS
from hoof_env.leg.linkage import CONSTRUCTION, LENGTHS, POINTS, Dyad, Extension
from hoof_env.simd.compile import kernel
from research.identify.candidate import SIGNS, Choice, lengths_of
from research.identify.cycle import DYAD, EXTENSION, TRIAD, leg_paths, swing_hoof
from research.identify.drift import euler_cycle
from research.identify.features import cubic, measure_gait
from research.identify.plausibility import LENGTH_RANGE, OVAL_LIMIT, PART_RANGE

DEAD_ZONE = 0.6
"""An error below this costs nothing [bars], so that no row is pressed while another is outside its bar."""

MISSED_ROW, MISSED = 300.0, 20.0
"""Error [bars] of a row, and shortage of a demand, that cannot be measured."""

_C = POINTS.index("C")
_NUMBER = {name: i for i, name in enumerate((*POINTS, "Q"))}
_LOG_RANGE = (math.log(LENGTH_RANGE[0]), math.log(LENGTH_RANGE[1]))
_COUNT, _IJ, _DE = len(LENGTHS), LENGTHS.index("IJ"), LENGTHS.index("DE")
_PIVOT_X, _PIVOT_Y, _HIP, _REST = 15, 16, 17, 18
_PART_LOW, _PART_HIGH = PART_RANGE
_LOW, _HIGH = (
    np.array([LIMITS[name][end] for name in ("swing_offset", "swing_sin", "swing_cos")]) for end in (0, 1)
)


def construction(choice: Choice) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The steps of `cycle.leg_paths` for this choice, and where `unpack` takes their numbers from.

    Returns:
        steps: shape (m, 5), as `geometry.tables`, Q behind the points of the linkage.
        sources: shape (m, 7), indices into the numbers that `unpack` lists, for each column of `values`, -1
            for none; an extension has (numerator, denominator).
    """
    number = {name: i for i, name in enumerate((*lengths_of(choice), *SIGNS, "part", "part DE", "one"))}
    number |= {"angle_DE": len(number), "angle_CF": len(number) + 1}
    triad = (TRIAD, "E", "D", "P", "F", ("DE", "EF", "CF", "PQ", "part", "angle_DE", "angle_CF"))
    middle: dict[str, list[Any]] = {
        "F": [Dyad("F", "C", "P", "CF", "PF"), Dyad("E", "D", "F", "DE", "EF")],
        "E": [Dyad("E", "D", "P", "DE", "PE"), Dyad("F", "C", "E", "CF", "EF")],
        "6": [
            Dyad("Q", "D", "P", "part DE", "PQ"),
            Extension("E", "D", "Q", "part DE", "D", "DE"),
            Dyad("F", "C", "E", "CF", "EF"),
        ],
        "7": [triad, Extension("Q", "E", "F", "one", "E", "part")],
    }
    steps, sources = [], []
    for step in (*CONSTRUCTION[:2], *middle[choice.link9], *CONSTRUCTION[4:]):
        if isinstance(step, tuple):
            steps.append((step[0], *(_NUMBER[p] for p in step[1:5])))
            row = [number[name] for name in step[5]]
        elif isinstance(step, Dyad):
            points = (step.point, step.first, step.second, step.first)
            steps.append((DYAD, *(_NUMBER[p] for p in points)))
            side = "E" if step.point == "Q" else step.point
            row = [number[step.from_first], number[step.from_second], number[side]]
        else:
            points = (step.point, step.first, step.second, step.origin)
            steps.append((EXTENSION, *(_NUMBER[p] for p in points)))
            row = [number[step.distance], number[step.span]]
        sources.append(row + [-1] * (7 - len(row)))
    return np.array(steps, dtype=np.int64), np.array(sources, dtype=np.int64)


_MIDDLE = 0.5 * float(_LOW[0] + _HIGH[0])


@kernel
def offset_excess(offset):  # type: ignore[no-untyped-def]
    """How far a swing offset lies beyond its limits [rad]."""
    return max(offset - _HIGH[0], _LOW[0] - offset, 0.0)


@kernel
def unpack(x, signs, steps, sources, extras, oval, by_toe, values, gaits, ovals, leg):  # type: ignore[no-untyped-def]
    """Turn x into the arguments of `leg_paths` and `swing_hoof`; returns OP [m].

    Args:
        signs: of the choice, shape (6,).
        steps, sources: `candidate.construction`.
        extras: how many numbers x has for link 9: 0, 1 or 3.
        oval: whether the pivot moves on an ellipse.
        by_toe: x does not hold the walk's offset, see `measure_exact`.
        values, gaits, ovals: outputs, shapes (m, 7), (2, 4), and complex (2, 2).
        leg: output, record of dtype `LEG`.
    """
    numbers = np.zeros(_COUNT + 11)
    leg.length_excess = 0.0
    for i in range(_COUNT):
        numbers[i] = np.exp(x[i])
        leg.length_excess += max(x[i] - _LOG_RANGE[1], _LOG_RANGE[0] - x[i], 0.0) if i != _IJ else 0.0
    numbers[_COUNT : _COUNT + 6] = signs
    leg.part_excess = 0.0
    if extras > 0:
        part = x[_REST]
        leg.part_excess = max(_PART_LOW - part, part - _PART_HIGH, 0.0)
        numbers[_COUNT + 6] = min(max(part, 0.02), 0.98)
        numbers[_COUNT + 7] = numbers[_COUNT + 6] * numbers[_DE]
    numbers[_COUNT + 8] = 1.0
    if extras == 3:
        numbers[_COUNT + 9], numbers[_COUNT + 10] = x[_REST + 1], x[_REST + 2]
    for j in range(steps.shape[0]):
        if steps[j, 0] == EXTENSION:
            values[j, 0] = numbers[sources[j, 0]] / numbers[sources[j, 1]]
        else:
            for i in range(7):
                values[j, i] = numbers[sources[j, i]] if sources[j, i] >= 0 else 0.0
    size = 5 if oval else 3
    for g in range(2):
        law = x[_REST + extras + g * size : _REST + extras + (g + 1) * size]
        gaits[g, 1], gaits[g, 2], gaits[g, 3] = law[0], 0.0, 0.0
        excess = 0.0 if by_toe and g == 0 else offset_excess(law[0])
        if oval:
            ovals[g, 0], ovals[g, 1] = complex(law[1], law[2]), complex(law[3], law[4])
            excess += max(abs(ovals[g, 0]) + abs(ovals[g, 1]) - OVAL_LIMIT, 0.0)
        else:
            for i in range(1, 3):
                gaits[g, i + 1] = law[i]
                excess += max(law[i] - _HIGH[i], _LOW[i] - law[i], 0.0)
        if g == 0:
            leg.walk_excess = excess
        else:
            leg.run_excess = excess
    leg.sole = numbers[_IJ]
    return numbers[0]


@kernel
def offset_at(z, dz, gait, about_pivot, toe, t, speed):  # type: ignore[no-untyped-def]
    """Swing offset [rad] with which the toe sinks at so many m/s at time t [s].

    Turning the frame turns the toe's velocity: the offset follows in closed form. Of the two that there are,
    about half a turn apart, it is the one nearer to the middle of the limits. A toe that is too slow gets the
    nearest it can.

    Args:
        z, dz: from `leg_paths`. gait: as in `swing_hoof`, its offset ignored.
    """
    n = z.shape[1]
    theta = min(max(gait[0] * t, 0.0), 6.28)
    k = int(theta / (2.0 * np.pi) * (n - 1))
    h = 2.0 * np.pi / (n - 1)
    part = theta / h - k
    arm, moving = cubic(z[toe, k], z[toe, k + 1], dz[toe, k], dz[toe, k + 1], h, part)
    if about_pivot:
        centre, drift = cubic(z[_C, k], z[_C, k + 1], dz[_C, k], dz[_C, k + 1], h, part)
        arm, moving = arm - centre, moving - drift
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
    """Height [m] of the swing's centre above a ground that the toe crosses at time t [s].

    Args:
        at, velocity: from `swing_hoof`. h: time between two samples [s].
    """
    part = min(max(t / h, 0.0), at.shape[1] - 1.001)
    k = int(part)
    y, _ = cubic(at[0, k].imag, at[0, k + 1].imag, velocity[0, k].imag, velocity[0, k + 1].imag, h, part - k)
    return -y


@kernel
def compare_gaits(walk, run, both):  # type: ignore[no-untyped-def]
    """Fill `both`, a record of dtype `BOTH`."""
    both.angle_variation = run.angle_variation / walk.angle_variation
    both.step = run.step - walk.step
    both.heel_gap = run.heel_gap - walk.heel_gap
    both.turn = run.push_2 - run.push_1


@kernel
def measure_exact(  # type: ignore[no-untyped-def]
    x, signs, steps, sources, extras, about_pivot, oval, travel, toe, heel, stiffness, exponent,
    by_toe, values, gaits, ovals, z, dz, at, velocity, ankle, work, leg, features, both,
):  # fmt: skip
    """Fill `leg`, `features` (walk, run) and `both` by kinematics alone; the other arrays are scratch.

    With `by_toe` x holds for the hip's height the time at which the walking toe touches down, and for the
    walk's swing offset the logarithm of its approach speed there.
    """
    crank = unpack(x, signs, steps, sources, extras, oval, by_toe, values, gaits, ovals, leg)
    pivot, height = complex(x[_PIVOT_X], x[_PIVOT_Y]), x[_HIP]
    leg.miss, leg.transmission, leg.lowest = 0.0, 1.0, np.inf
    for g in range(2):
        if g == 0 or oval:
            miss, sine = leg_paths(crank, pivot, ovals[g], steps, values, z, dz)
            leg.miss, leg.transmission = max(leg.miss, miss), min(leg.transmission, sine)
        if g == 0 and by_toe:
            speed = np.exp(min(x[_REST + extras], 5.0))
            gaits[0, 1] = offset_at(z, dz, gaits[0], about_pivot, toe, x[_HIP], speed)
            leg.walk_excess += offset_excess(gaits[0, 1])
        lowest = swing_hoof(z, dz, gaits[g], about_pivot, travel, toe, heel, at, velocity, ankle)
        if g == 0 and by_toe:
            height = height_at(at, velocity, 2.0 * np.pi / gaits[0, 0] / (at.shape[1] - 1), x[_HIP])
        leg.lowest = min(leg.lowest, lowest + height)
        measure_gait(
            at, velocity, ankle, height, gaits[g, 0], False, stiffness, exponent, work[g], features[g]
        )
    leg.hip_height, leg.sole_part = height, leg.sole / max(height, 0.1)
    compare_gaits(features[0], features[1], both)


@kernel
def measure_paper(  # type: ignore[no-untyped-def]
    x, height, steps, values, gaits, travel, toe, heel, stiffness, exponent, beta, q, qd, at, velocity, ankle,
    work, features, both,
):  # fmt: skip
    """Fill `features` and `both` through the paper's solver.

    `values`, `gaits` and the hip's `height` [m] are those of `measure_exact`.
    """
    pivot, h = complex(x[_PIVOT_X], x[_PIVOT_Y]), 1e-3
    for g in range(2):
        if euler_cycle(
            np.exp(x[0]), pivot, steps, values, travel, toe, heel, gaits[g], 0.0, h, 15.0, beta,
            q, qd, at, velocity, ankle,
        ):  # fmt: skip
            measure_gait(
                at, velocity, ankle, height, gaits[g, 0], True, stiffness, exponent, work, features[g]
            )
    compare_gaits(features[0], features[1], both)


@kernel
def rate_rows(measured, where, target, per_unit, weights, errors):  # type: ignore[no-untyped-def]
    """Fill the errors in bars and return their cost: a^2 / (1 + a / 2) beyond the dead zone, weighted."""
    cost = 0.0
    for i in range(where.shape[0]):
        error = (measured[where[i]] - target[i]) * per_unit[i]
        errors[i] = error if np.isfinite(error) else MISSED_ROW
        a = max(abs(errors[i]) - DEAD_ZONE, 0.0)
        cost += weights[i] * a * a / (1.0 + 0.5 * a)
    return cost


@kernel
def rate_demands(measured, where, sense, bound, scale, shortages):  # type: ignore[no-untyped-def]
    """Fill the shortages and return their cost: p^2 / (1 + p / 2) + 0.3 p, which closes even a small one."""
    cost = 0.0
    for i in range(where.shape[0]):
        p = sense[i] * (bound[i] - measured[where[i]]) * scale[i]
        shortages[i] = max(p, 0.0) if np.isfinite(p) else MISSED
        cost += shortages[i] * shortages[i] / (1.0 + 0.5 * shortages[i]) + 0.3 * shortages[i]
    return cost
