"""Parts of an engine: a trunk, legs in their places on it, and the drives of their cranks; results of a run.

A prescribed drive is the paper's: the crank angle is a function of time and of the commands, with any
torque. A motor is a speed servo with a torque limit, a rotor and a gear, so that a ground force slows the
crank. In both the swing is a function of the crank angle and of the gait parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import Floats, ParameterError, brief, check_choice, check_number
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.profile import LegProfile

FREEDOMS: Mapping[str, int] = MappingProxyType(
    {"fixed": 0, "rail": 1, "suspended": 2, "boom": 2, "floating": 3, "free": 3}
)
"""Number of the coordinates x, y and pitch, in this order, in which each kind of trunk moves; kernels take
it."""

FIXED, RAIL, UPRIGHT, FREE = range(4)

TRUNKS = tuple(FREEDOMS)
"""Kinds of trunk."""

ONE_LEG = TRUNKS[:-1]
"""Kinds of trunk of the environments of one leg."""


@dataclass(frozen=True)
class Trunk:
    """Trunk over one leg, or over several; with one leg, O, the crank centre, is its point by default.

    "fixed": O stays in place. "rail": O slides along x at fixed height. "suspended": O moves along x and y;
    the leg must bear `share` of the weight of trunk and leg, the rest of the animal carries the remainder
    and adds a vertical spring and damper towards `height`. "boom": O moves along x and y, and the leg bears
    the whole weight. These four do not pitch. "floating" over one leg and "free" over a horse's: the trunk
    moves along x and y and pitches, under its weight, its drag and its legs.

    Attributes:
        kind: one of `TRUNKS`.
        mass: trunk mass without the legs [kg].
        share: part of the weight that the leg must bear, 0 to 1; "suspended" only.
        stiffness, damping: vertical spring [N/m] and damper [N s/m]; "suspended" only.
        drag: resistance to forward motion [N s/m].
        height: height of O above the ground [m] where the spring is at rest, of the rail, or at a start.
        pitch_inertia: moment of inertia about its centre of mass [kg m^2]; of a trunk that pitches only.
        length: length of the trunk [m]; no hip may be beyond its ends. None for an unlimited one.

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

    @property
    def pitches(self) -> bool:
        """True if the trunk is free to pitch."""
        return FREEDOMS[self.kind] == FREE

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
    """Drive of a crank that follows the filtered command exactly (the paper's driver, row 42 of Eq. 2)."""


MAX_IMPULSE = 1e6
"""Largest impulse of a push [N s]."""

MAX_COEFFICIENT = 1e9
"""Largest motor parameter; its square must stay finite."""


@dataclass(frozen=True)
class Motor:
    """Speed servo: torque = speed_gain (commanded - actual crank speed), limited to +-torque_limit.

    The rotor sits on the leg's frame, turns `gear_ratio` times as fast as the crank and in the same sense; it
    adds gear_ratio^2 rotor_inertia to the crank's inertia.

    Attributes:
        speed_gain: torque per error of the speed, at the crank [N m s/rad].
        torque_limit: largest torque, at the crank [N m].
        rotor_inertia: moment of inertia of the rotor about its axis [kg m^2].
        gear_ratio: turns of the rotor for one of the crank [-].

    Raises:
        ParameterError: a value is not finite, negative or beyond `MAX_COEFFICIENT`.
    """

    speed_gain: float = 100.0
    torque_limit: float = 600.0
    rotor_inertia: float = 2e-4
    gear_ratio: float = 50.0

    def __post_init__(self) -> None:
        for name in ("speed_gain", "torque_limit", "rotor_inertia", "gear_ratio"):
            check_number(f"motor.{name}", getattr(self, name), low=0, high=MAX_COEFFICIENT)

    @property
    def reflected_inertia(self) -> float:
        """Inertia of the rotor as seen at the crank [kg m^2]."""
        return self.gear_ratio**2 * self.rotor_inertia


Drive = Prescribed | Motor


@dataclass(frozen=True)
class HoofSpring:
    """Massless spring and damper at each hoof point, in series between the leg and the ground.

    Its axes are the normal and the tangent of the ground under the point. The sole, which touches the ground,
    has no mass. Along the normal, spring and damper carry the force of Eq. 14 at the sole's penetration.
    Along the tangent they carry at most Coulomb's friction coefficient times that force; below it the sole
    sticks, because friction needs no sliding speed. The thresholds of the ground's friction law are not
    used.

    A spring with a length stands for the pastern: at rest the sole is so far below the leg's point, against
    the ground's normal, and the point stays above the ground while the spring is compressed by less. The sole
    turns with the ground and not with the leg, and the force of the ground passes through the leg's point.

    Attributes:
        stiffness, damping: along the normal [N/m, N s/m].
        tangential_stiffness, tangential_damping: along the tangent; None for the value along the normal.
        length: distance of the sole from the leg's point at rest [m]; with 0 the point itself sinks.

    Raises:
        ParameterError: a value is not positive and finite: without damping the speed of a massless sole is
            undefined.
    """

    stiffness: float
    damping: float
    tangential_stiffness: float | None = None
    tangential_damping: float | None = None
    length: float = 0.0

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            value = check_number(
                f"hoof_spring.{name}", getattr(self, name), low=0, high=1e12, exclusive_low=True
            )
            tangential = getattr(self, f"tangential_{name}")
            tangential = value if tangential is None else tangential
            check_number(f"hoof_spring.tangential_{name}", tangential, low=0, high=1e12, exclusive_low=True)
            # the dataclass is frozen: `__post_init__` cannot assign
            object.__setattr__(self, f"tangential_{name}", tangential)
        check_number("hoof_spring.length", self.length, low=0, high=1e3)

    @classmethod
    def with_ratio(cls, stiffness: float, mass: float, ratio: float = 0.1) -> HoofSpring:
        """Return the spring with this ratio of its damping to the critical damping of a mass on it [kg]."""
        for name, value in (("stiffness", stiffness), ("mass", mass), ("ratio", ratio)):
            check_number(f"hoof_spring.{name}", value, low=0, high=1e12, exclusive_low=True)
        return cls(stiffness, 2 * ratio * math.sqrt(stiffness * mass))


