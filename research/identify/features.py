"""What the paper prints about a gait, and the margins of the shape claims, from one cycle of toe and heel.

Times of touch-down and lift-off and the highest force come from the cubic through penetration and rate at
both ends of a sample, so that two hundred samples a revolution do what the step-by-step simulation needs ten
thousand for. `hoof_env.paper` stays the judge: tests compare.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.ground.contact import Ground
from hoof_env.ground.laws import AMBROSIO, friction_part, normal_force
from hoof_env.paper.shapes import BACKWARD
from hoof_env.simd.compile import kernel

FEATURES = np.dtype(
    [
        (name, "f8")
        for name in (
            # rows of the paper, under the names of their ids [s, deg, N, %, -]
            "contact_start", "contact_end", "duty",
            "angle_contact", "angle_flat", "angle_liftoff", "angle_variation",
            "peak_inelastic", "mean_inelastic", "peak_elastic", "mean_elastic", "reduction",
            "toe_after_heel_in", "toe_after_heel_out",  # how much later the toe enters and leaves [s]
            "double",  # how long both bear; negative: how long neither does in between [s]
            "flattest",  # smallest |hoof angle| while both bear [deg]
            "second_elastic", "second_inelastic",  # prominence of a force's second peak, over its maximum [-]
            "third_peak",  # likewise of the elastic force's third [-]
            "peaks_apart",  # how far its two most prominent peaks keep from the middle of stance [s]
            "dip_support",  # the smaller penetration at the dip between them [m]
            "peak_gap",  # time of the elastic peak minus that of the inelastic one [s]
            "step",  # backward travel of the middle of the sole through stance [m]
            # part of the load on points that move back at `BACKWARD`, at the ground level, 5, 10 cm deeper
            "swept_0", "swept_5", "swept_10",
            "push_1", "push_2",  # horizontal over vertical impulse on the leg in the halves of stance [-]
            "ankle",  # smallest height of the ankle above toe and heel in stance [m]
            "heel_gap",  # height of the heel above the ground at last contact [m]
            "start_depth",  # deepest penetration at the cycle's start, negative in the air [m]
            "extra_entries",  # how often a point comes in after its first time [-]
            "toe_speed",  # approach speed of the toe [m/s]; 0 if it stays in the air
            "missing",  # sum over the points that never touch of their smallest height [m]
        )
    ]
)  # fmt: skip
"""What `measure_gait` fills in; NaN where there is no contact, except the last four."""

NEAR_TOP = 0.9  # a maximum of the samples from this part of the highest may be the highest between them [-]

GROUND = Ground(restitution=0.0)  # the paper's at cr = 0; stiffness and exponent are the leg's
CHI = float(GROUND.to_record()["chi"])
FLOOR, MU, SLOW, FAST = GROUND.approach_floor, GROUND.friction, GROUND.friction_slow, GROUND.friction_fast

EL, INEL, PUSH, TOE_IN, HEEL_IN, TOPS = range(6)
"""Rows of the scratch array of `measure_gait`: forces [N], the elastic one's friction [N], approach speeds
[m/s], 0 in the air, and the inelastic force with its maxima as they are between samples [N]."""


class Cycle(NamedTuple):
    """One revolution of toe and heel, n instants.

    With `sampled`, as the paper's solver does it, the approach speed is that of the first sample inside, not
    of the crossing, and the highest force that of a sample.
    """

    at: NDArray[np.complex128]  # toe and heel, complex, shape (2, n) [m]
    velocity: NDArray[np.complex128]  # likewise [m/s]
    ankle: NDArray[np.float64]  # shape (n,) [m]
    height: float  # of the swing's centre above the ground [m]
    h: float  # time between two instants [s]
    sampled: bool
    stiffness: float  # K of Eq. 14 [N/m^n]
    exponent: float  # n of Eq. 14 [-]


@kernel
def cubic(d0, d1, v0, v1, h, s):  # type: ignore[no-untyped-def]
    """Value and rate at part s of a sample of length h of the cubic with the values and rates at its ends."""
    s2 = s * s
    s3 = s2 * s
    d = (2 * s3 - 3 * s2 + 1) * d0 + (s3 - 2 * s2 + s) * h * v0 + (3 * s2 - 2 * s3) * d1 + (s3 - s2) * h * v1
    v = (6 * s2 - 6 * s) * (d0 - d1) / h + (3 * s2 - 4 * s + 1) * v0 + (3 * s2 - 2 * s) * v1
    return d, v


@kernel
def crossing(d0, d1, v0, v1, h):  # type: ignore[no-untyped-def]
    """Where in a sample the cubic crosses zero, and its rate there; d0 and d1 differ in sign."""
    low, high = 0.0, 1.0
    s = d0 / (d0 - d1)
    for _ in range(30):
        d, v = cubic(d0, d1, v0, v1, h, s)
        if (d > 0.0) == (d1 > 0.0):
            high = s
        else:
            low = s
        new = s - d / (v * h) if v != 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - s) < 1e-12:
            break
        s = new
    return s, cubic(d0, d1, v0, v1, h, s)[1]


@kernel
def force_within(cycle, approach, chi, k, s):  # type: ignore[no-untyped-def]
    """Normal force [N] at part s of the sample that begins at k, by Eq. 14 with the factor `chi`; `approach`:
    speeds of toe and heel at touch-down, shape (2, n) [m/s]."""
    at, velocity, height, total = cycle.at, cycle.velocity, cycle.height, 0.0
    for i in range(2):
        speed = approach[i, k + 1] if approach[i, k + 1] > 0.0 else approach[i, k]
        if speed > 0.0:
            d0, d1 = -height - at[i, k].imag, -height - at[i, k + 1].imag
            d, v = cubic(d0, d1, -velocity[i, k].imag, -velocity[i, k + 1].imag, cycle.h, s)
            if d > 0.0:
                total += normal_force(cycle.stiffness * d**cycle.exponent, chi, 0.0, v, 1 / speed)
    return total


@kernel
def refine(cycle, approach, chi, top):  # type: ignore[no-untyped-def]
    """Highest force [N] within a sample of the one at `top`, and when [s]: on eighths and a parabola."""
    parts, best = 8, 0
    around = np.empty(2 * parts + 1)
    for j in range(2 * parts + 1):
        k = top - 1 if j < parts else top
        s = (j - parts * (k - top + 1)) / parts
        around[j] = force_within(cycle, approach, chi, k, s)
        if around[j] > around[best]:
            best = j
    force, t = around[best], (top - 1 + best / parts) * cycle.h
    if 0 < best < 2 * parts:
        a, b, c = around[best - 1], around[best], around[best + 1]
        bend = a - 2 * b + c
        if bend < 0.0:
            force, t = b - (a - c) ** 2 / (8 * bend), t + 0.5 * (a - c) / bend * cycle.h / parts
    return force, t


@kernel
def peak(cycle, approach, chi, force, tops):  # type: ignore[no-untyped-def]
    """Highest force [N] and when [s]: of the samples, or between them around each maximum near it; fills
    `tops` with the force with those maxima in place of the samples."""
    top = np.argmax(force)
    highest, when = force[top], top * cycle.h
    tops[:] = force
    if cycle.sampled:
        return highest, when
    enough = NEAR_TOP * highest
    for k in range(1, force.shape[0] - 1):
        if force[k] >= enough and force[k] >= force[k - 1] and force[k] >= force[k + 1]:
            tops[k], t = refine(cycle, approach, chi, k)
            if tops[k] > highest:
                highest, when = tops[k], t
    return highest, when


@kernel
def average(cycle, approach, chi, force):  # type: ignore[no-untyped-def]
    """Mean force over the cycle [N]: of the samples, or by Simpson's rule with the middle of each."""
    n, nodes = force.shape[0], 0.5 * (force[0] + force[-1]) + force[1:-1].sum()
    if cycle.sampled:
        return nodes / (n - 1)
    middles = 0.0
    for k in range(n - 1):
        if force[k] > 0.0 or force[k + 1] > 0.0:
            middles += force_within(cycle, approach, chi, k, 0.5)
    return (nodes + 2.0 * middles) / (3.0 * (n - 1))


