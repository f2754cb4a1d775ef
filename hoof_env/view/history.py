"""History of a page: curves, rows of the scene and numbers of stances of the last half minute."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.observables import StanceCounter
from hoof_env.record.columns import Columns
from hoof_env.view.simulation import Chunk

KEPT_SECONDS = 30.0
"""Time back to which a page can go [s]."""

RESOLUTION = 0.002
"""Interval of which a curve shows one substep, the one with the largest force on a hoof [s]."""

STANCE = {"peak": "N", "mean": "N", "impulse": "N s", "duty": "-", "loading rate": "kN/s"}
"""Unit of each number of the running stance: largest ground reaction force, mean normal force, its integral,
part of the last stride in which the hoof stood, steepest rise of the normal force before the peak."""


PATHS = ("toe", "heel")
"""Points of a single leg that leave paths; a horse leaves the path of each toe."""


def paths_of(legs: Sequence[str], has_heel: bool) -> tuple[str, ...]:
    """Return the names of the points that leave paths, each with a column for x and one for y.

    Args:
        legs: prefixes of the legs.
        has_heel: False for legs with one foot.
    """
    if len(legs) > 1:
        return tuple(f"{leg}toe" for leg in legs)
    return PATHS if has_heel else PATHS[:1]


def path_columns(legs: Sequence[str], has_heel: bool) -> tuple[str, ...]:
    """Return the columns of `paths_of` the same legs."""
    return tuple(f"{point}_{axis}" for point in paths_of(legs, has_heel) for axis in "xy")


def curves_of(
    chunk: Chunk, legs: Sequence[str], lift_off: float, begin: float = 0.0, has_heel: bool = True
) -> Columns:
    """Return the curves of a chunk, sums and angles of its columns; shape (n,).

    Args:
        chunk: the chunk.
        legs: prefixes of the legs.
        lift_off: normal force that tells stance from swing [N].
        begin: time of the page at which the episode began [s].
        has_heel: False for legs with one foot, which have neither a path of the heel nor an angle of a hoof.
    """
    columns = chunk.columns
    curves: Columns = {"time": begin + columns["time"]}
    for k, leg in enumerate(legs):
        normal = columns[f"{leg}toe_normal"] + columns[f"{leg}heel_normal"]
        curves |= {
            f"{leg}normal": normal,
            f"{leg}friction": columns[f"{leg}toe_friction"] + columns[f"{leg}heel_friction"],
            f"{leg}grf": np.hypot(columns[f"{leg}force_x"], columns[f"{leg}force_y"]),
            f"{leg}crank_speed": columns[f"{leg}crank_angle_rate"],
            f"{leg}torque": chunk.drives[f"{leg}crank_torque"],
            f"{leg}power": chunk.drives[f"{leg}crank_power"],
            f"{leg}stance": np.where(normal > lift_off, float(len(legs) - k), np.nan),
        }
        if has_heel:
            rise = columns[f"{leg}heel_y"] - columns[f"{leg}toe_y"]
            run = columns[f"{leg}toe_x"] - columns[f"{leg}heel_x"]
            curves[f"{leg}hoof_angle"] = np.degrees(np.arctan2(rise, run))
    curves |= {name: columns[name] for name in path_columns(legs, has_heel)}
    return curves | chunk.normals


def thinned(curves: Columns, legs: Sequence[str], resolution: float = RESOLUTION) -> NDArray[np.int64]:
    """Return the rows that are drawn: of each `resolution` [s] the one with the largest force on a hoof."""
    force = np.max([curves[f"{leg}normal"] for leg in legs], axis=0)
    slots = np.floor(curves["time"] / resolution + 1e-6).astype(int)
    order = np.lexsort((-force, slots))
    first = np.flatnonzero(np.diff(slots[order], prepend=slots[order][0] - 1))
    return np.sort(order[first])


class StanceNumbers:
    """Numbers of the running stance of a leg, or of the last one while the hoof is in the air.

    Args:
        lift_off: normal force that tells stance from swing [N].
    """

    def __init__(self, lift_off: float) -> None:
        self._counter = StanceCounter(lift_off)
        self._time = math.nan
        self._began = math.nan
        self._stood = math.nan
        self.numbers = dict.fromkeys(STANCE, math.nan)

    def add(self, time: Any, crank: Any, normal: Any, grf: Any) -> None:
        """Take substeps: their times [s], crank angles [rad], normal and ground reaction forces [N]."""
        counter = self._counter
        numbers = self.numbers
        for t, theta, load, force in zip(time, crank, normal, grf, strict=True):
            h = t - self._time
            stances = counter.count
            counter.add(theta, load, force, h if h > 0 else math.inf)
            if counter.is_open:
                if counter.count > stances:
                    numbers["duty"] = self._stood / (t - self._began)
                    numbers["impulse"] = 0.0
                    self._began = t
                numbers["impulse"] += load * (h if h > 0 else 0.0)
                numbers["peak"] = counter.peak
                numbers["loading rate"] = counter.steepest / 1000
                self._stood = t - self._began
                numbers["mean"] = numbers["impulse"] / self._stood if self._stood > 0 else load
            self._time = t


class History:
    """Curves, rewards and rows of the last `KEPT_SECONDS`, which a page can show again."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Drop everything."""
        self._curves: deque[Columns] = deque()
        self._steps: deque[Columns] = deque()
        self._rows: deque[NDArray[np.float32]] = deque()

    def add_curves(self, curves: Columns) -> None:
        """Keep curves."""
        if len(curves["time"]):
            self._curves.append(curves)
            self._drop(curves["time"][-1] - KEPT_SECONDS)

    def add_steps(self, steps: Columns) -> None:
        """Keep terms of the reward of control steps."""
        if len(steps["time"]):
            self._steps.append(steps)

    def add_row(self, row: NDArray[np.float64]) -> None:
        """Keep a row if the last one is at least a hundredth of a second older."""
        if not self._rows or row[0] >= self._rows[-1][0] + 0.0099:
            self._rows.append(row.astype(np.float32))

    def _drop(self, before: float) -> None:
        """Drop what is older than a time [s]."""
        while self._curves[0]["time"][-1] < before:
            self._curves.popleft()
        while self._steps and self._steps[0]["time"][-1] < before:
            self._steps.popleft()
        while self._rows and self._rows[0][0] < before:
            self._rows.popleft()

    @property
    def span(self) -> tuple[float, float]:
        """First and last time of the rows [s], 0 and 0 without any."""
        return (float(self._rows[0][0]), float(self._rows[-1][0])) if self._rows else (0.0, 0.0)

    def row_at(self, time: float) -> NDArray[np.float32] | None:
        """Return the row nearest to a time [s]."""
        return min(self._rows, key=lambda row: abs(row[0] - time), default=None)

    def between(self, first: float, last: float) -> tuple[Columns, Columns]:
        """Return the curves and the terms of the reward from one time to another [s]."""
        return joined(self._curves, first, last), joined(self._steps, first, last)


def joined(parts: Iterable[Columns], first: float, last: float) -> Columns:
    """Return the rows of parts from one time to another [s], {} if there is none."""
    near = [part for part in parts if part["time"][-1] >= first and part["time"][0] <= last]
    if not near:
        return {}
    whole = {name: np.concatenate([part[name] for part in near]) for name in near[0]}
    inside = (whole["time"] >= first) & (whole["time"] <= last)
    return {name: values[inside] for name, values in whole.items()}
