"""Legs on a trunk in MuJoCo: state, drives, forces from outside and read-outs of a `mujoco_model`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import RIGID, Assembly, Outside, Record, Start, corners
from benchmarks.mujoco_model import FLYWHEEL, SLIDES, build_model
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.limb import Limb
from hoof_env.dynamics.trunk import GRAVITY, Trunk
from hoof_env.leg.kinematics import cross

__all__ = ["MujocoLegs", "build_model"]


class MujocoLegs:
    """A horse of `build_model` with its state, drives and forces from outside.

    Args:
        limbs, trunk, start, dt: as in `build_model`, which takes `build`, too.
        outside: forces at toe and heel, taken at every stage of a step; none if None.
    """

    def __init__(
        self,
        limbs: Sequence[Limb],
        trunk: Trunk,
        start: Start,
        dt: float = 1e-3,
        outside: Outside | None = None,
        assembly: Assembly = RIGID,
        **build: Any,
    ) -> None:
        self.assembly = assembly
        self.limbs, self.trunk, self.start, self.outside = tuple(limbs), trunk, start, outside
        self.model = build_model(limbs, trunk, start, dt, assembly=assembly, **build)
        self.data = mujoco.MjData(self.model)
        joints = {self.model.joint(k).name: k for k in range(self.model.njnt)}
        self._cranks = [joints[f"crank {i}"] for i in range(len(limbs))]
        self._slides = [joints[name] for name in SLIDES[trunk.kind]]
        self._bodies = [
            {link: self.model.body(f"{link} {i}").id for link in assembly.links} for i in range(len(limbs))
        ]
        poses = start.poses(limbs)
        self._arms = [  # of toe and heel from the ankle, in the hoof's axes
            [pose.point(name) - pose.point("G") for name in corners(limb)]
            for pose, limb in zip(poses, limbs, strict=True)
        ]
        rates = dict(zip(SLIDES["free"], (*start.velocity, start.pitch_rate), strict=True))
        self.data.qvel[self._slides] = [rates[name] for name in SLIDES[trunk.kind]]
        for i, pose in enumerate(poses):
            spin = {"frame": start.pitch_rate if trunk.kind == "free" else 0.0}
            for link, parent, _ in assembly.tree:
                spin[link] = pose.angular_velocities[assembly.links[link][0]]
                rate = start.crank_speed[i] if link == "crank" else spin[link] - spin[parent]
                self.data.qvel[joints[f"{link} {i}"]] = rate
        if trunk.kind == "suspended":  # the rest of the animal carries its part of the weight
            total = trunk.mass + sum(limb.geometry.mass for limb in limbs)
            self.data.xfrc_applied[self.model.body("trunk").id, 1] = (1 - trunk.share) * total * GRAVITY
        self.command(start.crank_speed)
        self.evaluate()

    def command(self, speeds: Sequence[float]) -> None:
        """Set the speeds [rad/s] that the motors are to keep."""
        motors = [i for i, limb in enumerate(self.limbs) if isinstance(limb.drive, Motor)]
        self.data.ctrl[:] = [speeds[i] for i in motors]

    def step(self, steps: int = 1) -> None:
        """Advance by whole steps; the read-outs are then those of the new instant."""
        if self.outside is None:
            mujoco.mj_step(self.model, self.data, steps)
            self.evaluate()
            return
        for _ in range(steps):
            self._load(commit=True)
            self._guarded(mujoco.mj_step)
            self.evaluate()

    def run(self, duration: float, samples: int) -> Record:
        """Advance by `duration` [s] and look `samples` times besides the beginning, evenly."""
        steps = round(duration / self.model.opt.timestep / samples)
        rows = [self.look()]
        for _ in range(samples):
            self.step(steps)
            rows.append(self.look())
        return Record.of(rows)

    def look(self) -> tuple[Any, ...]:
        """What `Record` has of the present instant."""
        return (
            self.data.time, self.crank, self.crank_speed, self.body, self.crank_torque, self.hip_torque,
            self.pins(), self.closure(),
        )  # fmt: skip

    def evaluate(self) -> None:
        """Accelerations and forces at the present state."""
        self._guarded(mujoco.mj_forward)
        mujoco.mj_rnePostConstraint(self.model, self.data)

    def _guarded(self, function: Any) -> None:
        """Call MuJoCo with the forces from outside evaluated wherever it evaluates forces."""
        if self.outside is None:
            function(self.model, self.data)
            return
        mujoco.set_mjcb_passive(lambda model, data: self._load(commit=False))
        try:
            function(self.model, self.data)
        finally:
            mujoco.set_mjcb_passive(None)

    def _load(self, commit: bool) -> None:
        assert self.outside is not None
        for i, bodies in enumerate(self._bodies):
            hoof = bodies["hoof"]
            turn = self.data.xmat[hoof].reshape(3, 3)
            spatial = np.zeros(6)
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, hoof, spatial, 0)
            spin, velocity = spatial[2], complex(spatial[3], spatial[4])
            centre = complex(*self.data.xipos[hoof][:2])
            total, moment = 0j, 0.0
            for point, arm in enumerate(self._arms[i]):
                out = turn[:2, :2] @ arm
                lever = complex(*out)
                at = complex(*self.data.xpos[hoof][:2]) + lever
                force = self.outside(i, point, self.data.time, at, velocity + 1j * spin * lever, commit)
                total += force
                moment += ((at - centre).conjugate() * force).imag
            self.data.xfrc_applied[hoof, [0, 1, 5]] = total.real, total.imag, moment

    @property
    def crank(self) -> NDArray[np.float64]:
        """Crank angles [rad]."""
        return np.array(self.start.crank) + self.data.qpos[self._cranks]

    @property
    def crank_speed(self) -> NDArray[np.float64]:
        """Of each crank [rad/s]."""
        return np.array(self.data.qvel[self._cranks])

    @property
    def body(self) -> NDArray[np.float64]:
        """x, y and pitch of the trunk [m, m, rad] and their rates, shape (6,)."""
        pose = np.array([*self.start.position, self.start.pitch, 0, 0, 0])
        index = [SLIDES["free"].index(name) for name in SLIDES[self.trunk.kind]]
        pose[index] += self.data.qpos[self._slides]
        pose[[3 + k for k in index]] = self.data.qvel[self._slides]
        return pose

    @property
    def crank_torque(self) -> NDArray[np.float64]:
        """What the drives give [N m], along theta."""
        torque = -FLYWHEEL * self.data.qacc[self._cranks]
        motors = [i for i, limb in enumerate(self.limbs) if isinstance(limb.drive, Motor)]
        torque[motors] = self.data.actuator_force
        return torque

    @property
    def hip_torque(self) -> NDArray[np.float64]:
        """What holds each leg's frame about O [N m], along phi, against its pins, drive and rotor."""
        torque, pins, spin = -self.crank_torque, self.pins(), self.data.qacc[self._cranks]
        pitch = self.data.qacc[self._slides[2]] if self.trunk.kind == "free" else 0.0
        for i, limb in enumerate(self.limbs):
            sigma, (x, y) = limb.geometry.travel, limb.geometry.pivot
            c = complex(sigma * x, y) * np.exp(1j * (self.body[2] + sigma * self.start.swing[i]))
            at_c = pins[i][[point == "C" for point, _, _ in self.assembly.pins]].sum(axis=0)
            torque[i] += sigma * cross(c, complex(*at_c))
            if isinstance(limb.drive, Motor):
                n = limb.drive.gear_ratio
                torque[i] += limb.drive.rotor_inertia * (n - 1) * (n * spin[i] - sigma * pitch)
        return torque

    def pins(self) -> NDArray[np.float64]:
        """Forces at the pins [N], shape (legs, pins, 2), in the order of `assembly.pins`."""
        pins, loops, carrier = self.assembly.pins, self.assembly.loops, self.assembly.carrier
        forces = np.empty((len(self.limbs), len(pins), 2))
        ties = np.asarray(self.data.efc_force[: 3 * len(loops) * len(self.limbs)])
        ties = ties.reshape(len(self.limbs), len(loops), 3)[..., :2]
        for i, bodies in enumerate(self._bodies):
            for k, (point, one, two) in enumerate(pins):
                if (point, one, two) in loops:
                    forces[i, k] = ties[i, loops.index((point, one, two))]
                elif carrier[one] == (two, point):
                    forces[i, k] = self.data.cfrc_int[bodies[one]][3:5]
                else:
                    forces[i, k] = -self.data.cfrc_int[bodies[two]][3:5]
        return forces

    def points(self, leg: int) -> dict[str, complex]:
        """Where the pins that begin a link are, and the toe and the heel [m]."""
        bodies = self._bodies[leg]
        at = {point: complex(*self.data.xpos[bodies[link]][:2]) for link, _, point in self.assembly.tree}
        turn = complex(*self.data.xmat[bodies["hoof"]][[0, 3]])
        for name, arm in zip(corners(self.limbs[leg]), self._arms[leg], strict=True):
            at[name] = at["G"] + turn * complex(*arm)
        return at

    def closure(self) -> float:
        """The widest gap of a loop [m]."""
        gaps = np.asarray(self.data.efc_pos[: 3 * len(self.assembly.loops) * len(self.limbs)]).reshape(-1, 3)
        return float(np.linalg.norm(gaps, axis=1).max())
