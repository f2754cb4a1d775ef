"""Episode of HorseLeg-v0 in MuJoCo, on the model that `Geometry.to_mjcf` exports, which
`benchmarks.mujoco_transfer` plays.

Crank and swing are MuJoCo's servos, whose commands pass the filters of `hoof_env.gait`. Friction is the
exported coefficient. Observation and reward are computed here from MuJoCo's own motion and forces, by the
rules of docs/task.md, substep by substep.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.observables import StanceCounter
from hoof_env.dynamics.parts import Motor
from hoof_env.gait import INNER, PARAMETERS
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.link_tree import CRANK_LINK, link_tree
from hoof_env.leg.mjcf import SWING_DAMPING, SWING_STIFFNESS
from hoof_env.tasks.observation import HALF_RANGE, MIDDLE
from hoof_env.tasks.reward import BEARING, MAX_STRIDE, STEPPING

Floats = NDArray[np.float64]

HARDEST = 0.9
DEEP = 0.5
"""Impedance of the contact at a depth [-], and that depth [m]: it grows in proportion, so that the force does
not jump at a touch-down, as under Eq. 14."""

GRIP = 100.0
"""Impedance of friction over the impedance of the normal force [-]."""

SERVO = Motor(speed_gain=5e3, torque_limit=1e5, rotor_inertia=0.01)
"""Servo of the crank: a prescribed crank follows its command within torque over gain, here 0.06 rad/s."""

FEET = ("toe", "heel")


@dataclass
class Foot:
    """A foot in an episode.

    Attributes:
        geom: number of its ball.
        x: place along the ground [m].
        normal, slide: normal force [N] and speed along the ground [m/s].
        approach: speed at the last touch-down [m/s], 0 outside the ground.
        height: clearance of the ball [m].
    """

    geom: int
    x: float = 0.0
    normal: float = 0.0
    friction: float = 0.0
    slide: float = 0.0
    approach: float = 0.0
    height: float = 0.0


@dataclass
class Sums:
    """Sums of a control step, see `dynamics.layout.StrideSums`."""

    running_peak: float = 0.0
    loading: float = 0.0
    impulse: float = 0.0
    work: float = 0.0
    slip: float = 0.0


class MujocoEpisode:
    """Episode of HorseLeg-v0 in MuJoCo, from the start that the environment draws.

    Args:
        env: environment, after a reset.
        contact: stiffness [1/s^2], damping [1/s] and impedance at the surface [-] of MuJoCo's contact.
    """

    def __init__(self, env: Any, contact: Sequence[float]) -> None:
        leg = env.unwrapped
        engine = leg.engine
        self.env = leg
        self.trunk = engine.trunk
        geometry = engine.limbs[0].geometry
        self.geometry = geometry
        state = {name: float(value.ravel()[0]) for name, value in engine.state.items()}
        report = {name: float(value.ravel()[0]) for name, value in engine.report.items()}
        self.gait = np.array([state[name] for name in PARAMETERS])
        self.gait_rate = np.zeros(4)
        self.filters = engine.filters.to_array()
        self.reach = leg.body.reach(engine, leg.dt)
        constants = leg.body.constants(engine, leg.dt)
        self.lead = float(constants["lead"])
        self.failure_heights = float(constants["lowest"]), float(constants["highest"])
        theta = state["crank_angle"]
        text = geometry.to_mjcf(
            theta=theta, swing=report["swing_angle"], trunk=self.trunk, motor=SERVO, ground=engine.ground
        )
        self.model = mujoco.MjModel.from_xml_string(text)
        # A soft contact would creep along the ground: friction is stiffer than the normal force
        self.model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        self.model.opt.impratio = GRIP
        self.data = mujoco.MjData(self.model)
        self.h = float(self.model.opt.timestep)
        names = {self.model.joint(k).name: k for k in range(self.model.njnt)}
        self.x, self.z, self.crank, self.swing = (names[name] for name in ("x", "z", CRANK_LINK, "swing"))
        self.feet = [Foot(self.model.geom(name).id) for name in FEET]
        for geom in (self.model.geom("floor").id, *(foot.geom for foot in self.feet)):
            # Negative numbers are stiffness and damping themselves; the impedance grows with depth
            self.model.geom_solref[geom] = -contact[0], -contact[1]
            self.model.geom_solimp[geom] = contact[2], HARDEST, DEEP, 0.5, 1.0
        self.data.qpos[[self.x, self.z]] = report["x"], report["y"]
        self._set_speeds(geometry, names, theta, state, report)
        self.weight = GRAVITY * (self.trunk.mass + geometry.mass)
        self.stance = StanceCounter(LIFT_OFF * self.weight)
        self.allowance = BEARING * MAX_STRIDE
        self.time = 0.0
        self.peaks = 0.0
        mujoco.mj_forward(self.model, self.data)
        for foot in self.feet:
            foot.x, _, foot.height = self.data.geom_xpos[foot.geom]

    def _set_speeds(
        self, geometry: Any, names: dict[str, int], theta: float, state: dict[str, float], report: Any
    ) -> None:
        """Set the speeds of all joints at the start."""
        rate = state["crank_angle_rate"]
        spin = report["swing_angle_rate"]
        frame = FrameMotion(phi=report["swing_angle"], phi_rate=spin)
        at = pose(geometry, theta, theta_rate=rate, frame=frame)
        tree = link_tree(geometry.mechanism)
        travel = geometry.travel
        absolute: dict[str, float] = {}
        for link, carrier, _ in tree.tree:
            absolute[link] = at.angular_velocities[tree.links[link][0]]
            parent = absolute.get(carrier, travel * spin)
            self.data.qvel[names[link]] = rate if link == CRANK_LINK else absolute[link] - parent
        self.data.qvel[self.swing] = spin
        self.data.qvel[[self.x, self.z]] = report["vx"], report["vy"]

    @property
    def theta(self) -> float:
        """Crank angle [rad]."""
        return float(self.data.qpos[self.crank])

    @property
    def theta_rate(self) -> float:
        """Speed of the crank [rad/s]."""
        return float(self.data.qvel[self.crank])

    def observe(self) -> NDArray[np.float32]:
        """Return the observation, in the order and with the scales of the manual page."""
        c = np.cos(self.theta)
        s = np.sin(self.theta)
        speeds = np.tanh([self.data.qvel[self.x] / 5.0, self.data.qvel[self.z] / 2.0])
        height = np.tanh((self.data.qpos[self.z] - self.trunk.height) / 0.3)
        loads = np.array([foot.normal for foot in self.feet])
        contacts = [float(foot.height < 0.0) for foot in self.feet]
        approach = np.tanh([foot.approach / 2.0 for foot in self.feet])
        weight = self.weight
        values = [
            *(s, c),
            *((self.gait - MIDDLE) / HALF_RANGE),
            *(self.gait_rate / self.filters[:, 1]),
            *(*speeds, height, self.allowance),
            *contacts,
            *np.tanh(loads / (3.0 * weight)),
            *approach,
            np.tanh(self.stance.running / (3.0 * weight)),
            np.tanh(self.stance.steepest / (30.0 * weight)),
        ]
        observation: NDArray[np.float32] = np.clip(np.array(values, np.float32), -1.0, 1.0)
        return observation

    def step(self, action: Any) -> tuple[float, bool]:
        """Play a control step; return its reward and whether the episode has failed."""
        body = self.env.body
        heading = self.gait + self.lead * self.gait_rate
        command = np.clip(heading + self.reach * np.clip(action, -1.0, 1.0), body.low, body.high)
        sums = Sums()
        before = float(self.data.qpos[self.x])
        for _ in range(round(self.env.dt / self.h)):
            self._substep(command, sums)
        self.time += self.env.dt
        progress = float(self.data.qpos[self.x]) - before
        height = float(self.data.qpos[self.z])
        lowest, highest = self.failure_heights
        failed = not lowest < height < highest
        return self._reward(progress, sums, failed), failed

    def _substep(self, command: Floats, sums: Sums) -> None:
        """Advance by one step of MuJoCo and add what happened to the sums."""
        gain, most, fastest = self.filters.T
        wanted = np.clip(gain * (command - self.gait), -most, most)
        acceleration = np.clip(INNER * gain * (wanted - self.gait_rate), -fastest, fastest)
        self.gait = self.gait + self.h * self.gait_rate + 0.5 * self.h**2 * acceleration
        self.gait_rate = self.gait_rate + self.h * acceleration
        s = np.sin(self.theta)
        c = np.cos(self.theta)
        angle = self.gait[1] + self.gait[2] * s + self.gait[3] * c
        rate = self.gait_rate[1] + self.gait_rate[2] * s + self.gait_rate[3] * c
        rate += self.theta_rate * (self.gait[2] * c - self.gait[3] * s)
        # The exported servo damps the swing itself: ahead by as much, it follows a swing that moves
        self.data.actuator("swing").ctrl = angle + SWING_DAMPING / SWING_STIFFNESS * rate
        self.data.actuator(CRANK_LINK).ctrl = self.gait[0]
        mujoco.mj_step(self.model, self.data)
        self._read_feet()
        self._count(sums)

    def _read_feet(self) -> None:
        """Read forces and speeds of the feet."""
        for foot in self.feet:
            x, _, z = self.data.geom_xpos[foot.geom]
            speed = (foot.height - z) / self.h
            foot.slide = (x - foot.x) / self.h
            if z >= 0.0:
                foot.approach = 0.0
            elif foot.height >= 0.0:
                foot.approach = max(speed, self.env.engine.ground.approach_floor)
            foot.x, foot.height = float(x), float(z)
            foot.normal = foot.friction = 0.0
        force = np.zeros(6)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            mujoco.mj_contactForce(self.model, self.data, k, force)
            for foot in self.feet:
                if foot.geom in (contact.geom1, contact.geom2):
                    foot.normal += force[0]
                    foot.friction += float(np.hypot(force[1], force[2]))

    def _count(self, sums: Sums) -> None:
        """Add a substep to the sums, as `dynamics.observables.count_stride` does."""
        h = self.h
        load = sum(foot.normal for foot in self.feet)
        push = float(np.hypot(load, sum(foot.friction for foot in self.feet)))
        peak, running, loading = self.stance.add(self.theta, load, push, h)
        self.peaks += peak
        sums.running_peak += running
        sums.loading += loading
        sums.impulse += h * load
        torques = {
            self.crank: float(self.data.actuator(CRANK_LINK).force[0]),
            self.swing: float(self.data.actuator("swing").force[0]),
        }
        sums.work += h * sum(max(torque * self.data.qvel[at], 0.0) for at, torque in torques.items())
        if self.stance.is_open:
            rubbed = sum(foot.normal * abs(foot.slide) for foot in self.feet)
            sums.slip += h * rubbed / max(load, 1e-9)

    def _reward(self, progress: float, sums: Sums, failed: bool) -> float:
        """Return the sum of all terms of `hoof_env.tasks.reward`."""
        w = self.env.weights
        dt = self.env.dt
        asked = float(self.env.commanded_speed) * dt
        allowance = min(self.allowance + BEARING * dt, BEARING * MAX_STRIDE)
        impulse = sums.impulse / self.weight
        within = min(impulse, allowance)
        self.allowance = allowance - within
        credited = within - (impulse - within)
        pace = min(float(np.clip(progress / asked, -1.0, 1.0)), self.theta_rate / STEPPING)
        return (
            w["progress"] * min(progress, asked)
            - w["overspeed"] * max(progress - asked, 0.0)
            - 1e-3 * w["peak"] * sums.running_peak
            - 1e-6 * w["loading"] * sums.loading
            - 1e-3 * w["energy"] * sums.work
            - w["slip"] * sums.slip
            + w["support"] * min(pace * credited, abs(pace) * credited)
            - (w["failure"] * (self.env.episode_seconds - self.time) if failed else 0.0)
        )

    def pose_at(self, theta: float) -> Floats:
        """Return the bars with the crank at `theta` [rad], all links in place, and the trunk's coordinates as
        they are."""
        frame = FrameMotion(phi=float(self.data.qpos[self.swing]))
        at = pose(self.geometry, theta, frame=frame)
        tree = link_tree(self.geometry.mechanism)
        hip = np.array([self.data.qpos[self.x], self.data.qpos[self.z]])
        joints = [body for bodies in tree.links.values() for body in bodies]
        ends = [
            (self.geometry.mechanism.bodies[k].tail, self.geometry.mechanism.bodies[k].head) for k in joints
        ]
        return np.array([[hip + at.point(one), hip + at.point(other)] for one, other in ends])

    def bars(self) -> Floats:
        """Return the ends of all bars and the places of the feet in the plane, shape (n, 2, 2)."""
        lines = []
        for k in range(self.model.ngeom):
            if self.model.geom_type[k] == mujoco.mjtGeom.mjGEOM_CAPSULE:
                axis = self.data.geom_xmat[k].reshape(3, 3)[[0, 2], 2] * self.model.geom_size[k, 1]
                middle = self.data.geom_xpos[k][[0, 2]]
                lines.append([middle - axis, middle + axis])
        return np.array(lines)
