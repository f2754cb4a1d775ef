"""One crank revolution on a fixed trunk, from kinematics alone: what the search evaluates thousands of times.

The crank and the swing are prescribed, so the ground moves nothing and its force follows from the paths of toe
and heel. `leg_paths` finds every point of the linkage over a revolution; a dyad that cannot close is stretched
out and the miss reported, so that a search can climb back to legs that assemble. `swing_hoof` turns and places
the hoof; `measure_gait` reads off it what the paper prints, and the margins of the shape claims.

Times of touch-down and lift-off come from the cubic through penetration and rate at both ends of a sample, so
that a thousand samples a revolution (or a few hundred) do what the step-by-step simulation needs ten thousand
for. `hoof_env.paper.reproduce` stays the judge: tests compare.
"""

from __future__ import annotations

import numpy as np

from hoof_env._jit import kernel
from hoof_env.leg.kinematics import cross, dot
from hoof_env.leg.linkage import POINTS

_NUMBER = {name: i for i, name in enumerate(POINTS)}
_O, _C, _P, _G = (_NUMBER[name] for name in "OCPG")

FEATURES = (
    "contact_start", "contact_end",  # [s]
    "angle_contact", "angle_liftoff", "angle_flat",  # [deg]
    "peak_inelastic", "mean_inelastic", "peak_elastic", "mean_elastic",  # [N]
    "resultant_inelastic", "resultant_elastic",  # peaks of the resultant [N]
    "toe_after_heel_in", "toe_after_heel_out",  # how much later the toe enters and leaves [s]
    "dip",  # how far the force falls between the halves' peaks, over the highest force [-]
    "dip_support",  # the smaller penetration at the dip [m]
    "peak_gap",  # time of the elastic peak minus that of the inelastic one [s]
    "valleys_elastic", "valleys_inelastic",  # how far the force falls between two rises, over the highest [-]
    "step",  # backward travel of the middle of the sole through stance [m]
    "swept_0", "swept_5", "swept_10",  # part of the load on points that move back at 0.3 m/s, 0, 5, 10 cm deeper
    "propulsion_1", "propulsion_2",  # horizontal over vertical impulse on the leg in the halves of stance [-]
    "ankle_margin",  # smallest height of the ankle above toe and heel in stance [m]
    "heel_gap",  # height of the heel above the ground at last contact [m]
    "start_depth",  # penetration at the start of the cycle [m]
    "extra_entries",  # how often a point comes in after its first time [-]
    "missing",  # points of the hoof that never touch: the height of the lowest instant above the ground [m]
)  # fmt: skip
"""What `measure_gait` fills in, in this order."""

BACKWARD = 0.3
"""How fast the sole must move back under half of the load [m/s]."""


@kernel
def leg_paths(crank, pivot, oval, steps, values, z, dz):  # type: ignore[no-untyped-def]
    """Fill `z`, `dz` (complex, shape (points, n)) over one revolution; returns (miss, transmission).

    Column k stands at theta = 2 pi k / (n - 1); lengths in m, derivatives by theta. The pivot C follows
    pivot + oval[0] exp(i theta) + oval[1] exp(-i theta), an ellipse; zeros hold it still.

    Returns:
        miss: largest gap over the revolution of a dyad that does not close, over the dyad's reach [-].
        transmission: smallest |sine| of the angle between the links of a dyad [-].
    """
    n = z.shape[1]
    miss, transmission = 0.0, 1.0
    for k in range(n):
        theta = 2.0 * np.pi * k / (n - 1)
        turn = complex(np.cos(theta), np.sin(theta))
        z[_O, k], dz[_O, k] = 0j, 0j
        one, two = oval[0] * turn, oval[1] * np.conj(turn)
        z[_C, k], dz[_C, k] = pivot + one + two, 1j * (one - two)
        z[_P, k] = crank * np.conj(turn)
        dz[_P, k] = -1j * z[_P, k]
        for j in range(steps.shape[0]):
            p, a, b = steps[j, 1], steps[j, 2], steps[j, 3]
            r1 = values[j, 0]
            span = z[b, k] - z[a, k]
            if steps[j, 0] == 1:
                r2 = values[j, 1]
                d2 = dot(span, span) + 1e-12
                along = 0.5 + (r1 * r1 - r2 * r2) / (2.0 * d2)
                across2 = r1 * r1 / d2 - along * along
                d = np.sqrt(d2)
                miss = max(miss, (d - r1 - r2) / (r1 + r2), (abs(r1 - r2) - d) / (r1 + r2))
                across = np.sqrt(max(across2, 1e-8))
                transmission = min(transmission, d2 * across / (r1 * r2))
                z[p, k] = z[a, k] + span * complex(along, values[j, 2] * across)
                e1, e2 = z[p, k] - z[a, k], z[p, k] - z[b, k]
                k1, k2 = dot(e1, dz[a, k]), dot(e2, dz[b, k])
                dz[p, k] = 1j * (k2 * e1 - k1 * e2) * (1.0 / (cross(e1, e2) + values[j, 2] * 1e-12))
            else:
                o = steps[j, 4]
                z[p, k] = z[o, k] + r1 * span
                dz[p, k] = dz[o, k] + r1 * (dz[b, k] - dz[a, k])
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
    lowest = 1e9
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


