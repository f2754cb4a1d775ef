"""Slips of Eqs. 10 to 14: what the ground would do if each were taken by its letter.

On a fixed trunk the ground moves nothing, so every reading is a function of the same paths of toe and heel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hoof_env.ground.contact import Ground
from hoof_env.ground.normal_force import lankarani_nikravesh, restitution_of_factor
from hoof_env.ground.preset import HERTZ
from hoof_env.paper.measure import POINTS, integral
from hoof_env.paper.published import Published
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.shapes import find_peaks
from hoof_env.paper.study.replay import replay
from hoof_env.paper.study.section import listed
from hoof_env.paper.study.slip import CHANGES, HARMLESS, IMPOSSIBLE, Slip, change, effect_of

Trace = NDArray[np.void]
Traces = Mapping[tuple[str, str], Trace]
"""One cycle by gait and condition, solver 'exact'."""

SOLVER = "exact"
"""The solver whose cycles are examined."""

NAMES = {"walk": "walking", "run": "running"}
FIRST_POINT = {"walk": "heel", "run": "toe"}
"""The point that the text below Eq. 10 names for each gait: H for heel-first, K for toe-first contact."""


def contact_slips(traces: Traces, published: Published, ground: Ground) -> list[Slip]:
    """The slips of Eqs. 10 to 14 and of the stiffness in Table 1; `ground` is that of the traces."""
    return [
        _level(traces, ground),
        _one_point(traces),
        _sign_of_penetration(traces, ground),
        _same_index(traces, published),
        _restitution_names(traces, ground),
        _plastic(),
        _stiffness_unit(traces, ground),
    ]


def _peak(trace: Trace) -> float:
    return float(trace["normal"].max())


def over_cycle(trace: Trace, values: NDArray[np.float64]) -> float:
    """Integral over the whole cycle."""
    return integral(trace, values, float(trace["t"][0]), float(trace["t"][-1]))


def force_in_the_air(trace: Trace, ground: Ground) -> NDArray[np.float64]:
    """Eq. 14, elastic, under the condition of Eq. 11 with delta of Eq. 10: force on a hoof in the air [N]."""
    heights = (np.maximum(-trace[f"{name}_penetration"], 0) for name in POINTS)
    return np.asarray(sum(ground.stiffness * height**ground.exponent for height in heights))


def _level(traces: Traces, ground: Ground) -> Slip:
    depth = {
        gait: max(float(traces[gait, "elastic"][f"{name}_penetration"].max()) for name in POINTS)
        for gait in GAITS
    }
    run = _peak(replay(traces["run", "elastic"], ground, rise=-depth["walk"]))
    read = _peak(traces["run", "elastic"])
    return Slip(
        "eq10.level",
        "below Eq. 10",
        "ground 'levelled from the lowest point of the locomotive trajectory'",
        "one level for both gaits, identified, above the lowest points",
        "nothing can lie below the lowest point of a path",
        "at its own lowest point no gait touches the ground. The paths here reach "
        f"{100 * depth['walk']:.1f} cm (walking) and {100 * depth['run']:.1f} cm (running) below the "
        "identified level; on the walk's lowest point walking has no force at all and running an elastic "
        f"peak of {run:.0f} N ({read:.0f} N on the identified level)",
        CHANGES,
        {"depth_m": depth, "run_peak_on_walk_level_N": run, "run_peak_N": read},
    )


def _one_point(traces: Traces) -> Slip:
    parts, changes, data = [], [], {}
    for gait, point in FIRST_POINT.items():
        trace = traces[gait, "elastic"]
        alone, both = trace[f"{point}_normal"], trace["normal"]
        changes.append(change(float(alone.max()), float(both.max())))
        peaks = len(find_peaks(alone)), len(find_peaks(both))
        loaded = float(over_cycle(trace, alone) / over_cycle(trace, both))
        parts.append(
            f"{NAMES[gait]} on the {point} alone has {peaks[0]} peak(s) instead of {peaks[1]}, "
            f"{alone.max():.0f} N instead of {both.max():.0f}, and {100 * loaded:.0f} % of the impulse"
        )
        data[gait] = {
            "peaks": peaks,
            "peak_N": float(alone.max()),
            "peak_read_N": float(both.max()),
            "impulse": loaded,
        }
    return Slip(
        "eq10.point",
        "below Eq. 10",
        "contact point K 'toe-first or H for the case of heel first contact'",
        "toe and heel, each with its own contact",
        "section 3 counts 'multiple contact points'",
        "; ".join(parts),
        effect_of(*changes),
        data,
    )


def _sign_of_penetration(traces: Traces, ground: Ground) -> Slip:
    air = {gait: float(force_in_the_air(traces[gait, "elastic"], ground).max()) for gait in GAITS}
    words = listed(f"{air[gait]:.0f} N in {NAMES[gait]}" for gait in GAITS)
    value: complex = (-0.01) ** ground.exponent
    return Slip(
        "eq11.sign",
        "Eqs. 10, 11",
        "`δ = y_G - P_n`, and 'δ > 0: F_n = 0'",
        "force where δ = y_G - P_n > 0",
        "Eq. 10 is positive inside the ground, Eq. 11 asks for the opposite",
        f"both together: no force in the ground, and one of up to {words} while the hoof is in the air. "
        "Taking δ of Eq. 11, negative inside, into Eq. 14 gives no real force: (-0.01)^"
        f"{ground.exponent:g} has the imaginary part {value.imag:.2g}. With -δ and its rate throughout, Eq. "
        "14 is as read: the ratio of the rates keeps its sign",
        CHANGES,
        {"air_N": air},
    )


def _same_index(traces: Traces, published: Published) -> Slip:
    ours = {
        gait: 100 * (1 - _peak(traces[gait, "elastic"]) / _peak(traces[gait, "inelastic"])) for gait in GAITS
    }
    printed = {gait: published.row(f"{gait}.reduction").value for gait in GAITS}
    words = listed(
        f"{printed[gait]} % in print and {ours[gait]:.1f} % here ({NAMES[gait]})" for gait in GAITS
    )
    return Slip(
        "eq12.index",
        "Eqs. 12, 13",
        "`(r'_i - r'_i)`, one index twice",
        "`(r'_i - r'_j)`, j the ground at rest; the rate of δ is minus the upward velocity",
        "a difference with itself is zero",
        "both velocities vanish: Eq. 14 divides 0 by 0, or without its second term makes elastic and "
        f"inelastic the same, a reduction of 0 % where it is {words}; and there is no friction, so the "
        "resultant is the normal force",
        IMPOSSIBLE,
        {"reduction_%": ours, "printed_%": printed},
    )


def _departures(trace: Trace, name: str) -> NDArray[np.float64]:
    """At each sample the rate with which a point leaves the ground after it [m/s], NaN in the air."""
    inside = trace[f"{name}_penetration"] > 0
    speed, result = np.nan, np.full(len(trace), np.nan)
    for k in range(len(trace) - 1, -1, -1):
        if inside[k]:
            if k + 1 == len(trace) or not inside[k + 1]:
                speed = abs(float(trace[f"{name}_rate"][k]))
            result[k] = speed
    return result


def _restitution_names(traces: Traces, ground: Ground) -> Slip:
    chi = lankarani_nikravesh(0.0)
    peaks, ratios = {}, {}
    for gait in GAITS:
        trace, total = traces[gait, "inelastic"], np.zeros(len(traces[gait, "inelastic"]))
        for name in POINTS:
            inside = trace[f"{name}_penetration"] > 0
            leave = np.where(inside, _departures(trace, name), 1.0)
            d = np.where(inside, trace[f"{name}_penetration"], 0.0)
            factor = np.maximum(1 + chi * trace[f"{name}_rate"] / leave, 0)
            total = total + ground.stiffness * d**ground.exponent * factor
            ratios[f"{gait} {name}"] = (
                float(trace[f"{name}_approach"][inside][0] / leave[inside][0]) if inside.any() else None
            )
        peaks[gait] = float(np.max(total)), _peak(trace)
    words = listed(f"{NAMES[gait]} {one:.0f} N instead of {two:.0f}" for gait, (one, two) in peaks.items())
    return Slip(
        "eq14.names",
        "below Eq. 14",
        "cr 'the ratio of relative approach velocity δ'(+) and ... departing velocity δ'(-)'",
        "departing over approach; δ'(-) in Eq. 14 is the approach velocity",
        "cr would be 1 or more for every real impact, and the departing velocity is unknown while the "
        "force acts",
        f"known here only because the motion is prescribed; dividing by it gives inelastic peaks of {words}",
        effect_of(*(change(one, two) for one, two in peaks.values())),
        {"peaks_N": peaks, "approach_over_departure": ratios},
    )


def _plastic() -> Slip:
    e = restitution_of_factor(lankarani_nikravesh(0.0))
    return Slip(
        "eq14.plastic",
        "below Eq. 14",
        "'fully elastic cr = 1 (or plastic) cr = 0'",
        "cr = 0 is a label of the law, not its restitution",
        "Lankarani and Nikravesh derive Eq. 14 for cr near 1",
        f"a free impact under Eq. 14 with cr = 0 rebounds with {e:.2f} of its speed. The part on damping "
        "laws gives the four conditions under laws whose restitution is what they say",
        CHANGES if e > 0.05 else HARMLESS,
        {"restitution_at_0": e},
    )


def _stiffness_unit(traces: Traces, ground: Ground) -> Slip:
    n = ground.exponent
    whose = (
        "Lankarani and Nikravesh's" if n == HERTZ else f"identified ({HERTZ:g} is Lankarani and Nikravesh's)"
    )
    peaks = {
        gait: (
            _peak(replay(traces[gait, "elastic"], replace(ground, exponent=1.0))),
            _peak(traces[gait, "elastic"]),
        )
        for gait in GAITS
    }
    words = listed(f"{NAMES[gait]} {one:.0f} N instead of {two:.0f}" for gait, (one, two) in peaks.items())
    return Slip(
        "table1.stiffness",
        "Table 1, Eq. 14",
        "K in N/m, and δ^n with n not printed",
        f"n = {n:g}, {whose}, and K in N/m^{n:g}",
        "N/m fits n = 1 only",
        f"n = 1 on this leg gives elastic peaks of {words}. Another leg could be identified for n = 1, so "
        "the unit decides nothing; the part on damping laws shows exponents between",
        effect_of(*(change(one, two) for one, two in peaks.values())),
        {"peaks_N": peaks},
    )
