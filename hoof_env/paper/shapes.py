"""The paper's claims about shape, each decided by numbers: pure functions of measured cycles.

`walk.direction` has two readings. Figure 6 shows a 'braking force' in walking, the ground reaction force
'directed to the against moving direction'. Literally (`BRAKING`) the ground pushes the leg back throughout
its stance. Under Coulomb friction that takes a hoof that slides forward under load, and such a walk cannot
move an animal forward: it contradicts `walk.walks`. The arrows may also be the force of the hoof on the
ground (`HOOF_ON_GROUND`): they point back while the ground pushes the leg forward. Both readings get a
verdict, and the claim is counted by the one that the net impulse of the walking stance leaves possible
(`walk_brakes`), the same for every solver. A walk that brakes in one half of stance and propels in the other
fulfils neither.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hoof_env.paper.measure import POINTS, Stance, Trace, integral, measure_stance

PROMINENCE = 0.1  # a force peak counts if it stands out by this part of the highest force [-]
PEAK_GAP = 0.01  # two peaks are apart in time if at least this far [s], ten time steps of the paper
FLAT_DEG = 3.0  # a hoof is flat within this angle [deg]: the bar of the published angle at mid-stance
DEPTHS = (0.0, 0.05, 0.1)  # how much deeper than the identified level a leg must walk and run, too [m]
BACKWARD = 0.3  # how fast the sole must go back there under load [m/s]
# readings of `walk.direction`
BRAKING = "braking"
HOOF_ON_GROUND = "hoof on ground"


@dataclass(frozen=True)
class Verdict:
    """Whether a claim holds, and the numbers that decide.

    Attributes:
        readings: where there are several, whether it holds under each; `used` is the one that `holds` is of.
    """

    holds: bool
    evidence: str
    readings: dict[str, bool] = field(default_factory=dict)
    used: str = ""


def find_peaks(force: NDArray[np.float64]) -> list[int]:
    """Indices of the local maxima of a force that rises from 0 and returns to it, if prominent enough.

    A maximum's prominence is its height above the higher of the two lowest points that separate it from
    higher ground (or from the ends) on either side; it must reach `PROMINENCE` of the highest force. A
    plateau counts once, at its first sample.
    """
    steps = np.diff(force)
    moving = np.flatnonzero(steps)
    turns = (steps[moving[:-1]] > 0) & (steps[moving[1:]] < 0)
    places = []
    for k in (moving[:-1][turns] + 1).tolist():
        higher = np.flatnonzero(force > force[k])
        left = higher[higher < k]
        right = higher[higher > k]
        base_left = force[left[-1] if left.size else 0 : k].min()
        base_right = force[k : right[0] + 1 if right.size else None].min()
        if force[k] - max(base_left, base_right) >= PROMINENCE * force.max():
            places.append(k)
    return places


def _first(stance: Stance) -> str:
    points = " and ".join(sorted(stance.first_points))
    return f"first in: {points} at {stance.start:.3f} s, {stance.angle_start_deg:.1f} deg"


def _last(stance: Stance) -> str:
    points = " and ".join(sorted(stance.last_points))
    return f"last out: {points} at {stance.end:.3f} s, {stance.angle_end_deg:.1f} deg"


def walk_order(walk: Stance, trace: Trace) -> Verdict:
    """Heel-strike, flat, toe-off: the heel touches first, then both bear with the sole flat within
    `FLAT_DEG` at some instant, and the toe leaves last."""
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
    """Two peaks of the normal force, one in each half of stance; toe and heel both bear at the dip."""
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
    """Toe-strike, roll-over, toe-off with a large gap: the toe touches first, the heel follows and leaves
    before the toe, and at toe-off it is higher above the ground than at toe-off in walking."""
    gaps = [
        float(-np.interp(s.end, tr["time"], tr["heel_penetration"]))
        for s, tr in ((run, run_trace), (walk, walk_trace))
    ]
    rolls = run.first_points == {"toe"} and bool(run.heel) and run.last_points == {"toe"}
    never = "never in the ground"
    heel = f"in the ground {run.heel[0][0]:.3f}-{run.heel[-1][1]:.3f} s" if run.heel else never
    return Verdict(
        rolls and gaps[0] > gaps[1],
        f"{_first(run)}; heel {heel}; {_last(run)}; "
        f"heel {100 * gaps[0]:.1f} cm above the ground then, walking {100 * gaps[1]:.1f} cm",
    )


def run_peaks(elastic: Trace, inelastic: Trace) -> Verdict:
    """One peak of the normal force in each condition, at least `PEAK_GAP` apart in time."""
    peaks = [find_peaks(trace["normal"]) for trace in (elastic, inelastic)]
    times = [float(trace["time"][np.argmax(trace["normal"])]) for trace in (elastic, inelastic)]
    gap = times[0] - times[1]
    return Verdict(
        all(len(found) == 1 for found in peaks) and abs(gap) >= PEAK_GAP,
        f"elastic {len(peaks[0])} peak(s), highest at {times[0]:.4f} s; inelastic {len(peaks[1])}, highest "
        f"at {times[1]:.4f} s; the elastic one is {1000 * gap:+.1f} ms later",
    )


def step_length(trace: Trace, stance: Stance) -> tuple[float, float]:
    """How far the middle of the sole travels back from first to last contact, and how far over the cycle [m].

    The second is the horizontal extent of its closed path. On a fixed trunk the
    first is how far a body would pass over the foot in one stance.
    """
    sole = (trace["toe_x"] + trace["heel_x"]) / 2 - trace["x"]
    start, end = np.interp([stance.start, stance.end], trace["time"], sole)
    return float(start - end), float(np.ptp(sole))


def run_step(run: Stance, walk: Stance, run_trace: Trace, walk_trace: Trace) -> Verdict:
    """The sole travels farther back in the running stance than in the walking one (`step_length`)."""
    (run_step, run_path) = step_length(run_trace, run)
    (walk_step, walk_path) = step_length(walk_trace, walk)
    return Verdict(
        run_step > walk_step,
        f"sole travels back {run_step:.3f} m in the running stance, {walk_step:.3f} m in the walking one; "
        f"horizontal extent of its path over the cycle {run_path:.3f} m and {walk_path:.3f} m",
    )


def half_impulses(trace: Trace, stance: Stance) -> list[tuple[float, float]]:
    """Horizontal (forward positive) and vertical impulse on the leg in each half of stance [N s]."""
    halves = ((stance.start, stance.middle), (stance.middle, stance.end))
    return [
        (integral(trace, trace["friction"], *half), integral(trace, trace["normal"], *half))
        for half in halves
    ]


def walk_brakes(walk: Stance, trace: Trace) -> bool:
    """Whether the ground pushes the leg back over the walking stance as a whole."""
    return sum(along for along, _ in half_impulses(trace, walk)) < 0


def walk_direction(walk: Stance, trace: Trace, brakes: bool) -> Verdict:
    """Braking through the walking stance: the force points back in both halves, under either reading; of a
    leg that `walk_brakes` `BRAKING` is used, else `HOOF_ON_GROUND`."""
    (first, _), (second, _) = half_impulses(trace, walk)
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
    """Turning towards propulsion: in the second half of stance the mean force is forward, and more so."""
    halves = half_impulses(trace, run)
    first, second = (float(np.degrees(np.arctan2(*half))) for half in halves)
    return Verdict(
        second > 0 and second > first,
        f"horizontal impulse on the leg {halves[0][0]:+.1f} N s in the first half of stance, "
        f"{halves[1][0]:+.1f} N s in the second; mean force {first:+.1f} and {second:+.1f} deg from vertical "
        "(forward positive)",
    )


def sole_velocity(trace: Trace) -> float:
    """Load-weighted median of the horizontal velocity of toe and heel [m/s]: half of the load acts below it.

    Under Coulomb friction and full sliding the ground propels where it is negative. NaN without load.
    """
    velocity = np.concatenate([trace[f"{name}_slide"] for name in POINTS])
    load = np.concatenate([trace[f"{name}_normal"] for name in POINTS])
    order = np.argsort(velocity)
    below = np.cumsum(load[order])
    return float(velocity[order][np.searchsorted(below, below[-1] / 2)]) if below[-1] > 0 else float("nan")


def gait_walks(medians: Mapping[float, float]) -> Verdict:
    """A gait must move its animal: `sole_velocity` [m/s], given by depth [m], is backward by `BACKWARD` or
    more, at the ground level and deeper, where a trunk with weight would settle."""
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
    """Every claim by id, from a cycle for each (gait, condition), `gait_walks`'s medians by gait, and whether
    the leg `walk_brakes`."""
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
