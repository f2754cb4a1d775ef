"""Claims of the paper about shape, each decided by numbers: pure functions of measured cycles.

`walk.direction` has two readings. Figure 6 shows a 'braking force' in walking, the ground reaction force
'directed to the against moving direction'. Literally (`BRAKING`) the ground pushes the leg back throughout
its stance. Under Coulomb friction this requires a hoof that slides forward under load, and such a walk cannot
move an animal forward: it contradicts `walk.walks`. The arrows may also be the force of the hoof on the
ground (`HOOF_ON_GROUND`): they point back while the ground pushes the leg forward. Both readings get a
verdict. The claim is counted by the reading that the net impulse of the walking stance leaves possible
(`walk_brakes`), which is the same for every solver. A walk that brakes in one half of stance and propels in
the second fulfils neither reading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hoof_env.paper.measure import POINTS, Stance, Trace, integral, measure_stance

PROMINENCE = 0.1
"""Least prominence of a force peak that counts, as a share of the highest force [-]."""

PEAK_GAP = 0.01
"""Least distance of two peaks that are apart in time [s], ten time steps of the paper."""

FLAT_DEG = 3.0
"""Largest angle of a flat hoof [deg], the bar of the published angle at mid-stance."""

DEPTHS = (0.0, 0.05, 0.1)
"""Depths below the identified ground level at which a leg must walk and run [m]."""

BACKWARD = 0.3
"""Least backward speed of the sole under load at these depths [m/s]."""

# Readings of `walk.direction`, see the module.
BRAKING = "braking"
HOOF_ON_GROUND = "hoof on ground"


@dataclass(frozen=True)
class Verdict:
    """Verdict on a claim.

    Attributes:
        holds: True if the claim holds.
        evidence: numbers that decide it, as text.
        readings: verdicts by reading, if there are several.
        used: the reading of which `holds` is the verdict, or "".
    """

    holds: bool
    evidence: str
    readings: dict[str, bool] = field(default_factory=dict)
    used: str = ""


def find_peaks(force: NDArray[np.float64]) -> list[int]:
    """Find the prominent local maxima of a force that rises from 0 and returns to 0.

    The prominence of a maximum is its height above the higher of the two lowest values between it and the
    nearest higher values (or the ends) on either side; it must reach `PROMINENCE` of the highest force. A
    plateau counts once, at its first sample.

    Args:
        force: the force, shape (n,) [N].

    Returns:
        Indices of the maxima.
    """
    steps = np.diff(force)
    # Without the steps of plateaus, where the sign does not change from + to -.
    moving = np.flatnonzero(steps)
    turns = (steps[moving[:-1]] > 0) & (steps[moving[1:]] < 0)
    places = []
    for k in (moving[:-1][turns] + 1).tolist():
        # A pass to higher values on one side may be lower than on the other; the higher pass counts.
        higher = np.flatnonzero(force > force[k])
        left = higher[higher < k]
        right = higher[higher > k]
        base_left = force[left[-1] if left.size else 0 : k].min()
        base_right = force[k : right[0] + 1 if right.size else None].min()
        if force[k] - max(base_left, base_right) >= PROMINENCE * force.max():
            places.append(k)
    return places


def _first(stance: Stance) -> str:
    """Return the first contact as text."""
    points = " and ".join(sorted(stance.first_points))
    return f"first in: {points} at {stance.start:.3f} s, {stance.angle_start_deg:.1f} deg"


def _last(stance: Stance) -> str:
    """Return the last contact as text."""
    points = " and ".join(sorted(stance.last_points))
    return f"last out: {points} at {stance.end:.3f} s, {stance.angle_end_deg:.1f} deg"


def walk_order(walk: Stance, trace: Trace) -> Verdict:
    """Judge the order heel-strike, flat, toe-off: the heel touches first, then both points bear load with the
    sole flat within `FLAT_DEG` at some instant, and the toe leaves last."""
    smallest = float("inf")
    phase = "never both in the ground"
    if walk.double:
        start, end = walk.double
        phase = f"both bear {start:.3f}-{end:.3f} s"
        both = np.degrees(trace["hoof_angle"][(trace["time"] >= start) & (trace["time"] <= end)])
        smallest = float(np.abs(both).min()) if both.size else smallest
    return Verdict(
        walk.first_points == {"heel"} and smallest <= FLAT_DEG and walk.last_points == {"toe"},
        f"{_first(walk)}; {phase}, smallest |angle| there {smallest:.1f} deg; {_last(walk)}",
    )


def walk_peaks(walk: Stance, trace: Trace) -> Verdict:
    """Judge the two peaks of the walking force: the normal force has two peaks, one in each half of stance,
    and toe and heel both bear load at the minimum between them."""
    force = trace["normal"]
    t = trace["time"]
    peaks = find_peaks(force)
    evidence = ", ".join(f"{force[k]:.0f} N at {t[k]:.3f} s" for k in peaks)
    evidence = f"{len(peaks)} peak(s): {evidence}; middle of stance {walk.middle:.3f} s"
    if len(peaks) != 2:
        return Verdict(False, evidence)
    dip = peaks[0] + int(np.argmin(force[peaks[0] : peaks[1]]))
    toe = float(trace["toe_normal"][dip])
    heel = float(trace["heel_normal"][dip])
    return Verdict(
        bool(t[peaks[0]] < walk.middle < t[peaks[1]]) and toe > 0 and heel > 0,
        f"{evidence}; dip {force[dip]:.0f} N at {t[dip]:.3f} s with toe {toe:.0f} N and heel {heel:.0f} N",
    )


def run_order(run: Stance, walk: Stance, run_trace: Trace, walk_trace: Trace) -> Verdict:
    """Judge the order toe-strike, roll-over, toe-off with a large gap: the toe touches first, the heel
    follows and leaves before the toe, and at toe-off the heel is higher above the ground than at toe-off in
    walking."""
    gaps = [
        float(-np.interp(stance.end, trace["time"], trace["heel_penetration"]))
        for stance, trace in ((run, run_trace), (walk, walk_trace))
    ]
    rolls = run.first_points == {"toe"} and bool(run.heel) and run.last_points == {"toe"}
    heel = "never in the ground"
    if run.heel:
        heel = f"in the ground {run.heel[0][0]:.3f}-{run.heel[-1][1]:.3f} s"
    return Verdict(
        rolls and gaps[0] > gaps[1],
        f"{_first(run)}; heel {heel}; {_last(run)}; "
        f"heel {100 * gaps[0]:.1f} cm above the ground then, walking {100 * gaps[1]:.1f} cm",
    )


def run_peaks(elastic: Trace, inelastic: Trace) -> Verdict:
    """Judge the peaks of the running force: one peak of the normal force in each condition, at least
    `PEAK_GAP` apart in time."""
    peaks = [find_peaks(trace["normal"]) for trace in (elastic, inelastic)]
    times = [float(trace["time"][np.argmax(trace["normal"])]) for trace in (elastic, inelastic)]
    gap = times[0] - times[1]
    return Verdict(
        all(len(places) == 1 for places in peaks) and abs(gap) >= PEAK_GAP,
        f"elastic {len(peaks[0])} peak(s), highest at {times[0]:.4f} s; inelastic {len(peaks[1])}, highest "
        f"at {times[1]:.4f} s; the elastic one is {1000 * gap:+.1f} ms later",
    )


def step_length(trace: Trace, stance: Stance) -> tuple[float, float]:
    """Measure the way of the middle of the sole relative to the trunk.

    Returns:
        The way back from first to last contact [m], by which a body would pass over the hoof in one stance;
        and the horizontal extent of the closed path over the cycle [m].
    """
    # Relative to the trunk, which is fixed here, but need not be at x = 0.
    sole = (trace["toe_x"] + trace["heel_x"]) / 2 - trace["x"]
    start, end = np.interp([stance.start, stance.end], trace["time"], sole)
    return float(start - end), float(np.ptp(sole))


def run_step(run: Stance, walk: Stance, run_trace: Trace, walk_trace: Trace) -> Verdict:
    """Judge the step: the sole travels farther back in the running stance than in walking (`step_length`)."""
    run_step, run_path = step_length(run_trace, run)
    walk_step, walk_path = step_length(walk_trace, walk)
    return Verdict(
        run_step > walk_step,
        f"sole travels back {run_step:.3f} m in the running stance, {walk_step:.3f} m in the walking one; "
        f"horizontal extent of its path over the cycle {run_path:.3f} m and {walk_path:.3f} m",
    )


def half_impulses(trace: Trace, stance: Stance) -> list[tuple[float, float]]:
    """Return the horizontal (forward positive) and the vertical impulse on the leg in each half of stance
    [N s]."""
    halves = ((stance.start, stance.middle), (stance.middle, stance.end))
    return [
        (integral(trace, trace["friction"], *half), integral(trace, trace["normal"], *half))
        for half in halves
    ]


def walk_brakes(walk: Stance, trace: Trace) -> bool:
    """Return True if the net impulse of the ground over the walking stance pushes the leg back."""
    return sum(along for along, _ in half_impulses(trace, walk)) < 0


def walk_direction(walk: Stance, trace: Trace, brakes: bool) -> Verdict:
    """Judge braking throughout the walking stance: the force points back in both halves.

    Args:
        walk: the walking stance.
        trace: its cycle.
        brakes: True, of a leg that `walk_brakes`, uses the reading `BRAKING`; False uses `HOOF_ON_GROUND`.
    """
    (first, _), (second, _) = half_impulses(trace, walk)
    # Friction is the force of the ground on the leg; the force of the hoof on the ground is its opposite.
    readings = {BRAKING: first < 0 and second < 0, HOOF_ON_GROUND: first > 0 and second > 0}
    used, why = (
        (BRAKING, "this walk is braked over its stance as a whole, and cannot move its animal forward")
        if brakes
        else (HOOF_ON_GROUND, "a walk that literally brakes cannot move its animal forward, see walk.walks")
    )
    verdicts = ", ".join(f"'{name}' {'holds' if ok else 'does not hold'}" for name, ok in readings.items())
    return Verdict(
        readings[used],
        f"horizontal impulse on the leg {first:+.2f} N s in the first half of stance, {second:+.2f} N s in "
        f"the second, {first + second:+.2f} N s in all (forward positive): {verdicts}; used is '{used}': "
        f"{why}",
        readings,
        used,
    )


def run_direction(run: Stance, trace: Trace) -> Verdict:
    """Judge the turn towards propulsion: in the second half of the running stance the mean force points
    forward, and farther forward than in the first half."""
    halves = half_impulses(trace, run)
    first, second = (float(np.degrees(np.arctan2(*half))) for half in halves)
    return Verdict(
        second > 0 and second > first,
        f"horizontal impulse on the leg {halves[0][0]:+.1f} N s in the first half of stance, "
        f"{halves[1][0]:+.1f} N s in the second; mean force {first:+.1f} and {second:+.1f} deg from vertical "
        "(forward positive)",
    )


def sole_velocity(trace: Trace) -> float:
    """Return the load-weighted median of the horizontal velocity of toe and heel [m/s], NaN without load.

    Half of the load acts below it. Under Coulomb friction and full sliding, the ground propels the leg if it
    is negative.
    """
    velocity = np.concatenate([trace[f"{name}_slide"] for name in POINTS])
    load = np.concatenate([trace[f"{name}_normal"] for name in POINTS])
    # Both points share the load, so that their samples are ranked together.
    order = np.argsort(velocity)
    below = np.cumsum(load[order])
    return float(velocity[order][np.searchsorted(below, below[-1] / 2)]) if below[-1] > 0 else float("nan")


def gait_walks(medians: Mapping[float, float]) -> Verdict:
    """Judge that a gait moves its animal: at the ground level and deeper, where a trunk with weight would
    settle, the sole moves backward by `BACKWARD` or more.

    Args:
        medians: `sole_velocity` [m/s] by depth [m].
    """
    values = ", ".join(
        f"{v:+.2f} m/s" + (f" {100 * depth:.0f} cm deeper" if depth else "") for depth, v in medians.items()
    )
    return Verdict(
        all(v <= -BACKWARD for v in medians.values()),
        f"load-weighted median velocity of the sole {values}; {-BACKWARD:+.1f} m/s or less is asked for",
    )


def judge(
    traces: Mapping[tuple[str, str], Trace], medians: Mapping[str, Mapping[float, float]], brakes: bool
) -> dict[str, Verdict]:
    """Judge every claim.

    Args:
        traces: cycles by (gait, condition).
        medians: `gait_walks`'s medians by gait.
        brakes: True if the leg `walk_brakes`.

    Returns:
        Verdicts by the id of the claim.
    """
    walk_trace = traces["walk", "elastic"]
    run_trace = traces["run", "elastic"]
    walk = measure_stance(walk_trace)
    run = measure_stance(run_trace)
    return {
        "walk.order": walk_order(walk, walk_trace),
        "walk.peaks": walk_peaks(walk, walk_trace),
        "run.order": run_order(run, walk, run_trace, walk_trace),
        "run.peaks": run_peaks(run_trace, traces["run", "inelastic"]),
        "run.step": run_step(run, walk, run_trace, walk_trace),
        "walk.direction": walk_direction(walk, walk_trace, brakes),
        "run.direction": run_direction(run, run_trace),
        "walk.walks": gait_walks(medians["walk"]),
        "run.walks": gait_walks(medians["run"]),
    }