@kernel
def crossing(d0, d1, v0, v1, h):  # type: ignore[no-untyped-def]
    """Where in a sample of length h the penetration crosses zero: (part of the sample, rate there).

    From the cubic with values d0, d1 and rates v0, v1 at the ends; d0 and d1 differ in sign.
    """
    low, high = 0.0, 1.0
    s = d0 / (d0 - d1)
    for _ in range(30):
        s2 = s * s
        s3 = s2 * s
        d = (
            (2 * s3 - 3 * s2 + 1) * d0
            + (s3 - 2 * s2 + s) * h * v0
            + (3 * s2 - 2 * s3) * d1
            + (s3 - s2) * h * v1
        )
        slope = (6 * s2 - 6 * s) * (d0 - d1) + (3 * s2 - 4 * s + 1) * h * v0 + (3 * s2 - 2 * s) * h * v1
        if (d > 0.0) == (d1 > 0.0):
            high = s
        else:
            low = s
        new = s - d / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - s) < 1e-12:
            break
        s = new
    s2 = s * s
    slope = (6 * s2 - 6 * s) * (d0 - d1) / h + (3 * s2 - 4 * s + 1) * v0 + (3 * s2 - 2 * s) * v1
    return s, slope


@kernel
def friction_part(v):  # type: ignore[no-untyped-def]
    """Friction over mu N against a sliding velocity v [m/s], with Ambrosio's correction of the paper preset."""
    size = min(max((abs(v) - 1e-3) / 9e-3, 0.0), 1.0)
    return -size if v > 0 else size


@kernel
def top(force, k):  # type: ignore[no-untyped-def]
    """Vertex of the parabola through a largest sample and its neighbours."""
    if k == 0 or k == force.shape[0] - 1:
        return force[k]
    a, b, c = force[k - 1], force[k], force[k + 1]
    bend = a - 2 * b + c
    return b - (a - c) ** 2 / (8 * bend) if bend < 0 else b


@kernel
def valley(force):  # type: ignore[no-untyped-def]
    """Deepest fall between two rises of a force that starts and ends at 0, over its maximum [-]."""
    n = force.shape[0]
    deepest = 0.0
    k_top, f_top = 0, 0.0
    for k in range(n):
        if force[k] > f_top:
            f_top, k_top = force[k], k
    if f_top <= 0.0:
        return 0.0
    best = 0.0  # left of the top: falls below the highest so far
    for k in range(k_top + 1):
        best = max(best, force[k])
        deepest = max(deepest, best - force[k])
    best = 0.0
    for k in range(n - 1, k_top - 1, -1):
        best = max(best, force[k])
        deepest = max(deepest, best - force[k])
    return deepest / f_top


