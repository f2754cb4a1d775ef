"""Substeps by two sets of names: `TrunkEngine`'s, which an environment's `record` has, and those of
`dynamics.trace.TRACE`, which identification and the paper's reproduction read.

Both are of one leg on a trunk that does not move over level ground at height 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.layout import LEG_REPORT, LEG_STATE, TRUNK_REPORT, TRUNK_STATE
from hoof_env.dynamics.trace import new_trace
from hoof_env.gait.parameters import PARAMETERS

Floats = NDArray[np.float64]
POINTS = ("toe", "heel")
_SAME = (
    "theta", "theta_rate", "theta_acc", "phi", "phi_rate", "phi_acc",
    "crank_torque", "hip_torque", "crank_power", "hip_power",
    *(f"{point}_{name}" for point in POINTS for name in ("penetration", "rate", "x", "normal", "friction")),
)  # fmt: skip
"""What both call the same."""


def record_of(trace: NDArray[np.void], filters: NDArray[np.void]) -> dict[str, Floats]:
    """State and report by name, as `TrunkEngine.run` gives them for one environment of one leg.

    Args:
        trace: rows of dtype `TRACE`, shape (n,).
        filters: of the commands at the last row, dtype `motion_law.FILTER`, shape (4,); they stand for all
            rows.
    """
    n = len(trace)
    of_trunk = dict.fromkeys((*TRUNK_STATE, *TRUNK_REPORT), np.zeros(n))
    of_trunk |= {"time": trace["t"], "x": trace["trunk_x"], "y": trace["trunk_y"]}
    of_trunk |= {"centre_x": trace["trunk_x"], "centre_y": trace["trunk_y"]}
    of_leg = {name: trace[name] for name in _SAME}
    for k, name in enumerate(PARAMETERS):
        of_leg |= {name: np.full(n, filters["value"][k]), f"{name}_rate": np.full(n, filters["rate"][k])}
    for point in POINTS:
        approach, inside = trace[f"{point}_approach"], trace[f"{point}_penetration"] > 0
        of_leg[f"{point}_slowness"] = np.where(inside, 1 / np.where(approach > 0, approach, np.inf), 0.0)
        of_leg[f"{point}_y"], of_leg[f"{point}_slide"] = -trace[f"{point}_penetration"], trace[f"{point}_vx"]
    names = (*LEG_STATE, *LEG_REPORT)
    return {name: np.array(values)[:, None] for name, values in of_trunk.items()} | {
        name: np.array(of_leg[name])[:, None, None] for name in names
    }


def trace_of(record: Mapping[str, Any]) -> NDArray[np.void]:
    """Rows of dtype `TRACE`, shape (n,), from what an environment's `record` gives."""
    r = {name: np.asarray(values).reshape(len(values)) for name, values in record.items()}
    trace = new_trace(len(r["time"]))
    for name in _SAME:
        trace[name] = r[name]
    trace["t"] = r["time"]
    for name in ("x", "y", "vx", "vy"):
        trace[f"trunk_{name}"] = r[name]
    for point in POINTS:
        slowness = r[f"{point}_slowness"]
        trace[f"{point}_vx"] = r[f"{point}_slide"]
        trace[f"{point}_approach"] = np.where(slowness > 0, 1 / np.where(slowness > 0, slowness, 1.0), 0.0)
    trace["hoof_angle"] = np.arctan2(r["heel_y"] - r["toe_y"], r["toe_x"] - r["heel_x"])
    for name in ("normal", "friction"):
        trace[name] = r[f"toe_{name}"] + r[f"heel_{name}"]
    trace["grf"] = np.hypot(trace["normal"], trace["friction"])
    loaded = trace["normal"] > 0
    moment = r["toe_normal"] * r["toe_x"] + r["heel_normal"] * r["heel_x"]
    trace["cop_x"] = np.where(loaded, moment / np.where(loaded, trace["normal"], 1.0), np.nan)
    return trace
