"""The horses and starts on which the engines are compared."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.common import GroundForces, Start, corners
from hoof_env.dynamics.parts import Drive, Limb, Motor, Prescribed, Trunk
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.leg.geometry import load_geometry
from tests.peers.trunk_legs import TrunkLegs

HIGH = 10.0
"""Of a trunk whose legs are in the air [m]."""

DEPTH, GAP = 0.05, 0.01
"""On the ground, one leg begins where its hoof is highest, and would go so deep in a turn at that height of
the trunk; the hoofs of several start so far above it [m]."""

HIPS = ((0.6, 0.0), (0.55, -0.05), (-0.6, 0.0), (-0.65, 0.03))
PHASES = (0.0, np.pi, np.pi / 2, -np.pi / 2)


@dataclass(frozen=True)
class Case:
    """A horse of a preset, how it starts and for how long it is followed."""

    kind: str  # of trunk
    legs: int = 1
    drive: Drive = Prescribed()  # noqa: RUF009 (frozen)
    swung: bool = (
        False  # whether phi follows the crank, as in the preset's run; else it is held as amid its walk
    )
    ground: bool = False  # whether there is any in reach
    duration: float = 1.0  # [s]
    samples: int = 50  # instants at which the engines are compared, besides the beginning

    @property
    def name(self):
        legs = "one leg" if self.legs == 1 else f"{self.legs} legs"
        drive = "motor" if isinstance(self.drive, Motor) else "prescribed crank"
        swing = "swing geared to the crank" if self.swung else "swing held"
        return f"{legs}, {self.kind} trunk, {drive}, {swing}, {'ground' if self.ground else 'air'}"

    def horse(self, preset):
        """With the leg, ground and run of a preset."""
        geometry, n = load_geometry(preset), self.legs
        gait = load_gait("run" if self.swung else "walk", preset)
        hips = HIPS[:n] if n > 1 else [(0.0, 0.0)]
        limbs = tuple(Limb(geometry, hip=hip, drive=self.drive) for hip in hips)
        a, b = (gait.swing_sin, gait.swing_cos) if self.swung else (0.0, 0.0)

        def start(thetas, height):
            swing = gait.swing_offset + a * np.sin(thetas) + b * np.cos(thetas)
            k = len(thetas)
            return Start(tuple(thetas), (gait.crank_speed,) * k, tuple(swing), a, b, (0.0, height))

        def sole(thetas, limbs):
            """Height of the lower of toe and heel above the trunk's centre [m]."""
            poses = start(thetas, 0.0).poses(limbs)
            return [
                min(pose.point(name)[1] for name in corners(limb))
                for pose, limb in zip(poses, limbs, strict=True)
            ]

        turn = np.linspace(0, 2 * np.pi, 360, endpoint=False)
        heights = sole(turn, limbs[:1] * len(turn))
        thetas = (turn[np.argmax(heights)] + np.array(PHASES[:n])).tolist()
        high = HIGH
        if self.ground:
            high = -min(heights) - DEPTH if n == 1 else GAP - min(sole(thetas, limbs))
        trunk = Trunk(kind=self.kind, height=high)
        return Horse(limbs, trunk, start(thetas, high), load_ground(preset), self)


@dataclass(frozen=True)
class Horse:
    """What the engines are given, and how each is run."""

    limbs: tuple[Limb, ...]
    trunk: Trunk
    start: Start
    ground: Ground
    case: Case

    def ours(self, dt, integrator="rk4"):
        """This project's engine."""
        legs = TrunkLegs(self.limbs, self.trunk, self.start, dt, self.ground, integrator)
        return legs.run(self.case.duration, self.case.samples)

    def peer(self, engine, dt, **settings):
        """A peer's record, and the assembly whose pins it has; `settings` are the peer's own."""
        outside = GroundForces(self.ground, len(self.limbs)) if self.case.ground else None
        legs = engine(self.limbs, self.trunk, self.start, dt=dt, outside=outside, **settings)
        return legs.run(self.case.duration, self.case.samples), legs.assembly


CASES = tuple(
    one
    for case in (
        Case("fixed"),
        Case("fixed", swung=True),
        Case("fixed", drive=Motor()),
        Case("fixed", drive=Motor(), swung=True),
        Case("rail", drive=Motor()),
        Case("suspended", drive=Motor()),
        Case("suspended", drive=Motor(), swung=True),
        Case("free", legs=4, drive=Motor(), duration=0.4, samples=40),
        Case("free", legs=4, drive=Motor(), swung=True, duration=0.4, samples=40),
    )
    for one in (case, replace(case, ground=True))
)
