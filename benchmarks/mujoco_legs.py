"""Legs on a trunk in MuJoCo: for speed with its own contact, for truth with forces from outside.

Each leg is 14 bodies. With both triangles and the shank welded it has 9 hinges and 4 `connect` constraints,
which MuJoCo takes more kindly than 14 hinges, 6 of them and a lock (`common.RIGID` and `common.ALL`).

MuJoCo's constraints are springs. With the default solref (0.02 s) and solimp (0.9 to 0.95) a loop can be
pulled through a dead point into another assembly. For speed the time constant is two steps, the stiffest
that MuJoCo lets stand, and the impedance 0.9999, its largest: loops gape by some 1e-5 m.

For truth a step is one of RK4, the time constant is ten steps, and what MuJoCo scales the softness of a
constraint with (`body_invweight0`) is a ten-thousandth of its own. With two steps, the first stage of RK4
sees accelerations 0.3 % short however small the step; with ten, 4e-6, and the loops gape by 1e-10 m. Releases
before 3.8 leave out how the loops' directions turn, and are 7 % wrong.

MuJoCo's axes are this project's: x forward, y up, hinges about z. Hinges turn counter-clockwise but for the
crank's, whose angle is theta's change since the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import ALL, LOCKED, RIGID, Assembly, Outside, Record, Start, corners
from hoof_env.dynamics.parts import GRAVITY, Limb, Motor, Trunk
from hoof_env.leg.kinematics import Pose
from hoof_env.leg.profile import cross

FLYWHEEL = 1e9
"""Inertia that keeps a prescribed crank at its speed [kg m^2]: it is 1e10 times the leg's."""

RADIUS = 0.01
"""Radius of the balls at toe and heel [m]; the floor lies a radius deeper, so a ball touches when its point
does."""

SLIDES = {"fixed": (), "rail": ("x",), "suspended": ("x", "y"), "free": ("x", "y", "pitch")}

_SPEED = 'solver="Newton" jacobian="dense" integrator="Euler" iterations="5" tolerance="1e-8"'
"""Options of the fastest solver that holds the loops. One Newton iteration loses the horse, and so do 50 of
CG; PGS is slower, a sparse Jacobian is, too, but for 14 hinges a leg on four legs, implicitfast by 3 %,
elliptic cones by 20 % on four legs, and islands, which are off below, by 9 %."""

_TRUTH = 'solver="Newton" jacobian="dense" integrator="RK4" iterations="50" tolerance="0"'


def _xyz(z: Any) -> str:
    return f"{z[0]:.17g} {z[1]:.17g} 0"


def _leg(
    assembly: Assembly, limb: Limb, i: int, at: Pose, frame: NDArray[np.float64], contact: bool, rotor: float
) -> str:
    """Return the XML of a leg's bodies, each with the world's axes in the pose `at`; `frame` is the trunk's
    origin."""
    masses = limb.geometry.body_masses
    inertias = limb.geometry.body_inertias

    def body(link: str, parent_at: NDArray[np.float64]) -> str:
        pin = at.point(assembly.carrier[link][1])
        axis, armature = (-limb.geometry.travel, rotor) if link == "crank" else (1, 0.0)
        text = f'<body name="{link} {i}" pos="{_xyz((pin - parent_at).tolist())}">'
        text += f'<joint name="{link} {i}" axis="0 0 {axis}" armature="{armature:.17g}"/>'
        for order, k in enumerate(assembly.links[link]):
            centre = _xyz((at.centres[k] - pin).tolist())
            j = float(inertias[k])
            m = float(masses[k])
            inertial = f'mass="{m:.17g}" diaginertia="{j:.17g} {j:.17g} {j:.17g}"'
            if order == 0:
                text += f'<inertial pos="{centre}" {inertial}/>'
            else:
                text += f'<body pos="{centre}"><inertial pos="0 0 0" {inertial}/></body>'
        if link == "hoof" and contact:
            for name in corners(limb):
                text += f'<geom size="{RADIUS}" pos="{_xyz((at.point(name) - pin).tolist())}"/>'
        children = "".join(body(child, pin) for child, parent, _ in assembly.tree if parent == link)
        return text + children + "</body>\n"

    return "".join(body(link, frame) for link, parent, _ in assembly.tree if parent == "frame")