@kernel
def measure_gait(at, velocity, ankle, height, speed, sampled, stiffness, exponent, work, out):  # type: ignore[no-untyped-def]
    """Fill `out`, in the order of `FEATURES`, from one revolution of toe and heel.

    Args:
        at, velocity, ankle: from `swing_hoof`, or from a simulation: complex (2, n), (2, n) and (n,).
        height: of the swing's centre above the ground [m].
        speed: crank speed [rad/s].
        sampled: the approach speed is that of the first sample inside, not of the crossing.
        stiffness, exponent: of Eq. 14.
        work: scratch, shape (6, n).
    """
    n = at.shape[1]
    h = 2.0 * np.pi / speed / (n - 1)
    el, inel, hor = work[0], work[1], work[2]
    res_el, res_in = 0.0, 0.0
    for k in range(n):
        el[k], inel[k], hor[k] = 0.0, 0.0, 0.0
        work[3, k], work[4, k] = 0.0, 0.0
    enter, leave = np.array([9.0, 9.0]), np.array([-9.0, -9.0])
    extra, missing, start_depth = 0.0, 0.0, 0.0
    for i in range(2):
        approach, entries, highest = 0.0, 0, -1e9
        for k in range(n):
            d, rate = -height - at[i, k].imag, -velocity[i, k].imag
            highest = max(highest, d)
            if d > 0.0:
                if k == 0:
                    approach = max(rate, 1e-4)
                    start_depth = max(start_depth, d)
                elif -height - at[i, k - 1].imag <= 0.0:
                    s, v = crossing(-height - at[i, k - 1].imag, d, -velocity[i, k - 1].imag, rate, h)
                    approach = max(rate if sampled else v, 1e-4)
                    entries += 1
                    enter[i] = min(enter[i], (k - 1 + s) * h)
                elastic = stiffness * (d * np.sqrt(d) if exponent == 1.5 else d**exponent)
                factor = max(1.0 + 0.75 * rate / approach, 0.0)
                el[k] += elastic
                inel[k] += elastic * factor
                part = 0.4 * friction_part(velocity[i, k].real)
                hor[k] += elastic * part
                work[3, k] += elastic * factor * part
            elif k > 0 and -height - at[i, k - 1].imag > 0.0:
                s, v = crossing(-height - at[i, k - 1].imag, d, -velocity[i, k - 1].imag, rate, h)
                leave[i] = max(leave[i], (k - 1 + s) * h)
        extra += max(entries - 1, 0)
        missing += max(-highest, 0.0)
    for j in range(out.shape[0]):
        out[j] = np.nan
    out[26], out[27], out[28] = start_depth, extra, missing
    if not (leave.max() > 0.0 and enter.min() < 9.0):
        return
    if enter[0] > 8.0 or leave[0] < 0.0:
        enter[0], leave[0] = enter[1] + 1.0, leave[1] - 1.0
    if enter[1] > 8.0 or leave[1] < 0.0:
        enter[1], leave[1] = enter[0] + 1.0, leave[0] - 1.0
    start, end = enter.min(), leave.max()
    out[0], out[1] = start, end
    middle = 0.5 * (start + end)
    both = 0.5 * (enter.max() + leave.min())
    for j in range(3):
        t = (start, end, both)[j]
        x = min(max(t / h, 0.0), n - 1.001)
        k = int(x)
        s = x - k
        arm0, arm1 = at[1, k] - at[0, k], at[1, k + 1] - at[0, k + 1]
        a0 = np.arctan2(arm0.imag, -arm0.real)
        turned = np.conj(arm0) * arm1
        out[2 + j] = np.degrees(a0 - s * np.arctan2(turned.imag, turned.real))
    k_el, k_in, k_1, k_2 = 0, 0, 0, 0
    sum_el, sum_in = 0.0, 0.0
    hor_1, ver_1, hor_2, ver_2 = 0.0, 1e-9, 0.0, 1e-9
    margin = 1e9
    for k in range(n):
        t = k * h
        sum_el += el[k]
        sum_in += inel[k]
        res_el = max(res_el, np.hypot(el[k], hor[k]))
        res_in = max(res_in, np.hypot(inel[k], work[3, k]))
        if el[k] > el[k_el]:
            k_el = k
        if inel[k] > inel[k_in]:
            k_in = k
        if t < middle:
            hor_1 += hor[k]
            ver_1 += el[k]
            if el[k] > el[k_1]:
                k_1 = k
        else:
            hor_2 += hor[k]
            ver_2 += el[k]
            if k_2 == 0 or el[k] > el[k_2]:
                k_2 = k
        if start <= t <= end:
            margin = min(margin, ankle[k] - max(at[0, k].imag, at[1, k].imag))
    out[5], out[6] = top(inel, k_in), sum_in / (n - 1)
    out[7], out[8] = top(el, k_el), sum_el / (n - 1)
    out[9], out[10] = res_in, res_el
    out[11], out[12] = enter[0] - enter[1], leave[0] - leave[1]
    k_dip = k_1
    for k in range(k_1, max(k_2, k_1) + 1):
        if el[k] < el[k_dip]:
            k_dip = k
    out[13] = (min(el[k_1], el[k_2]) - el[k_dip]) / max(el[k_el], 1e-9)
    out[14] = -height - max(at[0, k_dip].imag, at[1, k_dip].imag)
    out[15] = (k_el - k_in) * h
    out[16], out[17] = valley(el), valley(inel)
    k0, k1 = int(start / h + 0.5), min(int(end / h + 0.5), n - 1)
    out[18] = 0.5 * (at[0, k0] + at[1, k0] - at[0, k1] - at[1, k1]).real
    for j in range(3):
        deep = height - 0.05 * j
        load, swept = 1e-9, 0.0
        for i in range(2):
            for k in range(n):
                d = -deep - at[i, k].imag
                if d > 0.0:
                    f = d * np.sqrt(d)
                    load += f
                    swept += f * min(max((-BACKWARD - velocity[i, k].real) / 0.06 + 0.5, 0.0), 1.0)
        out[19 + j] = swept / load
    out[22], out[23] = hor_1 / ver_1, hor_2 / ver_2
    out[24] = margin
    x = min(max(end / h, 0.0), n - 1.001)
    k = int(x)
    out[25] = at[1, k].imag + (x - k) * (at[1, k + 1].imag - at[1, k].imag) + height