@kernel
def prominences(force):  # type: ignore[no-untyped-def]
    """Prominence of the second and third peak over the highest force, and samples of the first two in time,
    -1 if there is no second; as in `paper.shapes.find_peaks`."""
    n = force.shape[0]
    largest = np.zeros(3)
    at = np.full(3, -1)
    rising = False
    for k in range(1, n):
        if force[k] > force[k - 1]:
            rising = True
        elif force[k] < force[k - 1] and rising:
            rising = False
            top = k - 1
            while force[top - 1] == force[top]:
                top -= 1
            left, right = force[top], force[top]
            for j in range(top - 1, -1, -1):
                if force[j] > force[top]:
                    break
                left = min(left, force[j])
            for j in range(top + 1, n):
                if force[j] > force[top]:
                    break
                right = min(right, force[j])
            height = force[top] - max(left, right)
            for place in range(3):
                if height > largest[place]:
                    for j in range(2, place, -1):
                        largest[j], at[j] = largest[j - 1], at[j - 1]
                    largest[place], at[place] = height, top
                    break
    scale = max(largest[0], 1e-9)
    return largest[1] / scale, largest[2] / scale, min(at[0], at[1]), max(at[0], at[1])


@kernel
def place(cycle, t):  # type: ignore[no-untyped-def]
    """Toe and heel at the time t [s], complex [m]."""
    at, velocity, h = cycle.at, cycle.velocity, cycle.h
    k = min(max(int(t / h), 0), at.shape[1] - 2)
    toe, _ = cubic(at[0, k], at[0, k + 1], velocity[0, k], velocity[0, k + 1], h, t / h - k)
    heel, _ = cubic(at[1, k], at[1, k + 1], velocity[1, k], velocity[1, k + 1], h, t / h - k)
    return toe, heel


