"""Claims about how the hoof moves: order of contacts, support, turning, step, rolling."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from hoof_env.paper.measure import POINTS
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.shapes import FLAT_DEG, sole_velocity
from hoof_env.paper.study.case import NAMES, Case, Trace, by_solver
from hoof_env.paper.study.claim import PUBLISHED, Examined, Finding

APPROXIMATELY = 0.1
"""'Approximately 2.5 times' holds within this part of 2.5 [-]."""

ONE_WAY = 1.05
"""A turn goes one way if its angle spans no more than this many times its net change [-]."""

SLIDING = 0.05
"""A loaded point that moves slower than this over the ground rolls, faster it slides [m/s]."""


def motion_claims(case: Case) -> Iterable[Examined]:
    """The claims about motion, in the order of the text."""
    return (
        _duty(case),
        _step(case),
        _walk_phases(case),
        _run_phases(case),
        _quick(case),
        _support(case),
        _variation(case),
        _first_point(case),
        _rolling(case),
    )


def _duty(case: Case) -> Examined:
    duty = {gait: case.published.row(f"{gait}.duty").value for gait in GAITS}

    def longer(solver: str) -> tuple[bool, str]:
        ours = [case.stance(gait, solver).duty for gait in GAITS]
        return ours[0] > ours[1], f"duty factor {ours[0]:.3f} in walking, {ours[1]:.3f} in running"

    printed = f"the printed contact times give {duty['walk']:.3f} in walking and {duty['run']:.3f} in running"
    half = "each foot is on the ground for at least half of the cycle, so that a biped is never in flight"
    return Examined(
        "walk.duty",
        "considered to be a walking in term of duty factor",
        "section 3",
        "figure4",
        (
            Finding(half, PUBLISHED, duty["walk"] >= 0.5, printed),
            *by_solver("longer on the ground than in running", longer, case.asked("walk.duty", "run.duty")),
        ),
        "By duty factor both gaits are runs." if max(duty.values()) < 0.5 else "",
        {"duty": duty},
    )


def _step(case: Case) -> Examined:
    return Examined(
        "run.step",
        "longer step length compared to the 1st trajectory",
        "section 3",
        "figure3",
        case.judged("run.step", "travel of the sole in stance"),
    )


def _walk_phases(case: Case) -> Examined:
    def one_way(solver: str) -> tuple[bool, str]:
        trace, stance = case.trace("walk", solver), case.stance("walk", solver)
        angle = np.degrees(trace["hoof_angle"][(trace["t"] >= stance.start) & (trace["t"] <= stance.end)])
        net = stance.angle_end_deg - stance.angle_start_deg
        return bool(np.ptp(angle) <= ONE_WAY * abs(net)), (
            f"from {stance.angle_start_deg:.1f} to {stance.angle_end_deg:.1f} deg by way of "
            f"{angle.min():.1f} and {angle.max():.1f} deg"
        )

    return Examined(
        "walk.order",
        "sub-phases from heel-strike, flat and toe-off were gradually generated",
        "section 3",
        "figure4",
        (
            *case.judged("walk.order", "which point touches first and leaves last, and a flat sole between"),
            *by_solver("gradually: the hoof turns one way from contact to lift-off", one_way),
        ),
    )


def _run_phases(case: Case) -> Examined:
    return Examined(
        "run.order",
        "from the toe-strike that causes the roll-over ... to the toe-off sub-phase with a large gap from "
        "the ground",
        "section 3",
        "figure4",
        case.judged("run.order", "which point touches first and leaves last; height of the heel at toe-off"),
    )


def _rates(case: Case, solver: str) -> dict[str, tuple[float, float]]:
    """By gait, mean and largest rate of the hoof angle in stance [deg/s]."""
    result = {}
    for gait in GAITS:
        trace, stance = case.trace(gait, solver), case.stance(gait, solver)
        inside = (trace["t"] >= stance.start) & (trace["t"] <= stance.end)
        rate = np.degrees(np.gradient(np.unwrap(trace["hoof_angle"]), trace["t"]))[inside]
        mean = stance.angle_variation_deg / (stance.end - stance.start)
        result[gait] = float(mean), float(np.abs(rate).max())
    return result


def _quick(case: Case) -> Examined:
    def faster(solver: str) -> tuple[bool, str]:
        walk, run = _rates(case, solver).values()
        return (
            run[0] > walk[0] and run[1] > walk[1],
            f"mean rate in stance {walk[0]:.0f} deg/s in walking and {run[0]:.0f} in running, largest "
            f"{walk[1]:.0f} and {run[1]:.0f}",
        )

    def from_zero(solver: str) -> tuple[bool | None, str]:
        median, turn = sole_velocity(case.trace("run", solver)), _turning_part(case, solver)
        return (
            abs(turn) > abs(median) / 2,
            f"the loaded points slide at {median:+.2f} m/s (median), of which the turning of the hoof about "
            f"the middle of its sole makes {turn:+.2f} m/s",
        )

    return Examined(
        "hoof.rate",
        "roll-over ... quickly; propulsive ... force due the intrinsic high rate of angular oscillation at "
        "the hoof",
        "section 3",
        "figure4",
        (
            *by_solver("the hoof turns faster in running", faster, case.asked("run.angle_variation")),
            *by_solver("turning is what makes the sole slide back and so propels", from_zero),
        ),
    )


def _turning_part(case: Case, solver: str) -> float:
    """Load-weighted mean of the velocity of each point relative to the middle of the sole, running [m/s]."""
    trace = case.trace("run", solver)
    middle = sum(trace[f"{name}_vx"] for name in POINTS) / len(POINTS)
    load = sum(float(trace[f"{name}_normal"].sum()) for name in POINTS)
    moved = sum(float((trace[f"{name}_normal"] * (trace[f"{name}_vx"] - middle)).sum()) for name in POINTS)
    return moved / load


def _support(case: Case) -> Examined:
    def middle(solver: str) -> tuple[bool, str]:
        stance = case.stance("walk", solver)
        if stance.double is None:
            return False, "toe and heel never bear together"
        part = [100 * (t - stance.start) / (stance.end - stance.start) for t in stance.double]
        return (
            part[0] <= 50 <= part[1],
            f"toe and heel both bear from {part[0]:.0f} to {part[1]:.0f} % of stance",
        )

    def flat(solver: str) -> tuple[bool, str]:
        stance, trace = case.stance("walk", solver), case.trace("walk", solver)
        angle = float(np.degrees(np.interp(stance.middle, trace["t"], trace["hoof_angle"])))
        at = "none" if stance.angle_flat_deg is None else f"{stance.angle_flat_deg:+.1f} deg"
        return (
            abs(angle) <= FLAT_DEG,
            f"hoof angle {angle:+.1f} deg at the middle of stance, {at} in the middle of double support",
        )

    return Examined(
        "walk.support",
        "during the mid-stance multiple contact points were examined ... hoof was almost parallel with the "
        "ground",
        "section 3",
        "claims_peaks",
        (
            *by_solver("both points bear at the middle of stance", middle, case.asked("walk.peaks")),
            *by_solver(
                f"the sole is flat within {FLAT_DEG:g} deg at the middle of stance",
                flat,
                case.asked("walk.angle_flat"),
            ),
        ),
    )


def _variation(case: Case) -> Examined:
    claimed = case.published.row("ratio.angle_variation").value
    run = case.published.row("run.angle_variation").value
    angles = {
        name: case.published.row(f"walk.angle_{name}").value for name in ("contact", "liftoff", "variation")
    }
    from_angles = run / (angles["liftoff"] - angles["contact"])

    def close(ratio: float) -> bool:
        return abs(ratio / claimed - 1) <= APPROXIMATELY

    def net(solver: str) -> tuple[bool, str]:
        row = case.row("ratio.angle_variation", solver)
        return close(row["simulated"]), f"ratio {row['simulated']:.2f}"

    def ranges(solver: str) -> tuple[bool, str]:
        ratio = case.row("ratio.angle_variation", solver)["beside"]["ratio_of_ranges"]
        return close(ratio), f"ratio {ratio:.2f}"

    return Examined(
        "ratio.angle_variation",
        "64.8°, which is approximately 2.5 times larger than the result in the walking gait",
        "section 3",
        "figure4",
        (
            Finding(
                "printed variations",
                PUBLISHED,
                close(run / angles["variation"]),
                f"ratio {run / angles['variation']:.2f}",
            ),
            Finding(
                "printed angles, lift-off heel up", PUBLISHED, close(from_angles), f"ratio {from_angles:.2f}"
            ),
            *by_solver(
                "lift-off minus contact", net, case.asked("walk.angle_liftoff", "run.angle_variation")
            ),
            *by_solver("largest minus smallest angle in stance", ranges),
        ),
        f"'Approximately' is taken as within {100 * APPROXIMATELY:.0f} %.",
    )


def _first_point(case: Case) -> Examined:
    def differ(solver: str) -> tuple[bool, str]:
        first = [case.stance(gait, solver).first_points for gait in GAITS]
        words = [" and ".join(sorted(points)) for points in first]
        return not first[0] & first[1], f"{words[0]} first in walking, {words[1]} first in running"

    return Examined(
        "first.point",
        "the initial impact phenomenon, which differentiate the grounding part either heel or toe",
        "section 3",
        "figure4",
        by_solver(
            "the point that touches first differs between the gaits",
            differ,
            case.asked("walk.order", "run.order"),
        ),
    )


def slip_speed(trace: Trace) -> tuple[float, float]:
    """Speed of a trunk under which the loaded points would slide least, and what they slide then [m/s].

    Both in the load-weighted mean of the absolute speed; the trunk moves steadily forward.
    """
    speed = -sole_velocity(trace)
    load = np.concatenate([trace[f"{name}_normal"] for name in POINTS])
    velocity = np.concatenate([trace[f"{name}_vx"] for name in POINTS])
    return speed, float(np.sum(load * np.abs(velocity + speed)) / load.sum())


def _rolling(case: Case) -> Examined:
    def rolls(at_speed: bool) -> Callable[[str], tuple[bool, str]]:
        def decide(solver: str) -> tuple[bool, str]:
            parts, slides = [], []
            for gait in GAITS:
                trace = case.trace(gait, solver)
                speed, left = slip_speed(trace)
                load = np.concatenate([trace[f"{name}_normal"] for name in POINTS])
                fixed = float(
                    np.sum(load * np.abs(np.concatenate([trace[f"{n}_vx"] for n in POINTS]))) / load.sum()
                )
                slides.append(left if at_speed else fixed)
                parts.append(
                    f"{NAMES[gait]} {slides[-1]:.2f} m/s"
                    + (f" under a trunk at {speed:+.2f} m/s" if at_speed else "")
                )
            return max(slides) <= SLIDING, f"loaded points slide at {', '.join(parts)} (load-weighted mean)"

        return decide

    return Examined(
        "hoof.rolling",
        "the hoof rolling over the ground; wheel-like rolling motion of the hoof",
        "sections 3, 4",
        "figure3",
        (
            *by_solver(
                "rolls without sliding under the paper's fixed trunk", rolls(False), case.asked("walk.walks")
            ),
            *by_solver("would roll without sliding under a trunk at the best steady speed", rolls(True)),
        ),
        f"Rolling means that loaded points stay below {SLIDING:g} m/s.",
    )
