"""Measures of one cycle that the paper reports, from its record.

A hoof point is in contact between the instants at which its penetration crosses zero, interpolated linearly
between samples. First contact is the earliest of these instants over toe and heel, last contact the latest;
hoof angles there are interpolated, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError
from hoof_env.paper_solver.solver import TRACE

Interval = tuple[float, float]
"""Start and end [s]."""

POINTS = ("toe", "heel")
"""Points of the hoof that touch the ground."""

SUMS = ("normal", "friction", "grf", "cop_x", "hoof_angle")
"""Sums over both points: normal and friction force and their resultant [N], centre of pressure [m] (NaN
without load), and the hoof's angle, heel up positive [rad]."""

CYCLE = np.dtype([(name, "f8") for name in (*(TRACE.names or ()), *SUMS)])
"""Type of a cycle's rows, one for every substep: the engine's reports on one leg, and `SUMS`."""

Trace = NDArray[np.void]
"""One cycle, rows of dtype `CYCLE`, shape (n,)."""


def cycle_of(record: Mapping[str, Any]) -> Trace:
    """Convert the `record` of an environment with a fixed trunk and level ground to rows of dtype `CYCLE`,
    shape (n,)."""
    cycle = np.zeros(len(record["time"]), CYCLE)
    for name in TRACE.names or ():
        cycle[name] = np.asarray(record[name]).reshape(len(cycle))
    for name in ("normal", "friction"):
        cycle[name] = cycle[f"toe_{name}"] + cycle[f"heel_{name}"]
    cycle["grf"] = np.hypot(cycle["normal"], cycle["friction"])
    # Without load the centre of pressure does not exist; the inner `where` avoids a division by 0.
    loaded = cycle["normal"] > 0
    moment = cycle["toe_normal"] * cycle["toe_x"] + cycle["heel_normal"] * cycle["heel_x"]
    cycle["cop_x"] = np.where(loaded, moment / np.where(loaded, cycle["normal"], 1.0), np.nan)
    cycle["hoof_angle"] = np.arctan2(cycle["heel_y"] - cycle["toe_y"], cycle["toe_x"] - cycle["heel_x"])
    return cycle


@dataclass(frozen=True)
class Stance:
    """Stance of one cycle and its forces.

    Attributes:
        period: length of the cycle [s].
        start, end: first and last contact [s].
        toe, heel: intervals in which each point is in the ground [s].
        double: longest interval in which both points are in the ground [s], or None.
        angle_start_deg, angle_end_deg: hoof angle at first and last contact, heel up positive [deg].
        angle_flat_deg: hoof angle at the middle of `double` [deg], or None.
        angle_range_deg: largest minus smallest hoof angle in contact [deg].
        peak, peak_time: maximum over the cycle of the normal force summed over both points [N], and its time
            [s].
        peak_resultant: maximum over the cycle of the resultant sqrt(Fn^2 + Ft^2) [N].
        mean: time average of the normal force over the whole cycle [N].
        mean_stance: time average of the normal force over the stance alone [N].
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
        """Hoof points (toe, heel or both) that touch first."""
        return {name for name in POINTS if any(enter == self.start for enter, _ in getattr(self, name))}

    @property
    def last_points(self) -> set[str]:
        """Hoof points (toe, heel or both) that leave last."""
        return {name for name in POINTS if any(leave == self.end for _, leave in getattr(self, name))}


def contact_intervals(t: NDArray[np.float64], penetration: NDArray[np.float64]) -> tuple[Interval, ...]:
    """Find the intervals in which a point is in the ground.

    Args:
        t: times, shape (n,) [s].
        penetration: penetration of the point, shape (n,) [m]; its zeros are interpolated linearly.

    Returns:
        Intervals [s], in order.

    Raises:
        ParameterError: the cycle starts or ends in contact, and so cuts a contact in two.
    """
    inside = penetration > 0
    if inside[0] or inside[-1]:
        raise ParameterError(
            "trace: expected a cycle that starts and ends with the hoof in the air, got one in stance"
        )
    before = np.flatnonzero(np.diff(inside))
    part = penetration[before] / (penetration[before] - penetration[before + 1])
    # Entries and exits alternate, as the cycle starts and ends in the air.
    zeros = (t[before] + part * (t[before + 1] - t[before])).tolist()
    return tuple(zip(zeros[::2], zeros[1::2], strict=True))


def overlap(one: tuple[Interval, ...], two: tuple[Interval, ...]) -> Interval | None:
    """Return the longest interval [s] common to an interval of `one` and an interval of `two`, or None."""
    common = [(max(a[0], b[0]), min(a[1], b[1])) for a in one for b in two]
    longest = max(common, key=lambda interval: interval[1] - interval[0], default=(0.0, 0.0))
    return longest if longest[1] > longest[0] else None


def integral(trace: Trace, values: NDArray[np.float64], start: float, end: float) -> float:
    """Integrate values over time, linear between samples.

    Args:
        trace: the cycle, for its times [s].
        values: values at these times, shape (n,).
        start, end: limits of the integral [s]; they may lie between samples.
    """
    t = trace["time"]
    # The limits are added as samples, so that the trapezoids end there.
    inner = (t > start) & (t < end)
    times = np.concatenate(([start], t[inner], [end]))
    sampled = np.interp(times, t, values)
    return float(np.sum(np.diff(times) * ((sampled[1:] + sampled[:-1]) / 2)))


def measure_stance(trace: Trace) -> Stance:
    """Measure one cycle.

    Args:
        trace: rows of dtype `CYCLE`, both ends of the cycle included.

    Raises:
        ParameterError: the cycle has no contact, or cuts one in two.
    """
    t = trace["time"]
    toe, heel = (contact_intervals(t, trace[f"{name}_penetration"]) for name in POINTS)
    if not toe + heel:
        raise ParameterError("trace: expected a cycle with ground contact, got none")
    start = min(enter for enter, _ in toe + heel)
    end = max(leave for _, leave in toe + heel)
    double = overlap(toe, heel)
    angle = np.degrees(trace["hoof_angle"])
    # The extremes of the angle may be at the instants of contact, which lie between samples.
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
    """Return the distance of toe or heel, whichever is larger, from its place in another cycle of the motion.

    Args:
        trace: the cycle.
        exact: the other cycle, which is interpolated at the instants of `trace`.

    Returns:
        Distances, shape (n,) [m].
    """
    t = trace["time"]
    distances = []
    for name in POINTS:
        across = trace[f"{name}_x"] - np.interp(t, exact["time"], exact[f"{name}_x"])
        deep = f"{name}_penetration"
        distances.append(np.hypot(across, trace[deep] - np.interp(t, exact["time"], exact[deep])))
    return np.maximum(*distances)
