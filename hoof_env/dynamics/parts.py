"""What an engine is made of: a trunk, legs in their places on it, and what turns their cranks; and what it
says of a run.

A prescribed drive is the paper's: the crank angle is a function of time and of the commands, whatever torque
that takes. A motor is a speed servo with a torque limit, a rotor and a gear, so that a ground force slows the
crank. In both the swing is a function of the crank angle and of the gait parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import Floats, ParameterError, check_choice, check_number
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.profile import LegProfile

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
        length: of the trunk [m], whose ends hips must not be beyond; None knows no ends.

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
    length: float | None = None

    def __post_init__(self) -> None:
        check_choice("trunk", self.kind, TRUNKS)
        check_number("trunk_mass", self.mass, low=0, exclusive_low=True)
        check_number("trunk_share", self.share, low=0, high=1)
        check_number("trunk_stiffness", self.stiffness, low=0)
        check_number("trunk_damping", self.damping, low=0)
        check_number("trunk_drag", self.drag, low=0)
        check_number("trunk_height", self.height, low=0, exclusive_low=True)
        check_number("trunk_pitch_inertia", self.pitch_inertia, low=0, exclusive_low=True)
        if self.length is not None:
            check_number("trunk_length", self.length, low=0, exclusive_low=True)


@dataclass(frozen=True)
class Prescribed:
    """The crank follows the filtered command exactly (the paper's driver, row 42 of Eq. 2)."""


LARGEST = 1e9
"""Of each number of a motor, whose squares are then numbers still."""


@dataclass(frozen=True)
class Motor:
    """A speed servo: torque = speed_gain (commanded - actual crank speed), limited to +-torque_limit.

    The rotor sits on the leg's frame, turns `gear_ratio` times as fast as the crank and in the same sense;
    what it adds to the crank's inertia is gear_ratio^2 rotor_inertia.

    Attributes:
        speed_gain: [N m s/rad], at the crank.
        torque_limit: [N m], at the crank.
        rotor_inertia: of the rotor about its axis [kg m^2].
        gear_ratio: turns of the rotor for one of the crank [-].

    Raises:
        ParameterError: a value is not finite, negative or beyond `LARGEST`.
    """

    speed_gain: float = 100.0
    torque_limit: float = 600.0
    rotor_inertia: float = 2e-4
    gear_ratio: float = 50.0

    def __post_init__(self) -> None:
        for name in ("speed_gain", "torque_limit", "rotor_inertia", "gear_ratio"):
            check_number(f"motor.{name}", getattr(self, name), low=0, high=LARGEST)

    @property
    def reflected_inertia(self) -> float:
        """What the rotor adds to the inertia of the crank [kg m^2]."""
        return self.gear_ratio**2 * self.rotor_inertia


Drive = Prescribed | Motor


@dataclass(frozen=True)
class HoofSpring:
    """A massless spring and damper at each hoof point, in series between the leg and the ground.

    Its axes are the normal and the tangent of the ground under the point. The sole, which touches the ground,
    has no mass: along the normal, spring and damper carry what Eq. 14 gives at the sole's penetration, along
    the tangent no more than Coulomb's friction coefficient times that; up to there the sole stands still, for
    no sliding speed is needed to have friction. Thresholds of the ground's friction law have no part in it.

    Attributes:
        stiffness, damping: along the normal [N/m, N s/m].
        tangential_stiffness, tangential_damping: along the tangent; None is the same as along the normal.

    Raises:
        ParameterError: a value is not positive and finite: without damping a massless sole has no speed.
    """

    stiffness: float
    damping: float
    tangential_stiffness: float | None = None
    tangential_damping: float | None = None

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            value = check_number(
                f"hoof_spring.{name}", getattr(self, name), low=0, high=1e12, exclusive_low=True
            )
            other = getattr(self, f"tangential_{name}")
            other = value if other is None else other
            check_number(f"hoof_spring.tangential_{name}", other, low=0, high=1e12, exclusive_low=True)
            object.__setattr__(self, f"tangential_{name}", other)

    @classmethod
    def with_ratio(cls, stiffness: float, mass: float, ratio: float = 0.1) -> HoofSpring:
        """The spring whose damping has this ratio to the critical one of a mass on it [kg]."""
        for name, value in (("stiffness", stiffness), ("mass", mass), ("ratio", ratio)):
            check_number(f"hoof_spring.{name}", value, low=0, high=1e12, exclusive_low=True)
        return cls(stiffness, 2 * ratio * math.sqrt(stiffness * mass))


@dataclass(frozen=True)
class Limits:
    """Where a motion should end, see `Result`; infinite bounds hold nothing back.

    Attributes:
        pitch: lowest and highest [rad].
        height: of the trunk's centre of mass above the ground, lowest and highest [m].
        clearance: of all joints but the hoof's corners above the ground, at least [m].

    Raises:
        ParameterError: a bound is not a number, or the lower one is not the lower one.
    """

    pitch: tuple[float, float] = (-math.inf, math.inf)
    height: tuple[float, float] = (-math.inf, math.inf)
    clearance: float = -math.inf

    def __post_init__(self) -> None:
        for name in ("pitch", "height"):
            given = getattr(self, name)
            try:
                low, high = (float(value) for value in given)
            except (TypeError, ValueError):
                low = high = math.nan
            if not low < high:
                raise ParameterError(f"limits.{name}: expected a lower and a higher bound, got {given!r}")
            object.__setattr__(self, name, (low, high))
        least: Any = self.clearance
        if isinstance(least, bool) or not isinstance(least, (int, float, np.number)) or math.isnan(least):
            raise ParameterError(f"limits.clearance: expected a number, got {least!r}")


MAX_HIP_OFFSET = 1e3
"""Of O from the trunk's centre of mass [m]."""


@dataclass(frozen=True)
class Limb:
    """One leg on a trunk.

    Attributes:
        geometry: the leg.
        hip: where the crank centre O sits on the trunk, from the trunk's centre of mass [m], forward and up.
        drive: what turns its crank.
        spring: of the hoof; None is a rigid one.

    Raises:
        ParameterError: a part is of the wrong type, not finite, or the hip beyond `MAX_HIP_OFFSET`.
    """

    geometry: Geometry
    hip: tuple[float, float] = (0.0, 0.0)
    drive: Drive = field(default_factory=Motor)
    spring: HoofSpring | None = None

    def __post_init__(self) -> None:
        if self.spring is not None and not isinstance(self.spring, HoofSpring):
            raise ParameterError(f"limb.spring: expected a HoofSpring or None, got {self.spring!r}")
        if not isinstance(self.geometry, Geometry):
            raise ParameterError(f"limb.geometry: expected a Geometry, got {self.geometry!r}")
        if not isinstance(self.drive, (Prescribed, Motor)):
            raise ParameterError(f"limb.drive: expected a Motor or Prescribed, got {self.drive!r}")
        try:
            x, y = self.hip
        except (TypeError, ValueError):
            raise ParameterError(
                f"limb.hip: expected two numbers (x, y) in metres, got {self.hip!r}"
            ) from None
        for k, value in enumerate((x, y)):
            check_number(f"limb.hip[{k}]", value, low=-MAX_HIP_OFFSET, high=MAX_HIP_OFFSET)
        object.__setattr__(self, "hip", (float(x), float(y)))


@dataclass(eq=False, repr=False)
class Mechanics:
    """Legs on a trunk over the ground, and the scheme that moves them."""

    limbs: Sequence[Limb]
    profiles: Sequence[LegProfile]  # of each leg
    trunk: Trunk
    ground: Ground
    terrain: Terrain
    integrator: str
    features: Any = None  # `layout.Features`, of an engine
    motion_limits: Limits | None = None
    step_error: float = 0.01  # of the state after a contact, with which steps are chosen [-]


class Reactions(NamedTuple):
    """What joints and drives do to the links, in the world (x forward, y up, counter-clockwise); a motor's
    rotor is not among the links. Shapes are of `ConstrainedLeg`; `TrunkEngine` gives (legs, ..., num_envs).

    Attributes:
        joints: force on body `i` of each `Joint(point, i, j)` of `linkage.JOINTS`, shape (20, 2) [N]; body
            `j`, or the frame, feels the opposite.
        lock: moment on body 10 by body 7 [N m].
        driver: moment on the crank by the leg's frame [N m].
        hip: moment on the leg's frame by the trunk, about O [N m].
    """

    joints: Floats
    lock: Any
    driver: Any
    hip: Any


class Tally(NamedTuple):
    """What all bodies add up to, shape (num_envs,) each."""

    centre: Any  # common centre of mass, complex [m]
    momentum: Any  # complex [kg m/s]
    spin: Floats  # angular momentum about the centre [kg m^2/s]
    kinetic: Floats  # rotors included [J]
    potential: Floats  # of weight and, on a suspended trunk, of spring and support [J]


class Result(IntEnum):
    """Outcome of an advance. Those from PITCH on are of `Limits`: the motion goes on, its state is kept."""

    OK = 0
    NOT_FINITE = 1
    SINGULAR = 2
    DEAD_POINT = 3
    FALLEN = 4
    PITCH = 5
    HEIGHT = 6
    LOW_JOINT = 7

    @property
    def message(self) -> str:
        """What happened, for people."""
        return _MESSAGES[self]


def broken(results: NDArray[Any]) -> NDArray[np.bool_]:
    """Which outcomes, values of `Result`, are of what could not be simulated, so that nothing happened."""
    return (results != Result.OK) & (results < Result.PITCH)


_PUT_BACK = "the state was put back to the last good one"
_MESSAGES = {
    Result.OK: "ok",
    Result.NOT_FINITE: "the state stopped being finite; it was put back to the last good one",
    Result.SINGULAR: f"the equations of motion are singular; {_PUT_BACK}",
    Result.DEAD_POINT: f"a crank was driven to an angle at which its linkage does not close; {_PUT_BACK}",
    Result.FALLEN: f"the trunk fell through the ground; {_PUT_BACK}",
    Result.PITCH: "the trunk pitched beyond its limits",
    Result.HEIGHT: "the trunk left its range of heights",
    Result.LOW_JOINT: "a joint came too near the ground",
}
