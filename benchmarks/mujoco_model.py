"""Legs on a trunk as a MuJoCo model: for speed with its own contact, for truth with forces from outside.

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

from benchmarks.common import ALL, LOCKED, RIGID, Assembly, Start, corners
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.limb import Limb
from hoof_env.dynamics.trunk import GRAVITY, Trunk
from hoof_env.leg.kinematics import Pose

FLYWHEEL = 1e9
"""Inertia that keeps a prescribed crank at its speed [kg m^2]: it is 1e10 times the leg's."""

RADIUS = 0.01
"""Of the balls at toe and heel [m]; the floor lies a radius deeper, so a ball touches when its point does."""

SLIDES = {"fixed": (), "rail": ("x",), "suspended": ("x", "y"), "free": ("x", "y", "pitch")}

_SPEED = 'solver="Newton" jacobian="dense" integrator="Euler" iterations="5" tolerance="1e-8"'
"""The fastest that holds the loops. One Newton iteration loses the horse, and so do 50 of CG; PGS is slower,
a sparse Jacobian is, too, but for 14 hinges a leg on four legs, implicitfast by 3 %, elliptic
cones by 20 % on four legs, and islands, which are off below, by 9 %."""

_TRUTH = 'solver="Newton" jacobian="dense" integrator="RK4" iterations="50" tolerance="0"'


def _xyz(z: Any) -> str:
    return f"{z[0]:.17g} {z[1]:.17g} 0"


def _leg(
    assembly: Assembly, limb: Limb, i: int, at: Pose, frame: NDArray[np.float64], contact: bool, rotor: float
) -> str:
    """The bodies of a leg, each with the world's axes in the pose `at`; `frame` is the trunk's origin."""
    masses, inertias = limb.geometry.body_masses, limb.geometry.body_inertias

    def body(link: str, parent_at: NDArray[np.float64]) -> str:
        pin = at.point(assembly.carrier[link][1])
        axis, armature = (-limb.geometry.travel, rotor) if link == "crank" else (1, 0.0)
        text = f'<body name="{link} {i}" pos="{_xyz((pin - parent_at).tolist())}">'
        text += f'<joint name="{link} {i}" axis="0 0 {axis}" armature="{armature:.17g}"/>'
        for order, k in enumerate(assembly.links[link]):
            centre = _xyz((at.centres[k] - pin).tolist())
            j, m = float(inertias[k]), float(masses[k])
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
    friction: float = 0.4,
    options: str | None = None,
    solref: tuple[float, float] | None = None,
    solimp: str = "0.9999 0.9999 0.001 0.5 2",
) -> mujoco.MjModel:
    """A horse in MuJoCo whose joints are at zero in the pose of `start`.

    Args:
        limbs, trunk: the horse. A prescribed crank is a flywheel that keeps its speed.
        start: its first pose.
        dt: time step [s].
        contact: MuJoCo's own, of balls at toe and heel with the ground at y = 0.
        assembly: which links are one body with a hinge; `RIGID` or `ALL`.
        friction: between them.
        options: attributes of MJCF's `option`; those for speed if None and `contact`, else for truth.
        solref, solimp: of the loops; see the module's docstring.

    Raises:
        ValueError: the start asks for a swing that moves.
    """
    if start.swings:
        raise ValueError("MuJoCo's legs keep their swing: expected swing_sin and swing_cos of 0")
    at, h = start.position, trunk.height - start.position[1]
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
    legs, loops, locks, motors, rotors = "", "", "", "", ""
    for i, (limb, pose) in enumerate(zip(limbs, start.poses(limbs), strict=True)):
        drive, rotor = limb.drive, FLYWHEEL
        if isinstance(drive, Motor):
            rotor, top = 0.0 if pitching else drive.reflected_inertia, drive.torque_limit
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
  <option timestep="{dt:.17g}" gravity="0 {-GRAVITY} 0" {options or (_SPEED if contact else _TRUTH)}>
    <flag island="disable"/>
  </option>
  <default>
    <geom contype="1" conaffinity="0" friction="{friction} 0 0"/>
    <equality solref="{solref[0]:.17g} {solref[1]:.17g}" solimp="{solimp}"/>
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
        model.body_invweight0[:] *= 1e-4
        model.dof_invweight0[:] *= 1e-4
    return model
