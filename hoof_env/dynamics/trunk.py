"""What the legs hang from: a trunk that is fixed, on a rail, suspended by the rest of the animal, or free."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError, check_choice, check_number

GRAVITY = 9.81
"""[m/s^2], as in the paper's Table 1."""

TRUNKS = ("fixed", "rail", "suspended", "free")
"""Kinds of trunk; the kernels take the position in this tuple."""

FIXED, RAIL, SUSPENDED, FREE = range(4)

ONE_LEG = TRUNKS[:FREE]
"""The kinds that `LegEngine` knows: a free trunk on one leg is no task."""

TRUNK = np.dtype(
    [("kind", "i8")]
    + [
        (name, "f8")
        for name in ("mass", "total_mass", "share", "stiffness", "damping", "height", "drag", "gravity")
    ]
)
"""What the kernels of `LegEngine` read; those of `TrunkEngine` read rows (`trunk_rows`)."""


@dataclass(frozen=True)
class Trunk:
    """The trunk over one leg, or over several; with one, O, the crank centre, is its point by default.

    "fixed": O stays where it is. "rail": O slides along x at fixed height. "suspended": O moves along x and
    y; the leg must bear `share` of the weight of trunk and leg, the rest of the animal carries the other part
    and adds a vertical spring and damper towards `height`. These three do not pitch. "free": the trunk moves
    along x and y and pitches, under its weight, its drag and its legs.

    Attributes:
        kind: one of `TRUNKS`.
        mass: trunk mass that goes with the legs [kg], without their own.
        share: part of the weight that the leg must bear, 0 to 1; "suspended" only.
        stiffness, damping: vertical spring [N/m] and damper [N s/m]; "suspended" only.
        drag: resistance to forward motion [N s/m].
        height: height of O above the ground [m] where the spring is at rest, of the rail, or at a start.
        pitch_inertia: of the trunk about its centre of mass [kg m^2]; "free" only.

    Raises:
        ParameterError: an unknown kind or a value out of range.
    """

    kind: str = "suspended"
    mass: float = 80.0
    share: float = 0.8
    stiffness: float = 4000.0
    damping: float = 1130.0
    drag: float = 20.0
    height: float = 1.7
    pitch_inertia: float = 20.0

    def __post_init__(self) -> None:
        check_choice("trunk", self.kind, TRUNKS)
        check_number("trunk_mass", self.mass, low=0, exclusive_low=True)
        check_number("trunk_share", self.share, low=0, high=1)
        check_number("trunk_stiffness", self.stiffness, low=0)
        check_number("trunk_damping", self.damping, low=0)
        check_number("trunk_drag", self.drag, low=0)
        check_number("trunk_height", self.height, low=0, exclusive_low=True)
        check_number("trunk_pitch_inertia", self.pitch_inertia, low=0, exclusive_low=True)

    def to_record(self, leg_mass: float, gravity: float) -> Any:
        """The settings as one record of dtype `TRUNK` for the kernels of `LegEngine`."""
        record = np.zeros(1, dtype=TRUNK)[0]
        record["kind"] = TRUNKS.index(self.kind)
        for name in ("mass", "share", "stiffness", "damping", "height", "drag"):
            record[name] = getattr(self, name)
        record["total_mass"], record["gravity"] = self.mass + leg_mass, gravity
        return record

    def check_step(self, h: float, leg_mass: float) -> None:
        """Raise `ParameterError` where a step of `h` [s] makes semi-implicit Euler blow up the free trunk.

        With the mass m of trunk and leg, spring k and damper c are stable while h^2 k / m + 2 h c / m < 4.
        """
        m = self.mass + leg_mass
        if self.kind == "suspended" and h * h * self.stiffness / m + 2 * h * self.damping / m >= 4:
            raise ParameterError(
                f"trunk_stiffness, trunk_damping: expected h^2 k / m + 2 h c / m < 4 with h = {h:g} s and "
                f"m = {m:g} kg, got k = {self.stiffness:g} N/m and c = {self.damping:g} N s/m"
            )
        if self.kind != "fixed" and h * self.drag / m >= 2:
            raise ParameterError(
                f"trunk_drag: expected less than 2 m / h = {2 * m / h:g} N s/m, got {self.drag:g} N s/m"
            )