@kernel
def hoof_angle(toe, heel):  # type: ignore[no-untyped-def]
    """Hoof angle [deg], heel up positive."""
    return np.degrees(np.arctan2((heel - toe).imag, (toe - heel).real))


@kernel
def press(cycle, work, out):  # type: ignore[no-untyped-def]
    """Fill the scratch `work` with forces; returns when toe and heel first enter and last leave [s]."""
    at, velocity, height, h = cycle.at, cycle.velocity, cycle.height, cycle.h
    work[:] = 0.0
    enter, leave = np.full(2, np.inf), np.full(2, -np.inf)
    out.start_depth, out.extra_entries, out.missing = -height - min(at[0, 0].imag, at[1, 0].imag), 0.0, 0.0
    for i in range(2):
        approach, entries, highest, before, rate_before = 0.0, 0, -np.inf, 0.0, 0.0
        for k in range(at.shape[1]):
            d, rate = -height - at[i, k].imag, -velocity[i, k].imag
            highest = max(highest, d)
            if d > 0.0:
                if k == 0:
                    approach = max(rate, FLOOR)
                elif before <= 0.0:
                    s, v = crossing(before, d, rate_before, rate, h)
                    approach = max(rate if cycle.sampled else v, FLOOR)
                    entries += 1
                    enter[i] = min(enter[i], (k - 1 + s) * h)
                elastic = cycle.stiffness * d**cycle.exponent
                work[EL, k] += elastic
                work[INEL, k] += normal_force(elastic, CHI, 0.0, rate, 1 / approach)
                slide = velocity[i, k].real
                part = friction_part(abs(slide), AMBROSIO, SLOW, FAST)
                work[PUSH, k] -= math.copysign(elastic * (MU * part), slide)
                work[TOE_IN + i, k] = approach
            elif k > 0 and before > 0.0:
                s, v = crossing(before, d, rate_before, rate, h)
                leave[i] = max(leave[i], (k - 1 + s) * h)
            before, rate_before = d, rate
        if i == 0:
            out.toe_speed = approach
        out.extra_entries += max(entries - 1, 0)
        out.missing += max(-highest, 0.0)
    return enter, leave


@kernel
def swept_load(cycle, deeper):  # type: ignore[no-untyped-def]
    """Part of the elastic load on points that move back at `BACKWARD`, softened over 6 cm/s [-], on a ground
    that lies so much higher [m]."""
    load, swept, height = 1e-9, 0.0, cycle.height - deeper
    for i in range(2):
        for k in range(cycle.at.shape[1]):
            d = -height - cycle.at[i, k].imag
            if d > 0.0:
                f = d**cycle.exponent
                load += f
                swept += f * min(max((-BACKWARD - cycle.velocity[i, k].real) / 0.06 + 0.5, 0.0), 1.0)
    return swept / load


@kernel
def until_middle(values, m):  # type: ignore[no-untyped-def]
    """Sum of samples by the trapezoidal rule from 0 to place m between them; the first is 0."""
    k = min(int(m), values.shape[0] - 2)
    s = m - k
    return values[:k].sum() + (0.5 + s) * values[k] + 0.5 * s * s * (values[k + 1] - values[k])