def build_model(
    limbs: Sequence[Limb],
    trunk: Trunk,
    start: Start,
    dt: float = 1e-3,
    contact: bool = False,
    assembly: Assembly = RIGID,
    solref: tuple[float, float] | None = None,
) -> mujoco.MjModel:
    """Build a horse in MuJoCo with all joints at zero in the pose of `start`.

    Args:
        limbs, trunk: the horse. A prescribed crank is a flywheel that keeps its speed.
        start: its first pose.
        dt: time step [s].
        contact: add MuJoCo's own contact, of balls at toe and heel with the ground at y = 0.
        assembly: bodies that are one link; `RIGID` or `ALL`.
        solref: time constant [s] and damping ratio of the loops; see the module's docstring.

    Raises:
        ValueError: the start asks for a swing that moves.
    """
    if start.swings:
        raise ValueError("MuJoCo's legs keep their swing: expected swing_sin and swing_cos of 0")
    at = start.position
    h = trunk.height - start.position[1]
    solref = solref or ((2 if contact else 10) * dt, 1.0)
    spring = (trunk.damping, trunk.stiffness, h) if trunk.kind == "suspended" else (0.0, 0.0, 0.0)
    slides = "".join(
        f'<joint name="{name}" type="{kind}" axis="{axis}" damping="{c:.17g}"'
        f' stiffness="{k:.17g}" springref="{ref:.17g}"/>'
        for name, kind, axis, (c, k, ref) in (
            ("x", "slide", "1 0 0", (trunk.drag, 0.0, 0.0)),
            ("y", "slide", "0 1 0", spring),
            ("pitch", "hinge", "0 0 1", (0.0, 0.0, 0.0)),
        )
        if name in SLIDES[trunk.kind]
    )
    # A rotor on a trunk that pitches turns with it: an armature of the joint would leave that out.
    pitching = trunk.kind == "free" and not contact
    legs = ""
    loops = ""
    locks = ""
    motors = ""
    rotors = ""
    for i, (limb, pose) in enumerate(zip(limbs, start.poses(limbs), strict=True)):
        drive = limb.drive
        rotor = FLYWHEEL
        if isinstance(drive, Motor):
            rotor = 0.0 if pitching else drive.reflected_inertia
            top = drive.torque_limit
            motors += f'<velocity joint="crank {i}" kv="{drive.speed_gain:.17g}"'
            motors += f' forcerange="{-top:.17g} {top:.17g}"/>'
            if pitching:
                turns = -limb.geometry.travel * drive.gear_ratio
                rotors += (
                    f'<fixed armature="{drive.rotor_inertia:.17g}"><joint joint="pitch" coef="1"/>'
                    f'<joint joint="crank {i}" coef="{turns:.17g}"/></fixed>'
                )
        legs += _leg(assembly, limb, i, pose, np.array(at), contact, rotor)
        for point, one, two in assembly.loops:
            anchor = pose.point(point) - pose.point(assembly.carrier[one][1])
            loops += f'<connect body1="{one} {i}" body2="{two} {i}" anchor="{_xyz(anchor.tolist())}"/>'
        if assembly is ALL:
            locks += f'<joint joint1="{LOCKED} {i}"/>'
    floor = f'<geom type="plane" size="0 0 1" pos="0 {-RADIUS} 0" zaxis="0 1 0" contype="0" conaffinity="1"/>'
    j = trunk.pitch_inertia
    model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <option timestep="{dt:.17g}" gravity="0 {-GRAVITY} 0" {_SPEED if contact else _TRUTH}>
    <flag island="disable"/>
  </option>
  <default>
    <geom contype="1" conaffinity="0" friction="0.4 0 0"/>
    <equality solref="{solref[0]:.17g} {solref[1]:.17g}" solimp="0.9999 0.9999 0.001 0.5 2"/>
  </default>
  <worldbody>
    {floor if contact else ""}
    <body name="trunk" pos="{_xyz(at)}">
      <inertial pos="0 0 0" mass="{trunk.mass:.17g}" diaginertia="{j:.17g} {j:.17g} {j:.17g}"/>
      {slides}
      {legs}
    </body>
  </worldbody>
  <equality>{loops}{locks}</equality>
  <tendon>{rotors}</tendon>
  <actuator>{motors}</actuator>
