"""Figures of a cycle that the paper does not print, or that differ from its text: how deep the hoof goes, how
fast it slides, where the force peaks and turns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.paper.measure import POINTS, Stance, Trace, integral, measure_stance
from hoof_env.paper.rows import EXACT
from hoof_env.paper.shapes import find_peaks, sole_velocity

UNITS = {
    "depth": ("cm", "largest penetration of toe or heel"),
    "sole_speed": ("m/s", "backward speed of toe and heel, load-weighted median"),
    "first_peak": ("% of stance", "place of the first peak of the normal force"),
    "last_peak": ("% of stance", "place of the last one"),
    "least_angle": ("deg", "smallest hoof angle in stance"),
    "most_angle": ("deg", "largest hoof angle in stance"),
    "middle_angle": ("deg", "hoof angle at the middle of stance"),
    "middle_force": ("N", "normal force at the middle of stance"),
    "backward": ("N s", "impulse of the friction that pushes the leg back"),
    "forward": ("N s", "impulse of the friction that pushes it forward"),
    "turn": ("% of stance", "place where the friction last turns from backward to forward"),
    "direction": ("deg", "largest angle of the force from the vertical"),
    "full_slip": ("%", "part of the loaded time in which the force has this angle"),
    "printed_grf": ("N^(1/2)", "highest value of sqrt(Fn + Ff), the resultant as printed"),
    "peak_delay": ("ms", "time of the elastic peak after the inelastic one"),
}
"""Unit and meaning of each figure; elastic ground except for the last one."""


def details(traces: Mapping[tuple[str, str], Trace]) -> list[dict[str, Any]]:
    """Measure the cycles of the exact solver.

    Args:
        traces: cycles by (gait, condition).

    Returns:
        A dictionary for each gait and each of `UNITS`, with "value" in its "unit".
    """
    entries = []
    for gait in dict.fromkeys(gait for gait, _ in traces):
        elastic = traces[gait, "elastic"]
        stance = measure_stance(elastic)
        values = _values(elastic, stance)
        values["peak_delay"] = 1e3 * (stance.peak_time - measure_stance(traces[gait, "inelastic"]).peak_time)
        for name, (unit, meaning) in UNITS.items():
            entries.append(
                {
                    "kind": "detail",
                    "id": f"{gait}.{name}",
                    "solver": EXACT,
                    "quantity": meaning,
                    "unit": unit,
                    "value": values[name],
                }
            )
    return entries


def _values(trace: Trace, stance: Stance) -> dict[str, float]:
    """Return the figures of one cycle by their name."""
    t = trace["time"]
    normal = trace["normal"]
    friction = trace["friction"]
    angle = np.degrees(trace["hoof_angle"])

    def place(time: float) -> float:
        return float(100 * (time - stance.start) / (stance.end - stance.start))

    peaks = find_peaks(normal)
    ends = np.interp([stance.start, stance.end], t, angle)
    turning = np.concatenate((ends, angle[(t > stance.start) & (t < stance.end)]))
    loaded = normal > 0
    tilt = np.degrees(np.arctan2(np.abs(friction[loaded]), normal[loaded]))
    back = np.flatnonzero(friction < 0)
    return {
        "depth": 100 * max(float(trace[f"{name}_penetration"].max()) for name in POINTS),
        "sole_speed": -sole_velocity(trace),
        "first_peak": place(t[peaks[0]]),
        "last_peak": place(t[peaks[-1]]),
        "least_angle": float(turning.min()),
        "most_angle": float(turning.max()),
        "middle_angle": float(np.interp(stance.middle, t, angle)),
        "middle_force": float(np.interp(stance.middle, t, normal)),
        "backward": -integral(trace, np.minimum(friction, 0), t[0], t[-1]),
        "forward": integral(trace, np.maximum(friction, 0), t[0], t[-1]),
        "turn": place(t[back[-1]]) if back.size else 0.0,
        "direction": float(tilt.max()),
        "full_slip": float(100 * np.mean(tilt > 0.999 * tilt.max())),
        "printed_grf": float(np.sqrt((normal + np.abs(friction)).max())),
    }
