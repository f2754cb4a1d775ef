"""What a policy sees: 24 numbers in [-1, 1] on a suspended trunk, fewer where the trunk cannot move."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.gait.parameters import LIMITS

SPEED_SCALE, RISE_SCALE, HEIGHT_SCALE, APPROACH_SCALE, LOAD_SCALE = 5.0, 2.0, 0.3, 2.0, 3.0
"""Scales of tanh: forward speed [m/s], vertical speed [m/s], height [m], approach
speed [m/s], force [weights]."""

_LOW, _HIGH = (np.array([limit[i] for limit in LIMITS.values()]) for i in (0, 1))
MIDDLE, HALF_RANGE = (_LOW + _HIGH) / 2, (_HIGH - _LOW) / 2
"""Middle and half range of the gait parameters, shape (4,)."""

_BEFORE = (
    "sin(crank angle)",
    "cos(crank angle)",
    "crank speed",
    "swing offset",
    "swing sine coefficient",
    "swing cosine coefficient",
    "rate of crank speed",
    "rate of swing offset",
    "rate of swing sine coefficient",
    "rate of swing cosine coefficient",
)
_TRUNK = {
    "fixed": (),
    "rail": ("forward speed",),
    "suspended": ("forward speed", "vertical speed", "height"),
}
_AFTER = (
    "toe contact",
    "heel contact",
    "toe load",
    "heel load",
    "toe approach speed",
    "heel approach speed",
    "running peak force",
    "previous action: crank speed",
    "previous action: swing offset",
    "previous action: swing sine coefficient",
    "previous action: swing cosine coefficient",
)


def layout(trunk: str) -> tuple[str, ...]:
    """Names of the entries for a kind of trunk, in order."""
    return _BEFORE + _TRUNK[trunk] + _AFTER


def observe(
    row: Any,
    filters: NDArray[np.void],
    rate_bounds: NDArray[np.float64],
    trunk: str,
    height: float,
    weight: float,
    peak: float,
    action: NDArray[np.float32],
) -> NDArray[np.float32]:
    """The observation after a control step, float32, entries as in `layout`.

    Unbounded quantities are squashed by tanh(value / scale); parameters and their rates are divided by
    their bounds.

    Args:
        row: last row of the trace.
        filters, rate_bounds: command filters and the bounds of their rates, shape (4,).
        trunk, height: kind of trunk and its nominal height [m].
        weight: of trunk and leg [N].
        peak: running peak of the open stance [N].
        action: the last one, shape (4,).
    """
    values = ((filters["value"] - MIDDLE) / HALF_RANGE).tolist()
    rates = (filters["rate"] / rate_bounds).tolist()
    body: tuple[float, ...] = ()
    if trunk != "fixed":
        body = (math.tanh(row["trunk_vx"] / SPEED_SCALE),)
    if trunk == "suspended":
        body += (math.tanh(row["trunk_vy"] / RISE_SCALE), math.tanh((row["trunk_y"] - height) / HEIGHT_SCALE))
    load = LOAD_SCALE * weight
    theta = row["theta"]
    entries = (
        math.sin(theta), math.cos(theta), *values, *rates, *body,
        float(row["toe_penetration"] > 0), float(row["heel_penetration"] > 0),
        math.tanh(row["toe_normal"] / load), math.tanh(row["heel_normal"] / load),
        math.tanh(row["toe_approach"] / APPROACH_SCALE), math.tanh(row["heel_approach"] / APPROACH_SCALE),
        math.tanh(peak / load), *action.tolist(),
    )  # fmt: skip
    return np.clip(np.array(entries, dtype=np.float32), -1.0, 1.0)
