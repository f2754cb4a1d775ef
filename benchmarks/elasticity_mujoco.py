"""Landings and episodes of one leg in MuJoCo on elastic and inelastic ground, for `benchmarks.elasticity`.

`landing` applies the force of this package's ground, Eq. 14, to toe and heel from outside. MuJoCo has the
mechanics: links, loops, trunk. Crank and swing move as the gait prescribes, for their joints have an inertia
that no force of the leg changes. `landing` is otherwise as in `benchmarks.elasticity_runs`.

`own_contact` plays HorseLeg-v0 with MuJoCo's contact, a spring and damper in proportion to the mass that
moves at the contact. It has no counterpart under a fixed trunk: the mass there is the drives', without
bound.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from benchmarks.common import GroundForces
from benchmarks.elasticity_runs import LEG, touch_down
from benchmarks.mujoco_episode import DEEP, HARDEST
from benchmarks.mujoco_legs import FLYWHEEL, TRUTH_OPTION
from benchmarks.mujoco_transfer import CONTACT, SEEDS, play_there
from hoof_env.dynamics.parts import Trunk
from hoof_env.gait import GaitParameters, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.link_tree import CRANK_LINK, link_tree
from hoof_env.leg.mjcf import RADIUS, Options, PlacedLeg, write_mjcf
from hoof_env.leg.presets import DEFAULT_PRESET

DT = 2e-4
LOOP_STEPS = 10
"""Time constant of the loops over the time step [-]."""

FEET = ("toe", "heel")
PLANE = [0, 2]
"""Axes of the motion in MuJoCo's world."""

DROP_MASS = 57.6
DROP_SPEED = 1.0
"""Mass [kg] and speed [m/s] of the ball that measures the restitution of MuJoCo's contact."""

DAMPINGS = (0.0, 13.7, 60.0)
"""Damping of MuJoCo's contact [1/s]; the second as in `benchmarks.mujoco_transfer`, and with the third
a ball returns as much of its speed as under the paper's inelastic ground."""