</mujoco>""")
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
        assembly: Assembly = RIGID,
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
        self._cranks = [joints[f"crank {i}"] for i in range(len(limbs))]
        self._slides = [joints[name] for name in SLIDES[trunk.kind]]
        self._bodies = [
            {link: self.model.body(f"{link} {i}").id for link in assembly.links} for i in range(len(limbs))
        ]
        poses = start.poses(limbs)
        self._arms = [  # vectors of toe and heel from the ankle, in the hoof's axes
            [pose.point(name) - pose.point("G") for name in corners(limb)]
            for pose, limb in zip(poses, limbs, strict=True)
        ]
        for i, pose in enumerate(poses):
            # MuJoCo's joints turn relative to the carrier
            spin = {"frame": 0.0}
            for link, parent, _ in assembly.tree:
                spin[link] = pose.angular_velocities[assembly.links[link][0]]
                rate = start.crank_speed[i] if link == "crank" else spin[link] - spin[parent]
                self.data.qvel[joints[f"{link} {i}"]] = rate
        if trunk.kind == "suspended":  # the rest of the animal carries its part of the weight
            total = trunk.mass + sum(limb.geometry.mass for limb in limbs)
            self.data.xfrc_applied[self.model.body("trunk").id, 1] = (1 - trunk.share) * total * GRAVITY
        self._motors = [i for i, limb in enumerate(self.limbs) if isinstance(limb.drive, Motor)]
        self.data.ctrl[:] = [start.crank_speed[i] for i in self._motors]
        self.evaluate()

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
            hoof = bodies["hoof"]
            turn = self.data.xmat[hoof].reshape(3, 3)
            spatial = np.zeros(6)
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, hoof, spatial, 0)
            spin = spatial[2]
            velocity = complex(spatial[3], spatial[4])
            centre = complex(*self.data.xipos[hoof][:2])
            total = 0j
            moment = 0.0
            for point, arm in enumerate(self._arms[i]):
                out = turn[:2, :2] @ arm
                lever = complex(*out)
                at = complex(*self.data.xpos[hoof][:2]) + lever
                force = self.outside(i, point, self.data.time, at, velocity + 1j * spin * lever, commit)
                total += force
                # MuJoCo applies forces at the centre of mass
                moment += ((at - centre).conjugate() * force).imag
            self.data.xfrc_applied[hoof, [0, 1, 5]] = total.real, total.imag, moment

    @property
    def crank(self) -> NDArray[np.float64]:
        """Crank angles [rad]."""
        return np.array(self.start.crank) + self.data.qpos[self._cranks]

    @property
    def crank_speed(self) -> NDArray[np.float64]:
        """Speed of each crank [rad/s]."""
        return np.array(self.data.qvel[self._cranks])

    @property
    def body(self) -> NDArray[np.float64]:
        """x, y and pitch of the trunk [m, m, rad] and their rates, shape (6,)."""
        pose = np.array([*self.start.position, 0, 0, 0, 0])
        index = [SLIDES["free"].index(name) for name in SLIDES[self.trunk.kind]]
        pose[index] += self.data.qpos[self._slides]
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
            pivot = limb.geometry.fixed["C"]
            c = complex(sigma * pivot.real, pivot.imag) * np.exp(
                1j * (self.body[2] + sigma * self.start.swing[i])
            )
            at_c = pins[i][[point == "C" for point, _, _ in self.assembly.pins]].sum(axis=0)
            torque[i] += sigma * cross(c, complex(*at_c))
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
        ties = ties.reshape(len(self.limbs), len(loops), 3)[..., :2]
        for i, bodies in enumerate(self._bodies):
            for k, (point, one, two) in enumerate(pins):
                # Loops are constraints, all other pins joints between bodies, whose force is that on the
                # child
                if (point, one, two) in loops:
                    forces[i, k] = ties[i, loops.index((point, one, two))]
                elif carrier[one] == (two, point):
                    forces[i, k] = self.data.cfrc_int[bodies[one]][3:5]
                else:
                    forces[i, k] = -self.data.cfrc_int[bodies[two]][3:5]
        return forces

    def points(self, leg: int) -> dict[str, complex]:
        """Return the places of the pins that begin a link, and of toe and heel [m]."""
        bodies = self._bodies[leg]
        at = {point: complex(*self.data.xpos[bodies[link]][:2]) for link, _, point in self.assembly.tree}
        turn = complex(*self.data.xmat[bodies["hoof"]][[0, 3]])
        for name, arm in zip(corners(self.limbs[leg]), self._arms[leg], strict=True):
            at[name] = at["G"] + turn * complex(*arm)
        return at

    def closure(self) -> float:
        """Return the widest gap of a loop [m]."""
        gaps = np.asarray(self.data.efc_pos[: 3 * len(self.assembly.loops) * len(self.limbs)]).reshape(-1, 3)
        return float(np.linalg.norm(gaps, axis=1).max())
