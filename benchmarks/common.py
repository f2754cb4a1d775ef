"""Parts that all engines share: links of the paper's leg, a pose to start from, ground forces from outside.

The other engines take this project's world: x forward, y up, angles counter-clockwise; planar vectors are
complex.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.parts import Limb
from hoof_env.ground.contact import Ground, new_contacts, touch
from hoof_env.leg.kinematics import FrameMotion, Pose, pose
from hoof_env.leg.link_tree import link_tree
from hoof_env.leg.mechanism_list import PAPER

RIGID = link_tree(PAPER)
"""Paper's leg with both triangles and the locked shank each as one link: 9 links, 13 pins, 4 loops."""

ALL = link_tree(PAPER, merge=False)
"""Paper's leg body for body: 14 links, 20 pins, 6 loops and a lock."""


@dataclass(frozen=True)
class Start:
    """State in which a horse begins, its trunk upright and at rest.

    Attributes:
        crank, crank_speed: angle and speed of each crank [rad, rad/s].
        swing: phi of each leg [rad].
        swing_sin, swing_cos: the gait's coefficients, by which phi of all legs follows the crank from there
            [rad].
        position: x and y of the trunk's point [m].
    """

    crank: tuple[float, ...]
    crank_speed: tuple[float, ...]
    swing: tuple[float, ...]
    swing_sin: float = 0.0
    swing_cos: float = 0.0
    position: tuple[float, float] = (0.0, 0.0)

    @property
    def swings(self) -> bool:
        """True if phi moves at all."""
        return bool(self.swing_sin or self.swing_cos)

    def phi(self, leg: int, theta: float) -> tuple[float, float]:
        """Return the swing of a leg at a crank angle [rad], and its slope by the crank angle."""
        a = self.swing_sin
        b = self.swing_cos
        begin = self.crank[leg]
        s = math.sin(theta)
        c = math.cos(theta)
        return self.swing[leg] + a * (s - math.sin(begin)) + b * (c - math.cos(begin)), a * c - b * s

    def poses(self, limbs: Sequence[Limb]) -> list[Pose]:
        """Return every point and body of each leg."""
        poses = []
        for i, limb in enumerate(limbs):
            rate = self.phi(i, self.crank[i])[1] * self.crank_speed[i]
            at = (self.position[0] + limb.hip[0], self.position[1] + limb.hip[1])
            frame = FrameMotion(phi=self.swing[i], phi_rate=rate, position=at)
            poses.append(pose(limb.geometry, self.crank[i], self.crank_speed[i], frame=frame))
        return poses


@dataclass
class Record:
    """Results of an engine at each sample; rows are samples, columns legs.

    Attributes:
        t: time [s].
        crank, crank_speed: angles and speeds of the cranks [rad, rad/s].
        body: x, y and pitch of the trunk and their rates, shape (samples, 6).
        crank_torque, hip_torque: torques of drive and swing, along theta and phi [N m].
        pins: forces [N], shape (samples, legs, pins, 2), in the order of the assembly's pins.
        closure: the widest gap of a loop [m].
    """

    t: NDArray[np.float64]
    crank: NDArray[np.float64]
    crank_speed: NDArray[np.float64]
    body: NDArray[np.float64]
    crank_torque: NDArray[np.float64]
    hip_torque: NDArray[np.float64]
    pins: NDArray[np.float64]
    closure: NDArray[np.float64]

    @classmethod
    def of(cls, rows: Sequence[tuple[Any, ...]]) -> Record:
        """Return a record from one tuple a sample, in the order of the attributes."""
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))


Outside = Callable[[int, int, float, complex, complex, bool], complex]
"""Function force(limb, point, t, position, velocity, commit): the force of the world on toe (0) or heel (1)
of a leg [N]. It is called with `commit` once for every whole step, and without it any number of times
between."""


class GroundForces:
    """Ground of this project as an `Outside`: contacts latch at whole steps only."""

    def __init__(self, ground: Ground, legs: int) -> None:
        self._ground = ground.to_record()
        self.contacts = [new_contacts() for _ in range(legs)]

    def __call__(
        self, limb: int, point: int, t: float, position: complex, velocity: complex, commit: bool
    ) -> complex:
        kept = self.contacts[limb][point]
        # Within a step an engine tries states that it may throw away: they must not latch
        contact = kept if commit else replace(kept)
        return touch(contact, position, velocity, self._ground)


def corners(limb: Limb) -> tuple[str, str]:
    """Return the names of toe and heel."""
    return limb.geometry.corners
