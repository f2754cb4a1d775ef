"""Legs as models of MuJoCo (MJCF): hinges, closed loops, masses, feet, motors, a trunk and a ground.

The world's x points forward and its z up; this package's y is z there. Links are bodies of one tree, and
loops are closed by `connect` constraints. URDF has no loops and cannot hold such a leg. Coordinates of the
model agree with this package's where both exist: `crank` and `swing` are their angles, `x` and `z` the place
of O; hinges of all other links are 0 in the exported pose, counter-clockwise if seen with x to the right.

MuJoCo's constraints are springs: with its defaults, a loop can be pulled through a dead point into another
assembly. Here their time constant is two time steps, the smallest that MuJoCo accepts, and their impedance
0.9999, its largest. Its contact is not a viscoelastic force law, so only the ground's friction is exported.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from hoof_env._output import staged
from hoof_env.constants import GRAVITY
from hoof_env.errors import GeometryError, ParameterError, brief, check_number
from hoof_env.leg.checks import checked_path
from hoof_env.leg.kinematics import FrameMotion, Pose, pose
from hoof_env.leg.link_tree import CRANK_LINK, LinkTree, link_tree
from hoof_env.leg.mechanism import FRAME_NAME

if TYPE_CHECKING:
    from hoof_env.leg.geometry import Geometry

RADIUS = 0.01
"""Radius of the balls at the feet [m]; the floor lies a radius deeper, so a ball touches when its point
does."""

IMPEDANCE = "0.9999 0.9999 0.001 0.5 2"
"""Impedance of the loops, as near to rigid as MuJoCo goes."""

HIP_HEIGHT = 1.7
"""Hip height of the leg for which the servo's gains are given, about the default leg's [m]."""

SWING_STIFFNESS = 2e4
"""Stiffness of the servo that holds the swing [N m/rad]: 500 N at a hoof 1.4 m below turn it by 2 degrees.

