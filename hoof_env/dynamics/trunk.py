"""What the legs hang from: a trunk that is fixed, on a rail, suspended by the rest of the animal, or free."""

from __future__ import annotations

from dataclasses import dataclass

from hoof_env.errors import check_choice, check_number

GRAVITY = 9.81
"""[m/s^2], as in the paper's Table 1."""

TRUNKS = ("fixed", "rail", "suspended", "free")
"""Kinds of trunk; the kernels take the position in this tuple."""

FIXED, RAIL, SUSPENDED, FREE = range(4)

ONE_LEG = TRUNKS[:FREE]
"""The kinds of the environments: a free trunk on one leg is no task."""


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
