"""Animals that `speed` times: the same leg and the same horse in every engine.

All walk: contact, motors, steps of 1 ms. MuJoCo's legs keep their swing, so here all legs do; the engine has
no branch on a swing, so all gaits cost the same. MuJoCo's contact is not in N/m: its time constant here
is chosen so that the cranks turn about as fast and the hooves are down about as long as on this project's
ground: 30 % of the time at 98 % of the command for a leg, 34 to 36 % at 78 to 80 % for a horse. With the
usual one, 0.02 s, a leg on a fixed trunk is jammed against the floor and stalls.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.common import Start
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import HoofSpring, Limb, Motor, Trunk
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.gait import GaitParameters, load_gait
from hoof_env.ground.contact import load_ground
from hoof_env.leg.geometry import load_geometry

DT = 1e-3
SPEED = 2 * np.pi


@dataclass(frozen=True)
class Scene:
    """Legs on a trunk, the same for all engines.

    Attributes:
        name: name in the table's rows.
        limbs, trunk: the animal.
        cranks: angle of each crank at the start [rad].
        swing: swing of all legs [rad].
        softness: time constant of MuJoCo's contact [s].
    """

    name: str
    limbs: tuple[Limb, ...]
    trunk: Trunk
    cranks: tuple[float, ...]
    swing: float
    softness: float

    @property
    def start(self) -> Start:
        """State in which it begins."""
        n = len(self.limbs)
        return Start(self.cranks, (SPEED,) * n, (self.swing,) * n, position=(0.0, self.trunk.height))


def scenes(preset: str) -> dict[str, Scene]:
    """Return the leg on a fixed trunk, the leg on a suspended one, and the horse, by name."""
    geometry = load_geometry(preset)
    swing = load_gait("walk", preset).swing_offset
    high = geometry.hip_height
    one_limb = (Limb(geometry, drive=Motor()),)
    hips = ((0.6, 0.0), (0.6, 0.0), (-0.6, 0.0), (-0.6, 0.0))
    four = tuple(Limb(geometry, hip=hip, drive=Motor()) for hip in hips)
    trot = tuple(0.3 + x for x in (0.0, np.pi, np.pi, 0.0))
    big = Trunk(kind="free", mass=200.0, pitch_inertia=150.0, height=high)
    return {
        scene.name: scene
        for scene in (
            Scene("leg", one_limb, Trunk(kind="fixed", height=high - 0.05), (0.3,), swing, 1.0),
            Scene("suspended leg", one_limb, Trunk(kind="suspended", height=high), (0.3,), swing, 0.1),
            Scene("horse", four, big, trot, swing, 0.1),
        )
    }


def with_springs(scene: Scene) -> Scene:
    """Return the scene with springs at the hooves."""
    spring = HoofSpring.with_ratio(4e4, 475.0 / 4)
    return replace(scene, limbs=tuple(replace(limb, spring=spring) for limb in scene.limbs))


def engine(scene: Scene, preset: str, num_envs: int = 1, **options: Any) -> TrunkEngine:
    """Return the scene in this project's engine, with crank angles all round the circle, in random order."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)  # the cost of a step is asked, not its error
        trunk_engine = TrunkEngine(
            scene.limbs, scene.trunk, load_ground(preset), sim_dt=DT, substeps=1, num_envs=num_envs, **options
        )
    turns = 2 * np.pi / num_envs * np.random.default_rng(0).permutation(num_envs)
    gait = GaitParameters(SPEED, scene.swing, 0.0, 0.0)
    trunk_engine.reset(gait, np.array(scene.cranks)[:, None] + turns)
    return trunk_engine
