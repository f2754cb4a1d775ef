"""A leg as MJCF: what the file says of places, masses and loops, read back without MuJoCo."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.parts import Motor, Trunk
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.link_tree import link_tree
from tests.legs import PRESETS

THETA, SWING = 0.7, -0.3


def numbers(text):
    return np.array(text.split(), float)


def placed(element, at=(0.0, 0.0, 0.0)):
    """Bodies by name with their places in the world, in the pose that is written."""
    for body in element.findall("body"):
        here = at + numbers(body.get("pos"))
        yield body.get("name"), body, here
        yield from placed(body, here)


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_the_pose_and_the_solids_agree_with_the_leg(preset):
    leg = load_geometry(preset)
    text = leg.to_mjcf(theta=THETA, swing=SWING, trunk=Trunk(height=1.5))
    root = ET.fromstring(text)
    pose = leg.pose(THETA, SWING)
    seen = set()
    mass, moment, inertia = 0.0, np.zeros(2), 0.0
    for name, body, here in placed(root.find("worldbody")):
        for site in body.findall("site"):
            place = (here + numbers(site.get("pos")))[[0, 2]] - (0, 1.5)
            point = site.get("name").split(" of ")[0]
            assert place == pytest.approx(pose.point(point), abs=1e-12)
            seen.add(point)
        if name not in ("trunk", "frame"):
            solid = body.find("inertial")
            own = float(solid.get("mass"))
            centre = (here + numbers(solid.get("pos")))[[0, 2]] - (0, 1.5)
            mass += own
            moment += own * centre
            inertia += numbers(solid.get("diaginertia"))[1] + own * centre @ centre
    assert seen == set(leg.mechanism.points)
    assert mass == pytest.approx(leg.mass)
    assert moment == pytest.approx(leg.body_masses @ pose.centres)
    # Of all bodies about O
    about_centres = leg.body_inertias.sum()
    assert inertia == pytest.approx(about_centres + leg.body_masses @ (pose.centres**2).sum(1))


def test_a_loop_closes_at_one_place_of_both_links():
    leg = load_geometry()
    root = ET.fromstring(leg.to_mjcf(theta=THETA))
    places = {name: here for name, _, here in placed(root.find("worldbody"))}
    pose = leg.pose(THETA)
    loops = root.findall("equality/connect")
    assert len(loops) == len(link_tree(leg.mechanism).loops) == 4
    for loop, (point, _, _) in zip(loops, link_tree(leg.mechanism).loops, strict=True):
        at = (places[loop.get("body1")] + numbers(loop.get("anchor")))[[0, 2]] - (0, leg.hip_height)
        assert at == pytest.approx(pose.point(point), abs=1e-12)


def test_trunk_motor_and_ground_are_written_where_they_are_given():
    leg = load_geometry()
    bare = ET.fromstring(leg.to_mjcf())
    assert {joint.get("name") for joint in bare.iter("joint")} == {"swing", *link_tree(leg.mechanism).links}
    assert [motor.get("name") for motor in bare.find("actuator")] == ["swing"]
    assert not [geom for geom in bare.iter("geom") if geom.get("name") == "floor"]
    trunk, motor = Trunk(mass=70, share=0.6), Motor(speed_gain=33, torque_limit=44)
    whole = ET.fromstring(leg.to_mjcf(trunk=trunk, motor=motor, ground=Ground(friction=0.55)))
    joints = {joint.get("name"): joint for joint in whole.iter("joint")}
    assert float(joints["z"].get("stiffness")) == trunk.stiffness
    assert float(joints["x"].get("damping")) == trunk.drag
    body = whole.find("worldbody/body")
    carried = float(body.get("gravcomp")) * trunk.mass * GRAVITY
    assert carried == pytest.approx((1 - trunk.share) * (trunk.mass + leg.mass) * GRAVITY)
    servo = whole.find("actuator/velocity")
    assert servo.get("kv") == "33"
    assert numbers(servo.get("forcerange")) == pytest.approx([-44, 44])
    (floor,) = (geom for geom in whole.iter("geom") if geom.get("name") == "floor")
    assert numbers(floor.get("friction"))[0] == 0.55


def test_the_file_is_the_text(tmp_path):
    leg = load_geometry()
    text = leg.to_mjcf(tmp_path / "leg.xml")
    assert (tmp_path / "leg.xml").read_text(encoding="utf-8") == text


@pytest.mark.parametrize("scale", [1.0, 0.2, 2.0])
@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_the_servo_of_the_swing_has_one_frequency_at_any_size(preset, scale):
    """Inertias of rods of one mass per length go with the cube of the size."""
    gains = []
    for leg in (load_geometry(preset), load_geometry(preset).scaled(scale)):
        servo = ET.fromstring(leg.to_mjcf()).find("actuator/position")
        gains.append([float(servo.get(name)) for name in ("kp", "kv")])
    np.testing.assert_allclose(np.divide(*gains[::-1]), scale**3, rtol=1e-9)


@pytest.mark.parametrize(("motor", "commands"), [(None, [SWING]), (Motor(), [SWING, 0.0])])
def test_a_keyframe_has_the_commands_that_hold_the_pose(motor, commands):
    root = ET.fromstring(load_geometry("identified").to_mjcf(theta=THETA, swing=SWING, motor=motor))
    key = root.find("keyframe/key")
    assert key.get("name") == "pose"
    assert numbers(key.get("ctrl")).tolist() == commands
    assert len(root.find("actuator")) == len(commands)
