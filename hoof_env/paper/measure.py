"""From the record of one cycle to what the paper reports about it.

A hoof point is in contact between the instants at which its penetration crosses zero, interpolated linearly
between samples. First contact is the earliest of these instants over toe and heel, last contact the latest;
hoof angles there are interpolated too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.constrained import TRACE
from hoof_env.errors import ParameterError

Interval = tuple[float, float]

POINTS = ("toe", "heel")

SUMS = ("normal", "friction", "grf", "cop_x", "hoof_angle")
"""Normal and friction force on both points and their resultant [N], centre of pressure [m] (NaN without
load), and the hoof's angle, heel up positive [rad]."""

CYCLE = np.dtype([(name, "f8") for name in (*(TRACE.names or ()), *SUMS)])
"""A cycle: a row for every substep, what the engine reports of one leg and the sums over its hoof points."""

Trace = NDArray[np.void]  # one cycle of dtype `CYCLE`


def cycle_of(record: Mapping[str, Any]) -> Trace:
    """Rows of dtype `CYCLE`, shape (n,), from the `record` of an environment with a fixed, level leg."""
    cycle = np.zeros(len(record["time"]), CYCLE)
    for name in TRACE.names or ():
        cycle[name] = np.asarray(record[name]).reshape(len(cycle))
    for name in ("normal", "friction"):
        cycle[name] = cycle[f"toe_{name}"] + cycle[f"heel_{name}"]
    cycle["grf"] = np.hypot(cycle["normal"], cycle["friction"])
    loaded = cycle["normal"] > 0
    moment = cycle["toe_normal"] * cycle["toe_x"] + cycle["heel_normal"] * cycle["heel_x"]
    cycle["cop_x"] = np.where(loaded, moment / np.where(loaded, cycle["normal"], 1.0), np.nan)
    cycle["hoof_angle"] = np.arctan2(cycle["heel_y"] - cycle["toe_y"], cycle["toe_x"] - cycle["heel_x"])
    return cycle


@dataclass(frozen=True)
class Stance:
    """The stance of one cycle and its forces.

    Attributes:
        period: length of the cycle [s].
        start, end: first and last contact [s].
        toe, heel: intervals in which each point is in the ground [s].
        double: the longest interval in which both are [s], or None.
        angle_start_deg, angle_end_deg: hoof angle at first and last contact, heel up positive [deg].
        angle_flat_deg: at the middle of `double` [deg], or None.
        angle_range_deg: largest minus smallest hoof angle in contact [deg].
        peak, peak_time: maximum over the cycle of the normal force summed over both points [N], and when [s].
        peak_resultant: the same maximum of the resultant sqrt(Fn^2 + Ft^2) [N].
        mean: time average of the normal force over the whole cycle [N].
        mean_stance: over stance alone [N].
    """

    period: float
    start: float
    end: float
    toe: tuple[Interval, ...]
    heel: tuple[Interval, ...]
    double: Interval | None
    angle_start_deg: float
    angle_end_deg: float
    angle_flat_deg: float | None
    angle_range_deg: float
    peak: float
    peak_time: float
    peak_resultant: float
    mean: float
    mean_stance: float

    @property
    def middle(self) -> float:
        """Middle of stance [s]."""
        return (self.start + self.end) / 2

    @property
    def duty(self) -> float:
        """Duty factor, the part of the cycle between first and last contact [-]."""
        return (self.end - self.start) / self.period

    @property
    def angle_variation_deg(self) -> float:
        """Net change of the hoof angle from first to last contact [deg]."""
        return self.angle_end_deg - self.angle_start_deg

    @property
    def first_points(self) -> set[str]:
        """The hoof points (toe, heel or both) that touch first."""
        return {name for name in POINTS if any(enter == self.start for enter, _ in getattr(self, name))}

    @property
    def last_points(self) -> set[str]:
        """The hoof points that leave last."""
        return {name for name in POINTS if any(leave == self.end for _, leave in getattr(self, name))}


def contact_intervals(t: NDArray[np.float64], penetration: NDArray[np.float64]) -> tuple[Interval, ...]:
    """Intervals [s] in which a penetration [m], sampled at `t`, is positive, its zeros interpolated linearly;
    `ParameterError` for a contact that the cycle cuts in two."""
    inside = penetration > 0
    if inside[0] or inside[-1]:
        raise ParameterError(
            "trace: expected a cycle that starts and ends with the hoof in the air, got one in stance"
        )
    before = np.flatnonzero(np.diff(inside))
    part = penetration[before] / (penetration[before] - penetration[before + 1])
    zeros = (t[before] + part * (t[before + 1] - t[before])).tolist()
    return tuple(zip(zeros[::2], zeros[1::2], strict=True))


def overlap(one: tuple[Interval, ...], two: tuple[Interval, ...]) -> Interval | None:
    """The longest interval common to an interval of `one` and an interval of `two`, or None."""
    common = [(max(a[0], b[0]), min(a[1], b[1])) for a in one for b in two]
    longest = max(common, key=lambda interval: interval[1] - interval[0], default=(0.0, 0.0))
    return longest if longest[1] > longest[0] else None


def integral(trace: Trace, values: NDArray[np.float64], start: float, end: float) -> float:
    """Integral over [start, end] [s] of `values` sampled with the trace, linear between samples."""
    t = trace["time"]
    inner = (t > start) & (t < end)
    times = np.concatenate(([start], t[inner], [end]))
    sampled = np.interp(times, t, values)
    return float(np.sum(np.diff(times) * ((sampled[1:] + sampled[:-1]) / 2)))


def measure_stance(trace: Trace) -> Stance:
    """Measure one cycle of dtype `CYCLE`, both ends included; `ParameterError` without a whole contact."""
    t = trace["time"]
    toe, heel = (contact_intervals(t, trace[f"{name}_penetration"]) for name in POINTS)
    if not toe + heel:
        raise ParameterError("trace: expected a cycle with ground contact, got none")
    start = min(enter for enter, _ in toe + heel)
    end = max(leave for _, leave in toe + heel)
    double = overlap(toe, heel)
    angle = np.degrees(trace["hoof_angle"])
    touching = np.concatenate((np.interp([start, end], t, angle), angle[(t > start) & (t < end)]))
    impulse = integral(trace, trace["normal"], float(t[0]), float(t[-1]))
    period = float(t[-1] - t[0])
    top = int(np.argmax(trace["normal"]))
    return Stance(
        period=period,
        start=start,
        end=end,
        toe=toe,
        heel=heel,
        double=double,
        angle_start_deg=float(touching[0]),
        angle_end_deg=float(touching[1]),
        angle_flat_deg=float(np.interp(sum(double) / 2, t, angle)) if double else None,
        angle_range_deg=float(np.ptp(touching)),
        peak=float(trace["normal"][top]),
        peak_time=float(t[top]),
        peak_resultant=float(trace["grf"].max()),
        mean=impulse / period,
        mean_stance=impulse / (end - start),
    )


def hoof_error(trace: Trace, exact: Trace) -> NDArray[np.float64]:
    """How far toe or heel, whichever is further, is from where another cycle of the motion has it [m].

    Shape of `trace`, at whose instants the other cycle is interpolated.
    """
    t = trace["time"]
    distances = []
    for name in POINTS:
        columns = f"{name}_x", f"{name}_penetration"
        distances.append(np.hypot(*(trace[c] - np.interp(t, exact["time"], exact[c]) for c in columns)))
    return np.maximum(*distances)
