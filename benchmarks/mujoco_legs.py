"""Legs on a trunk in MuJoCo: for speed with its own contact, for truth with forces from outside.

The models are those that `hoof_env.leg.mjcf` writes, with legs whose frames are parts of the trunk. The
paper's leg is 14 bodies. With both triangles and the shank welded it has 9 hinges and 4 `connect`
constraints, which MuJoCo takes more kindly than 14 hinges, 6 of them and a lock (`common.RIGID` and
`common.ALL`).

For speed the time constant of the loops is two steps, and they gape by some 1e-5 m.

For truth a step is one of RK4, the time constant is ten steps, and what MuJoCo scales the softness of a
constraint with (`body_invweight0`) is a ten-thousandth of its own. With two steps, the first stage of RK4
sees accelerations 0.3 % short however small the step; with ten, 4e-6, and the loops gape by 1e-10 m. Releases
before 3.8 leave out how the loops' directions turn, and are 7 % wrong.

MuJoCo's z is this project's y, so a turn from x to y is one about -y there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import RIGID, Outside, Record, Start, corners
from hoof_env.dynamics.parts import Limb, Motor, Trunk
from hoof_env.ground.contact import Ground
from hoof_env.leg.link_tree import CRANK_LINK, LinkTree
from hoof_env.leg.mechanism import FRAME_NAME
from hoof_env.leg.mjcf import SLIDES, Options, PlacedLeg, write_mjcf
from hoof_env.leg.profile import cross

PLANE = [0, 2]
"""Axes of MuJoCo's world in which legs move."""

FLYWHEEL = 1e9
"""Inertia that keeps a prescribed crank at its speed [kg m^2]: it is 1e10 times the leg's."""

SPEED_OPTION = (
    ("solver", "Newton"),
    ("jacobian", "dense"),
    ("integrator", "Euler"),
    ("iterations", "5"),
    ("tolerance", "1e-8"),
)
"""Options of the fastest solver that holds the loops. One Newton iteration loses the horse, and so do 50 of
CG; PGS is slower, a sparse Jacobian is, too, but for 14 hinges a leg on four legs, implicitfast by 3 %,
elliptic cones by 20 % on four legs, and islands, which are off below, by 9 %."""

TRUTH_OPTION = (
    ("solver", "Newton"),
    ("jacobian", "dense"),
    ("integrator", "RK4"),
    ("iterations", "50"),
    ("tolerance", "0"),
)
"""Options of the most exact solver."""


def build_model(
    limbs: Sequence[Limb],
    trunk: Trunk,
    start: Start,
    dt: float = 1e-3,
    contact: bool = False,
    assembly: LinkTree = RIGID,
    loop_seconds: float | None = None,
) -> mujoco.MjModel:
    """Build a horse in MuJoCo in the pose of `start`.

    Args:
        limbs, trunk: the horse. A prescribed crank is a flywheel that keeps its speed.
        start: its first pose.
        dt: time step [s].
        contact: add MuJoCo's own contact, of balls at toe and heel with the ground at y = 0.
        assembly: links of each leg.
        loop_seconds: time constant of the loops [s]; see the module's docstring.

    Raises:
        ValueError: the start asks for a swing that moves.
    """
    if start.swings:
        raise ValueError("MuJoCo's legs keep their swing: expected swing_sin and swing_cos of 0")
    legs = [
        PlacedLeg(
            limb.geometry,
            start.crank[i],
            start.swing[i],
            limb.hip,
            motor=limb.drive if isinstance(limb.drive, Motor) else None,
            armature=0.0 if isinstance(limb.drive, Motor) else FLYWHEEL,
            label=f" {i}",
            tree=assembly,
        )
        for i, limb in enumerate(limbs)
    ]
    options = Options(
        timestep=dt,
        option=SPEED_OPTION if contact else TRUTH_OPTION,
        loop_seconds=loop_seconds or (2 if contact else 10) * dt,
        floor=Ground().friction if contact else None,
        swings=False,
    )
    model = mujoco.MjModel.from_xml_string(write_mjcf(legs, trunk, start.position, options))
    if not contact:
        # Softness of the constraints scales with these weights; see the module's docstring
        model.body_invweight0[:] *= 1e-4
        model.dof_invweight0[:] *= 1e-4
    return model


