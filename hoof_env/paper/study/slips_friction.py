"""Slips of Eqs. 13 and 15 and of the resultant: direction and size of the friction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hoof_env.paper.measure import POINTS
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.study.slip import CHANGES, Slip, change, effect_of
from hoof_env.paper.study.slips_contact import NAMES, Trace, Traces, over_cycle


def friction_slips(traces: Traces) -> list[Slip]:
    """The slips of Eqs. 13 and 15 and of the resultant below them."""
    return [_tangent(traces), _friction_size(traces), _resultant(traces)]


def friction_power(trace: Trace) -> NDArray[np.float64]:
    """Power of the friction on the hoof [W]; negative where friction opposes sliding."""
    return np.asarray(sum(trace[f"{name}_friction"] * trace[f"{name}_vx"] for name in POINTS))


def literal_friction(trace: Trace) -> NDArray[np.float64]:
    """Eq. 15 with c_f = |v_T|, summed over both points, in N m/s; always of one sign."""
    return np.asarray(-sum(np.abs(trace[f"{name}_friction"] * trace[f"{name}_vx"]) for name in POINTS))


def _tangent(traces: Traces) -> Slip:
    parts, data = [], {}
    for gait in GAITS:
        trace = traces[gait, "elastic"]
        friction = over_cycle(trace, friction_power(trace))
        drives = over_cycle(trace, trace["crank_power"] + trace["hip_power"])
        literal = drives + 2 * friction  # the drives balance the ground's work over a cycle
        parts.append(
            f"{NAMES[gait]} {-friction:+.0f} J a cycle instead of {friction:+.0f} J, and the drives would "
            f"take {literal:+.0f} J instead of {drives:+.0f} J"
        )
        data[gait] = {"friction_J": friction, "drives_J": drives, "drives_literal_J": literal}
    return Slip(
        "eq13.tangent",
        "Eqs. 13, 15",
        "t is n turned counter-clockwise by 90°",
        "F_f along t, so with n up it is -F_f along x",
        "with n up t is -x: F_f added to the x row of h as it stands has the wrong sign",
        "friction then points with the sliding and does positive work on the leg: "
        + "; ".join(parts)
        + ". The size of the "
        "resultant stays, the direction of figure 6 turns over",
        CHANGES,
        data,
    )


def _friction_size(traces: Traces) -> Slip:
    parts, data, changes = [], {}, []
    for gait in GAITS:
        trace = traces[gait, "elastic"]
        literal = literal_friction(trace)
        sizes = float(np.abs(literal).max()), float(np.abs(trace["friction"]).max())
        resultants = float(np.hypot(trace["normal"], literal).max()), float(trace["grf"].max())
        wrong = over_cycle(trace, np.where(trace["friction"] > 0, trace["friction"], 0))
        wrong /= over_cycle(trace, np.abs(trace["friction"]))
        changes.append(change(*resultants))
        parts.append(
            f"{NAMES[gait]} up to {sizes[0]:.0f} N m/s instead of {sizes[1]:.0f} N; taken for "
            f"newtons, the resultant's peak is {resultants[0]:.0f} N instead of {resultants[1]:.0f}, and "
            f"{100 * wrong:.0f} % of the friction's impulse is turned round"
        )
        data[gait] = {"friction_N": sizes, "resultant_N": resultants, "impulse_turned": wrong}
    return Slip(
        "eq15.direction",
        "Eq. 15",
        "`c_f = |v_T|`",
        "`v_T / |v_T|`, a direction",
        "the text says 'opposite to direction of motion'; with a speed, F_f is in N m/s",
        "friction grows with the speed and never changes sign (backward, along x): " + "; ".join(parts),
        effect_of(*changes),
        data,
    )


def _resultant(traces: Traces) -> Slip:
    parts, data = [], {}
    for gait in GAITS:
        trace = traces[gait, "elastic"]
        literal = float(np.sqrt(trace["normal"] + np.abs(trace["friction"])).max())
        read = float(trace["grf"].max())
        parts.append(f"{NAMES[gait]} {literal:.1f} instead of {read:.0f} N")
        data[gait] = {"literal": literal, "read_N": read}
    return Slip(
        "grf.root",
        "below Eq. 15",
        "`GRF = √(F_n + F_f)`",
        "`√(F_n² + F_f²)`",
        "the root of a force is no force",
        f"elastic peaks, in √N: {'; '.join(parts)}",
        CHANGES,
        data,
    )