The gains of other legs go with the cube of the hip height, as inertias do, so that frequency and damping
ratio stay, and with them the time step that MuJoCo needs."""

SWING_DAMPING = 400.0
"""Damping of the servo that holds the swing [N m s/rad]."""

POSE = "pose"
"""Name of the keyframe whose commands hold the pose that is written."""

MAX_ANGLE = 1e3
"""Largest angle of a pose [rad]; of larger ones rounding takes digits."""

LIGHT = 1e-6
"""Placeholder mass [kg] and inertia [kg m^2] of the massless swing frame; MuJoCo requires positive values."""

SLIDES = {
    "fixed": (),
    "rail": ("x",),
    "suspended": ("x", "z"),
    "boom": ("x", "z"),
    "floating": ("x", "z", "pitch"),
    "free": ("x", "z", "pitch"),
}
"""Coordinates that each kind of trunk has."""


@runtime_checkable
class TrunkLike(Protocol):
    """What the model needs of a trunk; `hoof_env.dynamics.parts.Trunk` is one."""

    @property
    def kind(self) -> str: ...
    @property
    def mass(self) -> float: ...
    @property
    def share(self) -> float: ...
    @property
    def stiffness(self) -> float: ...
    @property
    def damping(self) -> float: ...
    @property
    def drag(self) -> float: ...
    @property
    def height(self) -> float: ...
    @property
    def pitch_inertia(self) -> float: ...


@runtime_checkable
class MotorLike(Protocol):
    """What the model needs of a motor; `hoof_env.dynamics.parts.Motor` is one."""

    @property
    def speed_gain(self) -> float: ...
    @property
    def torque_limit(self) -> float: ...
    @property
    def rotor_inertia(self) -> float: ...
    @property
    def gear_ratio(self) -> float: ...


@runtime_checkable
class GroundLike(Protocol):
    """What the model needs of a ground; `hoof_env.ground.contact.Ground` is one."""

    @property
    def friction(self) -> float: ...


@dataclass(frozen=True)
class Held:
    """Trunk that stays in place at a height [m]."""

    height: float
    kind: str = "fixed"
    mass: float = 1.0
    share: float = 1.0
    stiffness: float = 0.0
    damping: float = 0.0
    drag: float = 0.0
    pitch_inertia: float = 1.0


@dataclass(frozen=True)
class PlacedLeg:
    """A leg on a trunk, in the pose that is written.

    Attributes:
        geometry: the leg.
        theta, swing: crank angle and swing of the pose [rad].
        hip: place of O from the trunk's point [m].
        motor: drive of the crank; without one the crank turns freely.
        armature: further inertia of the crank [kg m^2].
        label: suffix of the names of the leg's parts.
        tree: its links; by default as few as possible.
    """

    geometry: Geometry
    theta: float = 0.0
    swing: float = 0.0
    hip: tuple[float, float] = (0.0, 0.0)
    motor: MotorLike | None = None
    armature: float = 0.0
    label: str = ""
    tree: LinkTree | None = None


@dataclass(frozen=True)
class Options:
    """Choices about a model.

    Attributes:
        timestep: step of the simulation [s].
        option: attributes of MuJoCo's `option`, such as the integrator.
        loop_seconds: time constant of the loops [s]; two time steps if None.
        floor: add a ground at the height 0 with this coefficient of friction, which feet can touch.
        swings: give the legs a hinge about the hip, and a servo that holds it; otherwise their frames are
            parts of the trunk.
    """

    timestep: float = 1e-3
    option: tuple[tuple[str, str], ...] = (("integrator", "implicitfast"),)
    loop_seconds: float | None = None
    floor: float | None = None
    swings: bool = True


def leg_to_mjcf(
    geometry: Geometry,
    path: str | Path | None,
    angles: tuple[float, float],
    trunk: TrunkLike | None,
    motor: MotorLike | None,
    ground: GroundLike | None,
    timestep: float,
) -> str:
    """Check the arguments of `Geometry.to_mjcf`, return the model, write it; angles are theta and swing."""
    theta, swing = (
        check_number(name, angle, low=-MAX_ANGLE, high=MAX_ANGLE)
        for name, angle in zip(("theta", "swing"), angles, strict=True)
    )
    timestep = check_number("timestep", timestep, low=0, high=0.1, exclusive_low=True)
    for name, given, kind, needed in (
        ("trunk", trunk, TrunkLike, "a Trunk"),
        ("motor", motor, MotorLike, "a Motor"),
        ("ground", ground, GroundLike, "a Ground"),
    ):
        # a class has the names of its fields' defaults, but is not a part
        if given is not None and (isinstance(given, type) or not isinstance(given, kind)):
            raise ParameterError(f"{name}: expected {needed} of this package or None, got {brief(given)}")
    if not np.isfinite(geometry.pose(theta, swing).points).all():
        raise GeometryError(f"theta: the leg cannot be assembled at a crank angle of {theta:g} rad")
    trunk = trunk or Held(geometry.hip_height)
    leg = PlacedLeg(geometry, theta, swing, motor=motor)
    options = Options(timestep, floor=None if ground is None else ground.friction)
    text = write_mjcf([leg], trunk, (0.0, trunk.height), options)
    if path is not None:
        path = checked_path(path, ".xml")
        with staged(path.parent) as stage:
            (stage / path.name).write_text(text, encoding="utf-8")
    return text


def write_mjcf(
    legs: Sequence[PlacedLeg],
    trunk: TrunkLike,
    position: tuple[float, float],
    options: Options,
) -> str:
    """Return the model of a trunk with legs as XML.

    Args:
        legs: with labels that differ.
        trunk: that carries them.
        position: x and height of the trunk's point in the pose that is written [m].
        options: how the model is written.
    """
    root = ET.Element("mujoco", model="hoof_env")
    ET.SubElement(root, "compiler", angle="radian", inertiafromgeom="false", autolimits="true")
    option = ET.SubElement(root, "option", timestep=_text(options.timestep), gravity=f"0 0 {_text(-GRAVITY)}")
    option.attrib.update(options.option)
    # Islands make these small models slower
    ET.SubElement(option, "flag", island="disable")
    defaults = ET.SubElement(root, "default")
    ET.SubElement(defaults, "geom", contype="0", conaffinity="0", rgba="0.25 0.29 0.35 1")
    ET.SubElement(defaults, "site", size="0.004", rgba="0 0 0 0")
    loop = options.loop_seconds or 2 * options.timestep
    ET.SubElement(defaults, "equality", solref=f"{_text(loop)} 1", solimp=IMPEDANCE)
    world = ET.SubElement(root, "worldbody")
    if options.floor is not None:
        _add_floor(world, options.floor)
    body = ET.SubElement(world, "body", name="trunk", pos=_place(complex(*position)))
    _add_inertia(body, 0j, trunk.mass, trunk.pitch_inertia)
    _hang(body, trunk, position, sum(leg.geometry.mass for leg in legs))
    parts = {name: ET.SubElement(root, name) for name in ("equality", "tendon", "actuator", "keyframe")}
    for leg in legs:
        _add_leg(body, parts, leg, trunk, options)
    commands = {f"swing{leg.label}": leg.swing for leg in legs}
    held = [commands.get(actuator.attrib["name"], 0.0) for actuator in parts["actuator"]]
    if held:
        ET.SubElement(parts["keyframe"], "key", name=POSE, ctrl=" ".join(map(_text, held)))
    for name, part in parts.items():
        if not len(part):
            root.remove(root.find(name))  # type: ignore[arg-type]
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_floor(world: ET.Element, friction: float) -> None:
    ET.SubElement(
        world,
        "geom",
        name="floor",
        type="plane",
        size="0 0 1",
        pos=f"0 0 {_text(-RADIUS)}",
        conaffinity="1",
        friction=f"{_text(friction)} 0 0",
        rgba="0.85 0.82 0.75 1",
    )


def _hang(body: ET.Element, trunk: TrunkLike, position: tuple[float, float], legs_mass: float) -> None:
    """Give the trunk its coordinates, with drag and suspension."""
    axes = {"x": "1 0 0", "z": "0 0 1", "pitch": "0 -1 0"}
    at = {"x": position[0], "z": position[1], "pitch": 0.0}
    for name in SLIDES[trunk.kind]:
        kind = "hinge" if name == "pitch" else "slide"
        joint = ET.SubElement(body, "joint", name=name, type=kind, axis=axes[name], ref=_text(at[name]))
        if name == "x":
            joint.set("damping", _text(trunk.drag))
        if name == "z" and trunk.kind == "suspended":
            joint.set("damping", _text(trunk.damping))
            joint.set("stiffness", _text(trunk.stiffness))
            joint.set("springref", _text(trunk.height))
    if trunk.kind == "suspended":
        # The rest of the animal carries its part of the weight of trunk and legs: a force on the trunk
        carried = (1 - trunk.share) * (trunk.mass + legs_mass) / trunk.mass
        body.set("gravcomp", _text(carried))


def _add_leg(
    trunk_body: ET.Element,
    parts: dict[str, ET.Element],
    leg: PlacedLeg,
    trunk: TrunkLike,
    options: Options,
) -> None:
    tree = leg.tree or link_tree(leg.geometry.mechanism)
    at = pose(leg.geometry, leg.theta, frame=FrameMotion(phi=leg.swing))
    frame = trunk_body
    hip = complex(*leg.hip)
    if options.swings:
        frame = ET.SubElement(trunk_body, "body", name=f"frame{leg.label}", pos=_place(hip))
        _add_inertia(frame, 0j, LIGHT, LIGHT)
        hinge = ET.SubElement(frame, "joint", name=f"swing{leg.label}", type="hinge")
        hinge.set("axis", _axis(leg.geometry.travel))
        hinge.set("ref", _text(leg.swing))
        size = (leg.geometry.hip_height / HIP_HEIGHT) ** 3
        ET.SubElement(
            parts["actuator"],
            "position",
            name=f"swing{leg.label}",
            joint=f"swing{leg.label}",
            kp=_text(size * SWING_STIFFNESS),
            kv=_text(size * SWING_DAMPING),
        )
        hip = 0j
    turns = "pitch" in SLIDES[trunk.kind] or options.swings
    armature = leg.armature
    if leg.motor is not None and not turns:
        armature += leg.motor.gear_ratio**2 * leg.motor.rotor_inertia
    _add_links(frame, tree, leg, at, hip, armature, options.floor)
    for point, one, two in tree.loops:
        anchor = _point(at, point) - _point(at, tree.carrier[one][1])
        ET.SubElement(
            parts["equality"],
            "connect",
            body1=f"{one}{leg.label}",
            body2=f"{two}{leg.label}",
            anchor=_place(anchor),
        )
    for one, two in tree.locked:
        below = one if tree.carrier[one][0] == two else two
        ET.SubElement(parts["equality"], "joint", joint1=f"{below}{leg.label}")
    if leg.motor is not None:
        _add_motor(parts, leg, leg.motor, "pitch" in SLIDES[trunk.kind], options.swings)


def _add_links(
    frame: ET.Element,
    tree: LinkTree,
    leg: PlacedLeg,
    at: Pose,
    hip: complex,
    armature: float,
    friction: float | None,
) -> None:
    """Add all links, with the world's axes in the pose `at`; `hip` is the place of O in the frame."""
    bodies = {FRAME_NAME: frame}
    places = {FRAME_NAME: -hip}
    for link, carrier, point in tree.tree:
        here = _point(at, point)
        body = ET.SubElement(
            bodies[carrier], "body", name=f"{link}{leg.label}", pos=_place(here - places[carrier])
        )
        bodies[link] = body
        places[link] = here
        _add_inertia(body, *_solid(leg.geometry, at, tree.links[link], here))
        joint = ET.SubElement(body, "joint", name=f"{link}{leg.label}", type="hinge", axis=_axis(1))
        if link == CRANK_LINK:
            # The crank turns clockwise in the leg's frame
            joint.set("axis", _axis(-leg.geometry.travel))
            joint.set("ref", _text(leg.theta))
            joint.set("armature", _text(armature))
        _add_bars(body, tree, link, at, here, leg.label)
        _add_feet(body, tree, link, leg, at, here, friction)