class DrivenLeg:
    """Leg on a trunk in MuJoCo whose crank and swing move as a gait prescribes.

    Args:
        gait: the gait.
        trunk: trunk, at its height and at rest.
        ground: force on toe and heel.
        theta: crank angle at the start [rad].
    """

    def __init__(self, gait: GaitParameters, trunk: Trunk, ground: Ground, theta: float) -> None:
        self._gait = gait
        swing, spin = self._swing(theta)
        leg = PlacedLeg(LEG, theta, swing, armature=FLYWHEEL)
        options = Options(timestep=DT, option=TRUTH_OPTION, loop_seconds=LOOP_STEPS * DT)
        text = write_mjcf([leg], trunk, (0.0, trunk.height), options)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.model.body_invweight0[:] *= 1e-4  # see `benchmarks.mujoco_legs`
        self.model.dof_invweight0[:] *= 1e-4
        names = {self.model.joint(k).name: k for k in range(self.model.njnt)}
        self._crank, self._hip = names[CRANK_LINK], names["swing"]
        # The swing is driven as the crank is, and not by its servo
        self.model.actuator_gainprm[:] = 0.0
        self.model.actuator_biasprm[:] = 0.0
        self.model.dof_armature[self._hip] = FLYWHEEL
        self.data = mujoco.MjData(self.model)
        self._feet = [self.model.geom(name).id for name in FEET]
        self._ground = GroundForces(ground, 1)
        self.loads = [0.0, 0.0]
        self._set_speeds(names, theta, swing, spin)

    def _swing(self, theta: float) -> tuple[float, float]:
        """Return the swing at a crank angle and its rate."""
        gait = self._gait
        s, c = np.sin(theta), np.cos(theta)
        angle = gait.swing_offset + gait.swing_sin * s + gait.swing_cos * c
        return float(angle), float((gait.swing_sin * c - gait.swing_cos * s) * gait.crank_speed)

    def _set_speeds(self, names: dict[str, int], theta: float, swing: float, spin: float) -> None:
        rate = self._gait.crank_speed
        at = pose(LEG, theta, theta_rate=rate, frame=FrameMotion(phi=swing, phi_rate=spin))
        tree = link_tree(LEG.mechanism)
        absolute: dict[str, float] = {}
        for link, carrier, _ in tree.tree:
            absolute[link] = at.angular_velocities[tree.links[link][0]]
            parent = absolute.get(carrier, LEG.travel * spin)
            self.data.qvel[names[link]] = rate if link == CRANK_LINK else absolute[link] - parent
        self.data.qvel[self._hip] = spin

    def run(self, seconds: float) -> float:
        """Advance; return the highest force of the ground [N]."""
        highest = 0.0
        mujoco.set_mjcb_passive(lambda model, data: self._push(commit=False))
        try:
            for _ in range(round(seconds / DT)):
                mujoco.mj_forward(self.model, self.data)
                self._push(commit=True)
                highest = max(highest, sum(self.loads))
                mujoco.mj_step(self.model, self.data)
        finally:
            mujoco.set_mjcb_passive(None)
        return highest

    def _push(self, commit: bool) -> None:
        """Add the forces of drive and ground to those that act at the present state."""
        data = self.data
        theta = data.qpos[self._crank]
        gait = self._gait
        turning = -(gait.crank_speed**2) * (gait.swing_sin * np.sin(theta) + gait.swing_cos * np.cos(theta))
        data.qfrc_passive[self._hip] += FLYWHEEL * turning
        spatial = np.zeros(6)
        for k, geom in enumerate(self._feet):
            mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, spatial, 0)
            place = complex(*data.geom_xpos[geom][PLANE])
            force = self._ground(0, k, data.time, place, complex(spatial[3], spatial[5]), commit)
            if commit:
                self.loads[k] = force.imag
            elif force:
                body = self.model.geom_bodyid[geom]
                push = np.array([force.real, 0.0, force.imag])
                at = data.geom_xpos[geom]
                mujoco.mj_applyFT(self.model, data, push, np.zeros(3), at, body, data.qfrc_passive)


def landing(gait: str, trunk: Trunk, ground: Ground) -> float:
    """Return the highest force of one landing [N], as `benchmarks.elasticity_runs.landing`."""
    touch = touch_down(gait)
    leg = DrivenLeg(load_gait(gait, DEFAULT_PRESET), trunk, ground, touch.crank)
    return leg.run(touch.seconds)


def own_restitution(damping: float) -> float:
    """Return what MuJoCo's contact returns of the speed of a ball that falls without weight [-]."""
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><option timestep="1e-3" integrator="implicitfast" gravity="0 0 0"/><worldbody>
        <geom name="floor" type="plane" size="0 0 1"/>
        <body pos="0 0 {RADIUS + 1e-3}"><joint type="slide" axis="0 0 1"/>
        <geom name="ball" size="{RADIUS}" mass="{DROP_MASS}"/></body></worldbody></mujoco>""")
    for geom in range(model.ngeom):
        model.geom_solref[geom] = -CONTACT[0], -damping
        model.geom_solimp[geom] = CONTACT[2], HARDEST, DEEP, 0.5, 1.0
    data = mujoco.MjData(model)
    data.qvel[0] = -DROP_SPEED
    for _ in range(2000):
        mujoco.mj_step(model, data)
    return max(float(data.qvel[0]), 0.0) / DROP_SPEED


def own_contact(env: Any, policy: Any, damping: float, episodes: int) -> float:
    """Return the mean stance peak [N] of episodes of HorseLeg-v0 with MuJoCo's contact and this damping."""
    contact = (CONTACT[0], damping, CONTACT[2])
    found = [play_there(env, policy, seed, contact) for seed in SEEDS[:episodes]]
    return float(np.mean([one.peak for one in found]))
