"""What turns the crank: a prescribed motion, or a motor that can give way.

With a prescribed drive, the paper's, the crank angle is a function of time and of the commands: whatever
torque that takes is there. A motor is a speed servo with a torque limit, a rotor and a gear, so that a ground
force slows the crank. The swing is geared to the crank in both: it is a function of the crank angle and of
the gait parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

from hoof_env.errors import check_number


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
