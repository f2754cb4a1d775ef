"""From commands to motion: filtered gait parameters, crank angle and swing angle with all their derivatives.

A command (crank speed, swing offset, sine and cosine coefficient) does not act at once. Each passes a filter
whose rate and acceleration are bounded, so that crank angle and swing angle are twice differentiable whatever
a policy asks. The filters are part of the state, and their derivatives enter the swing's rate and
acceleration: a hoof speed that comes from changing a parameter is a real speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, check_number
from hoof_env.simd.compile import kernel

FILTER = np.dtype([("value", "f8"), ("rate", "f8"), ("acc", "f8")])
"""State of one filter: a parameter, its rate and its acceleration (per s, per s^2)."""

INNER = 5.0
"""How many times faster a filter's rate follows than its value; above 4 the approach does not oscillate."""

SPEED, OFFSET, SIN, COS = range(4)
"""Order of the four filters, as in `gait.parameters.PARAMETERS`."""

MOTION = np.dtype(
    [(name, "f8") for name in ("theta", "theta_rate", "theta_acc", "phi", "phi_rate", "phi_acc")]
)
"""Crank angle (clockwise positive, not wrapped) and swing angle, with two derivatives each [rad, s]."""


@dataclass(frozen=True)
class FilterSettings:
    """Bounds of the command filters.

    Attributes:
        gain: how fast a parameter approaches its command [1/s]; the rate follows `INNER` times as fast.
        crank_rate, crank_acc: bounds on the crank speed's rate [rad/s^2] and its acceleration [rad/s^3].
        swing_rate, swing_acc: the same for the three swing parameters [rad/s, rad/s^2].

    The acceleration bound must allow the approach: gain * rate <= acc, else a parameter could overshoot its
    command.
    """

    gain: float = 20.0
    crank_rate: float = 20.0
    crank_acc: float = 400.0
    swing_rate: float = 6.0
    swing_acc: float = 120.0

    def __post_init__(self) -> None:
        for name in ("gain", "crank_rate", "crank_acc", "swing_rate", "swing_acc"):
            check_number(f"filters.{name}", getattr(self, name), low=0, exclusive_low=True)
        for part in ("crank", "swing"):
            rate, acc = getattr(self, f"{part}_rate"), getattr(self, f"{part}_acc")
            if self.gain * rate > acc * (1 + 1e-12):
                raise ParameterError(
                    f"filters: expected gain * {part}_rate <= {part}_acc so that a command is not overshot, "
                    f"got {self.gain:g} * {rate:g} > {acc:g}"
                )

    @property
    def longest_step(self) -> float:
        """Longest time step [s] at which the filters still keep their bounds and do not overshoot."""
        return 1.0 / (INNER * self.gain)

    def to_array(self) -> NDArray[np.float64]:
        """Rows (gain, rate bound, acceleration bound) for the four filters, shape (4, 3)."""
        crank = (self.gain, self.crank_rate, self.crank_acc)
        swing = (self.gain, self.swing_rate, self.swing_acc)
        return np.array([crank, swing, swing, swing])


@kernel
def clip(x: float, bound: float) -> float:
    """`x` limited to [-bound, bound]."""
    return min(max(x, -bound), bound)


@kernel
def command_filters(filters, command, settings):  # type: ignore[no-untyped-def]
    """Set each filter's acceleration: bounded, towards a bounded rate, towards the command."""
    for k in range(4):
        gain, rate_bound, acc_bound = settings[k, 0], settings[k, 1], settings[k, 2]
        wanted_rate = clip(gain * (command[k] - filters[k].value), rate_bound)
        filters[k].acc = clip(INNER * gain * (wanted_rate - filters[k].rate), acc_bound)


@kernel
def advance_motion(motion, filters, h):  # type: ignore[no-untyped-def]
    """Advance filters and crank angle by `h` [s], exactly for constant filter accelerations."""
    speed = filters[SPEED]
    motion.theta += h * (speed.value + h * (speed.rate / 2.0 + h * speed.acc / 6.0))
    for k in range(4):
        filters[k].value += h * (filters[k].rate + h * filters[k].acc / 2.0)
        filters[k].rate += h * filters[k].acc


@kernel
def evaluate_motion(motion, filters):  # type: ignore[no-untyped-def]
    """Fill rates and accelerations of crank and swing from crank angle and filters.

    phi = phi0 + A sin(theta) + B cos(theta), differentiated twice with phi0, A, B and theta all moving.
    """
    s, c = np.sin(motion.theta), np.cos(motion.theta)
    offset, a, b = filters[OFFSET], filters[SIN], filters[COS]
    w, w_rate = filters[SPEED].value, filters[SPEED].rate
    motion.theta_rate = w
    motion.theta_acc = w_rate
    motion.phi = offset.value + a.value * s + b.value * c
    slope = a.value * c - b.value * s
    motion.phi_rate = offset.rate + a.rate * s + b.rate * c + slope * w
    motion.phi_acc = (
        offset.acc
        + a.acc * s
        + b.acc * c
        + 2.0 * (a.rate * c - b.rate * s) * w
        + slope * w_rate
        - (a.value * s + b.value * c) * w * w
    )


def steady_filters(parameters: NDArray[np.float64]) -> NDArray[np.void]:
    """Filters at rest at the given four parameters, shape (4,) of dtype `FILTER`."""
    filters = np.zeros(4, dtype=FILTER)
    filters["value"] = parameters
    return filters