def _add_bars(body: ET.Element, tree: LinkTree, link: str, at: Pose, here: complex, label: str) -> None:
    """Add the bars of a link, and a site at each of its points."""
    for k in tree.links[link]:
        ends = (tree.mechanism.bodies[k].tail, tree.mechanism.bodies[k].head)
        bar = " ".join(_place(_point(at, end) - here) for end in ends)
        ET.SubElement(body, "geom", type="capsule", size="0.006", fromto=bar)
    for point in tree.carried_points(link):
        place = _place(_point(at, point) - here)
        ET.SubElement(body, "site", name=f"{point} of {link}{label}", pos=place)


def _add_feet(
    body: ET.Element,
    tree: LinkTree,
    link: str,
    leg: PlacedLeg,
    at: Pose,
    here: complex,
    friction: float | None,
) -> None:
    """Add the balls of the feet that a link has."""
    feet = {"toe": leg.geometry.toe} | ({"heel": leg.geometry.heel} if leg.geometry.heel else {})
    for name, foot in feet.items():
        if tree.mechanism.body_of_foot(foot) not in tree.links[link]:
            continue
        ball = ET.SubElement(body, "geom", name=f"{name}{leg.label}", size=_text(RADIUS))
        ball.set("pos", _place(_point(at, foot) - here))
        ball.set("rgba", "0.8 0.35 0.1 1")
        ball.set("contype", "1")
        if friction is not None:
            # MuJoCo takes the larger coefficient of a pair
            ball.set("friction", f"{_text(friction)} 0 0")