@dataclass(frozen=True)
class Limits:
    """Limits of a motion; see `Result`; an infinite bound is no limit.

    Attributes:
        pitch: lowest and highest pitch [rad].
        height: lowest and highest height of the trunk's centre of mass above the ground [m].
        clearance: least height above the ground of all joints except the hoof's corners [m].

    Raises:
        ParameterError: a bound is not a number, or a lower bound is not below the upper one.
    """

    pitch: tuple[float, float] = (-math.inf, math.inf)
    height: tuple[float, float] = (-math.inf, math.inf)
    clearance: float = -math.inf

    def __post_init__(self) -> None:
        for name in ("pitch", "height"):
            bounds = getattr(self, name)
            try:
                low, high = (float(value) for value in bounds)
            except (TypeError, ValueError):
                low = high = math.nan
            # false for NaN, too
            if not low < high:
                raise ParameterError(
                    f"limits.{name}: expected a lower and a higher bound, got {brief(bounds)}"
                )
            object.__setattr__(self, name, (low, high))
        # bool is a kind of int to Python, but True is not a height
        least: Any = self.clearance
        if isinstance(least, bool) or not isinstance(least, (int, float, np.number)) or math.isnan(least):
            raise ParameterError(f"limits.clearance: expected a number, got {brief(least)}")


MAX_HIP_OFFSET = 1e3
"""Largest distance of O from the trunk's centre of mass along x and along y [m]."""


@dataclass(frozen=True)
class Limb:
    """One leg on a trunk.

    Attributes:
        geometry: links and masses of the leg.
        hip: place of the crank centre O on the trunk, from the trunk's centre of mass [m], forward and up.
        drive: drive of its crank.
        spring: spring of the hoof; None for a rigid hoof.

    Raises:
        ParameterError: a part has the wrong type or is not finite, or the hip lies beyond `MAX_HIP_OFFSET`.
    """

    geometry: Geometry
    hip: tuple[float, float] = (0.0, 0.0)
    drive: Drive = field(default_factory=Motor)
    spring: HoofSpring | None = None

    def __post_init__(self) -> None:
        if self.spring is not None and not isinstance(self.spring, HoofSpring):
            raise ParameterError(f"limb.spring: expected a HoofSpring or None, got {brief(self.spring)}")
        if not isinstance(self.geometry, Geometry):
            raise ParameterError(f"limb.geometry: expected a Geometry, got {brief(self.geometry)}")
        if not isinstance(self.drive, (Prescribed, Motor)):
            raise ParameterError(f"limb.drive: expected a Motor or Prescribed, got {brief(self.drive)}")
        try:
            x, y = self.hip
        except (TypeError, ValueError):
            raise ParameterError(
                f"limb.hip: expected two numbers (x, y) in metres, got {brief(self.hip)}"
            ) from None
        for k, value in enumerate((x, y)):
            check_number(f"limb.hip[{k}]", value, low=-MAX_HIP_OFFSET, high=MAX_HIP_OFFSET)
        # a tuple of floats can be hashed and stored as JSON, unlike an array
        object.__setattr__(self, "hip", (float(x), float(y)))


@dataclass(frozen=True, eq=False, repr=False)
class Mechanics:
    """Legs on a trunk over the ground, and the scheme that moves them: all that follows from the settings of
    an engine."""

    limbs: Sequence[Limb]
    profiles: Sequence[LegProfile]  # of each leg
    trunk: Trunk
    ground: Ground
    terrain: Terrain
    integrator: str
    features: Any = None  # `layout.Features`, of an engine
    motion_limits: Limits | None = None
    step_error: float = 0.01  # of the state after a contact, with which steps are chosen [-]
    substeps: int = 1
    step_limits: dict[str, float] = field(default_factory=dict)  # longest step [s] for each cause
    model: tuple[NDArray[Any], ...] = ()  # constant arrays of the kernels; see `memory.new_model`


class Reactions(NamedTuple):
    """Forces and moments of joints and drives on the links, in the world (x forward, y up,
    counter-clockwise); a motor's rotor is not among the links. Shapes are for `ConstrainedLeg`;
    `TrunkEngine` returns (legs, ..., num_envs).

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


class Result(IntEnum):
    """Outcome of an advance. Values from PITCH on are violated `Limits`: the motion continues from
    its state."""

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
        """Sentence that describes the outcome."""
        return _MESSAGES[self]


def broken(results: NDArray[Any]) -> NDArray[np.bool_]:
    """Return a mask of the outcomes, values of `Result`, that mean that an environment could not be simulated
    and has its former state."""
    return (results != _OK) & (results < _PITCH)


_OK = int(Result.OK)
_PITCH = int(Result.PITCH)


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