@kernel
def measure_dip(cycle, first, second, work):  # type: ignore[no-untyped-def]
    """Times of the elastic force's two peaks [s], prominence of the lower over the higher one [-], and the
    smaller penetration at the dip between them [m]; `first`, `second`: the samples of the peaks."""
    force, approach = work[EL], work[TOE_IN:TOPS]
    one, t_one = refine(cycle, approach, 0.0, first)
    two, t_two = refine(cycle, approach, 0.0, second)
    low = first + np.argmin(force[first : second + 1])
    a, b, c = force[low - 1], force[low], force[low + 1]
    bend = a - 2.0 * b + c
    part = 0.5 * (a - c) / bend if bend > 0.0 else 0.0
    toe, heel = place(cycle, (low + part) * cycle.h)
    prominence = (min(one, two) - (b - 0.25 * (a - c) * part)) / max(one, two)
    return t_one, t_two, prominence, -cycle.height - max(toe.imag, heel.imag)


@kernel
def measure_halves(cycle, start, end, work, out):  # type: ignore[no-untyped-def]
    """Fill what compares the halves of stance: impulses, peaks and the dip between them."""
    force, push = work[EL], work[PUSH]
    middle = 0.5 * (start + end)
    load_1, push_1 = until_middle(force, middle / cycle.h), until_middle(push, middle / cycle.h)
    out.push_1 = push_1 / max(load_1, 1e-9)
    out.push_2 = (push.sum() - push_1) / max(force.sum() - load_1, 1e-9)
    out.second_elastic, out.third_peak, first, second = prominences(force)
    out.peaks_apart = 0.0
    if first > 0:
        one, two, out.second_elastic, out.dip_support = measure_dip(cycle, first, second, work)
        out.peaks_apart = min(middle - one, two - middle)
    else:
        toe, heel = place(cycle, middle)
        out.dip_support = -cycle.height - max(toe.imag, heel.imag)
    out.second_inelastic = prominences(work[INEL])[0]


@kernel
def measure_gait(cycle, work, out):  # type: ignore[no-untyped-def]
    """Fill `out`, a record of dtype `FEATURES`, by the scratch `work`, shape (6, n); returns whether there is
    a stance."""
    at, h, n = cycle.at, cycle.h, cycle.at.shape[1]
    enter, leave = press(cycle, work, out)
    start, end = enter.min(), leave.max()
    if not 0.0 < start < end < np.inf or (enter[0] > leave[0] and enter[1] > leave[1]):
        return False  # no stance, or none that begins and ends within the cycle
    for i in range(2):  # a point that never touches does as the other, and `missing` tells
        if enter[i] > leave[i]:
            enter[i], leave[i] = enter[1 - i], leave[1 - i]
    out.contact_start, out.contact_end, out.duty = start, end, (end - start) / (h * (n - 1))
    out.toe_after_heel_in, out.toe_after_heel_out = enter[0] - enter[1], leave[0] - leave[1]
    toe_in, heel_in = place(cycle, start)
    toe_out, heel_out = place(cycle, end)
    out.angle_contact, out.angle_liftoff = hoof_angle(toe_in, heel_in), hoof_angle(toe_out, heel_out)
    out.step = 0.5 * (toe_in + heel_in - toe_out - heel_out).real
    out.heel_gap = heel_out.imag + cycle.height
    out.angle_variation = out.angle_liftoff - out.angle_contact
    double, until = enter.max(), leave.min()
    out.double = until - double
    toe_flat, heel_flat = place(cycle, 0.5 * (double + until))
    out.angle_flat = hoof_angle(toe_flat, heel_flat)  # a number even if they never both bear: `double` tells
    out.flattest, before = abs(out.angle_flat), 0.0
    for k in range(int(double / h) + 1, min(int(until / h) + 1, n)):
        angle = hoof_angle(at[0, k], at[1, k])
        out.flattest = 0.0 if angle * before < 0.0 else min(out.flattest, abs(angle))
        before = angle
    approach, elastic, inelastic = work[TOE_IN:TOPS], work[EL], work[INEL]
    out.peak_elastic, later = peak(cycle, approach, 0.0, elastic, work[TOPS])
    out.peak_inelastic, sooner = peak(cycle, approach, CHI, inelastic, work[TOPS])
    out.mean_elastic = average(cycle, approach, 0.0, elastic)
    out.mean_inelastic = average(cycle, approach, CHI, inelastic)
    out.peak_gap = later - sooner
    out.reduction = 100.0 * (out.peak_inelastic - out.peak_elastic) / max(out.peak_inelastic, 1e-9)
    out.ankle = np.inf
    for k in range(n):
        if start <= k * h <= end:
            out.ankle = min(out.ankle, cycle.ankle[k] - max(at[0, k].imag, at[1, k].imag))
    measure_halves(cycle, start, end, work, out)
    out.swept_0, out.swept_5 = swept_load(cycle, 0.0), swept_load(cycle, 0.05)
    out.swept_10 = swept_load(cycle, 0.1)
    return True