def _add_motor(
    parts: dict[str, ET.Element], leg: PlacedLeg, motor: MotorLike, pitches: bool, swings: bool
) -> None:
    """Add the servo of a crank, and the rotor if it turns with its carrier."""
    top = _text(motor.torque_limit)
    ET.SubElement(
        parts["actuator"],
        "velocity",
        name=f"{CRANK_LINK}{leg.label}",
        joint=f"{CRANK_LINK}{leg.label}",
        kv=_text(motor.speed_gain),
        forcerange=f"-{top} {top}",
    )
    if not (pitches or swings):
        return
    # An armature of the crank would leave out that the rotor's axis is carried round
    travel = leg.geometry.travel
    rotor = ET.SubElement(parts["tendon"], "fixed", armature=_text(motor.rotor_inertia))
    shares = {f"{CRANK_LINK}{leg.label}": -travel * motor.gear_ratio}
    shares |= {"pitch": 1.0} if pitches else {}
    shares |= {f"swing{leg.label}": float(travel)} if swings else {}
    for joint, share in shares.items():
        ET.SubElement(rotor, "joint", joint=joint, coef=_text(share))


def _solid(
    geometry: Geometry, at: Pose, bodies: Sequence[int], origin: complex
) -> tuple[complex, float, float]:
    """Return centre of mass from `origin`, mass and inertia about the centre of some bodies together."""
    members = [*bodies]
    masses: NDArray[np.float64] = geometry.body_masses[members]
    centres = at.centres[members] @ np.array([1, 1j])
    mass = float(masses.sum())
    centre = complex((masses * centres).sum() / mass)
    # Steiner's theorem
    inertia = geometry.body_inertias[members] + masses * np.abs(centres - centre) ** 2
    return centre - origin, mass, float(inertia.sum())


def _add_inertia(body: ET.Element, centre: complex, mass: float, inertia: float) -> None:
    # The motion is planar: inertias about the remaining axes are arbitrary: a ball's
    diagonal = " ".join([_text(inertia)] * 3)
    ET.SubElement(body, "inertial", pos=_place(centre), mass=_text(mass), diaginertia=diagonal)


def _point(at: Pose, name: str) -> complex:
    return complex(*at.point(name).tolist())


def _place(z: complex) -> str:
    return f"{_text(z.real)} 0 {_text(z.imag)}"


def _axis(sense: int) -> str:
    """Return the axis of a hinge that turns counter-clockwise, or clockwise if `sense` is -1."""
    return f"0 {-sense} 0"


def _text(value: float) -> str:
    return f"{float(value):.17g}"