class MujocoLegs:
    """Horse of `build_model` with its state, drives and forces from outside.

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
        assembly: LinkTree = RIGID,
        **build: Any,
    ) -> None:
        self.assembly = assembly
        self.limbs = tuple(limbs)
        self.trunk = trunk
        self.start = start
        self.outside = outside
        self.model = build_model(limbs, trunk, start, dt, assembly=assembly, **build)
        self.data = mujoco.MjData(self.model)
        joints = {self.model.joint(k).name: k for k in range(self.model.njnt)}
        self._cranks = [joints[f"{CRANK_LINK} {i}"] for i in range(len(limbs))]
        self._slides = [joints[name] for name in SLIDES[trunk.kind]]
        self._bodies = [
            {link: self.model.body(f"{link} {i}").id for link in assembly.links} for i in range(len(limbs))
        ]
        poses = start.poses(limbs)
        mechanism = limbs[0].geometry.mechanism
        foot = mechanism.body_of_foot(mechanism.feet[0])
        self._hoof = next(link for link, bodies in assembly.links.items() if foot in bodies)
        self._ankle = assembly.carrier[self._hoof][1]
        self._arms = [  # vectors of toe and heel from the hoof's pin, in the hoof's axes
            [pose.point(name) - pose.point(self._ankle) for name in corners(limb)]
            for pose, limb in zip(poses, limbs, strict=True)
        ]
        for i, pose in enumerate(poses):
            # MuJoCo's joints turn relative to the carrier
            spin = {FRAME_NAME: 0.0}
            for link, parent, _ in assembly.tree:
                spin[link] = pose.angular_velocities[assembly.links[link][0]]
                rate = start.crank_speed[i] if link == CRANK_LINK else spin[link] - spin[parent]
                self.data.qvel[joints[f"{link} {i}"]] = rate
        self._motors = [i for i, limb in enumerate(self.limbs) if isinstance(limb.drive, Motor)]
        self.data.ctrl[:] = [start.crank_speed[i] for i in self._motors]
        self.evaluate()

    def step(self, steps: int = 1) -> None:
        """Advance by whole steps; the read-outs are then of the new instant."""
        if self.outside is None:
            mujoco.mj_step(self.model, self.data, steps)
            self.evaluate()
            return
        for _ in range(steps):
            self._load(commit=True)
            self._guarded(mujoco.mj_step)
            self.evaluate()

    def run(self, duration: float, samples: int) -> Record:
        """Advance by `duration` [s] and look `samples` times after the beginning, evenly."""
        steps = round(duration / self.model.opt.timestep / samples)
        rows = [self.look()]
        for _ in range(samples):
            self.step(steps)
            rows.append(self.look())
        return Record.of(rows)

    def look(self) -> tuple[Any, ...]:
        """Return the row of `Record` at the present instant."""
        return (
            self.data.time,
            self.crank,
            self.crank_speed,
            self.body,
            self.crank_torque,
            self.hip_torque,
            self.pins(),
            self.closure(),
        )

    def evaluate(self) -> None:
        """Evaluate accelerations and forces at the present state."""
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
        """Apply the forces from outside to the hooves, at their centres of mass."""
        assert self.outside is not None
        for i, bodies in enumerate(self._bodies):
            hoof = bodies[self._hoof]
            turn = self._turn(hoof)
            spatial = np.zeros(6)
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, hoof, spatial, 0)
            spin = -spatial[1]
            velocity = complex(spatial[3], spatial[5])
            centre = complex(*self.data.xipos[hoof][PLANE])
            total = 0j
            moment = 0.0
            for point, arm in enumerate(self._arms[i]):
                lever = turn * complex(*arm)
                at = complex(*self.data.xpos[hoof][PLANE]) + lever
                force = self.outside(i, point, self.data.time, at, velocity + 1j * spin * lever, commit)
                total += force
                # MuJoCo applies forces at the centre of mass
                moment += ((at - centre).conjugate() * force).imag
            self.data.xfrc_applied[hoof, [0, 2, 4]] = total.real, total.imag, -moment

    @property
    def crank(self) -> NDArray[np.float64]:
        """Crank angles [rad]."""
        return np.array(self.data.qpos[self._cranks])

    @property
    def crank_speed(self) -> NDArray[np.float64]:
        """Speed of each crank [rad/s]."""
        return np.array(self.data.qvel[self._cranks])

    @property
    def body(self) -> NDArray[np.float64]:
        """x, y and pitch of the trunk [m, m, rad] and their rates, shape (6,)."""
        pose = np.array([*self.start.position, 0, 0, 0, 0])
        index = [SLIDES["free"].index(name) for name in SLIDES[self.trunk.kind]]
        pose[index] = self.data.qpos[self._slides]
        pose[[3 + k for k in index]] = self.data.qvel[self._slides]
        return pose

    @property
    def crank_torque(self) -> NDArray[np.float64]:
        """Torques of the drives [N m], along theta."""
        # A flywheel keeps its speed: what slows it is the torque of the drive
        torque = -FLYWHEEL * self.data.qacc[self._cranks]
        torque[self._motors] = self.data.actuator_force
        return torque

    @property
    def hip_torque(self) -> NDArray[np.float64]:
        """Torques that hold each leg's frame about O [N m], along phi, against its pins, drive and rotor."""
        torque = -self.crank_torque
        pins = self.pins()
        spin = self.data.qacc[self._cranks]
        pitch = self.data.qacc[self._slides[2]] if self.trunk.kind == "free" else 0.0
        for i, limb in enumerate(self.limbs):
            sigma = limb.geometry.travel
            turn = np.exp(1j * (self.body[2] + sigma * self.start.swing[i]))
            for name, place in limb.geometry.fixed.items():
                arm = complex(sigma * place.real, place.imag) * turn
                force = pins[i][[point == name for point, _, _ in self.assembly.pins]].sum(axis=0)
                torque[i] += sigma * cross(arm, complex(*force))
            if isinstance(limb.drive, Motor):
                n = limb.drive.gear_ratio
                torque[i] += limb.drive.rotor_inertia * (n - 1) * (n * spin[i] - sigma * pitch)
        return torque

    def pins(self) -> NDArray[np.float64]:
        """Return the forces at the pins [N], shape (legs, pins, 2), in the order of `assembly.pins`."""
        pins = self.assembly.pins
        loops = self.assembly.loops
        carrier = self.assembly.carrier
        forces = np.empty((len(self.limbs), len(pins), 2))
        ties = np.asarray(self.data.efc_force[: 3 * len(loops) * len(self.limbs)])
        ties = ties.reshape(len(self.limbs), len(loops), 3)[..., PLANE]
        for i, bodies in enumerate(self._bodies):
            for k, (point, one, two) in enumerate(pins):
                # Loops are constraints, all other pins joints between bodies, whose force is that on the
                # child
                if (point, one, two) in loops:
                    forces[i, k] = ties[i, loops.index((point, one, two))]
                elif carrier[one] == (two, point):
                    forces[i, k] = self.data.cfrc_int[bodies[one]][3:][PLANE]
                else:
                    forces[i, k] = -self.data.cfrc_int[bodies[two]][3:][PLANE]
        return forces

    def points(self, leg: int) -> dict[str, complex]:
        """Return the places of the pins that begin a link, and of toe and heel [m]."""
        bodies = self._bodies[leg]
        at = {point: complex(*self.data.xpos[bodies[link]][PLANE]) for link, _, point in self.assembly.tree}
        turn = self._turn(bodies[self._hoof])
        for name, arm in zip(corners(self.limbs[leg]), self._arms[leg], strict=True):
            at[name] = at[self._ankle] + turn * complex(*arm)
        return at

    def _turn(self, body: int) -> complex:
        """Return the direction of a body's x axis."""
        return complex(*self.data.xmat[body][[0, 6]])

    def closure(self) -> float:
        """Return the widest gap of a loop [m]."""
        gaps = np.asarray(self.data.efc_pos[: 3 * len(self.assembly.loops) * len(self.limbs)]).reshape(-1, 3)
        return float(np.linalg.norm(gaps, axis=1).max())
