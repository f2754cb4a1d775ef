"""The peers against this project's exact solutions, without ground; and MuJoCo on its own ground."""

import numpy as np
import pytest

from benchmarks.common import ALL, RIGID, Start
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Trunk
from hoof_env.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.paper_solver.solver import ConstrainedLeg
from tests.linkage import POINTS

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("exudyn")

from benchmarks.exudyn_legs import ExudynLegs  # noqa: E402
from benchmarks.mujoco_legs import MujocoLegs  # noqa: E402
from tests.legs import PRESETS  # noqa: E402

HIGH, SPEED, THETA = 5.0, 2 * np.pi, 0.3
HIPS = ((0.6, 0.0), (0.55, -0.05), (-0.6, 0.0), (-0.65, 0.03))
HELD = Trunk(kind="fixed", height=HIGH)


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def beginning(gait):
    a, b = gait.swing_sin, gait.swing_cos
    swing = gait.swing_offset + a * np.sin(THETA) + b * np.cos(THETA)
    return Start((THETA,), (gait.crank_speed,), (swing,), a, b, position=(0.0, HIGH))


def exact(geometry, gait, angles):
    """Crank torque, hip torque and joint forces of Eq. 8 where the loops are closed."""
    leg = ConstrainedLeg(geometry, Ground(), height=HIGH)
    rows = []
    for theta in angles:
        trace = leg.reset(gait, theta=theta)
        rows.append((trace["crank_torque"][0], trace["hip_torque"][0], leg.reactions().joints))
    return [np.array(column) for column in zip(*rows, strict=True)]


def assert_right(record, assembly, geometry, gait, within):
    crank, hip, joints = exact(geometry, gait, record.crank[:, 0])
    late = slice(len(record.t) // 10, None)  # Exudyn starts without the swing's acceleration
    forces = assembly.pin_forces(joints)
    assert record.crank[:, 0] == pytest.approx(THETA + gait.crank_speed * record.t, abs=2e-9)
    assert rms(record.crank_torque[late, 0] - crank[late]) < within * rms(crank)
    assert rms(record.hip_torque[late, 0] - hip[late]) < within * rms(hip)
    assert rms(record.pins[late, 0] - forces[late]) < within * rms(forces)


@pytest.mark.parametrize("assembly", [RIGID, ALL], ids=["9 hinges", "14 hinges"])
@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_mujoco_finds_positions_torques_and_reactions(preset, assembly):
    geometry, gait = load_geometry(preset), GaitParameters(SPEED, 0.4, 0, 0)
    peer = MujocoLegs([Limb(geometry, drive=Prescribed())], HELD, beginning(gait), dt=1e-3, assembly=assembly)
    record = peer.run(1.0, 50)
    assert_right(record, assembly, geometry, gait, within=1e-5)
    assert record.closure.max() < 1e-8
    frame = FrameMotion(phi=0.4, position=(0.0, HIGH))
    points = pose(geometry, peer.crank[0], frame=frame).points
    for name, at in peer.points(0).items():
        assert at == pytest.approx(complex(*points[POINTS.index(name)]), abs=2e-8), name


@pytest.mark.peers
@pytest.mark.parametrize("swing", [(0.0, 0.0), (-0.6, -0.2)], ids=["held", "swung"])
@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_exudyn_converges_to_torques_and_reactions(preset, swing):
    geometry, gait = load_geometry(preset), GaitParameters(SPEED, 0.4, *swing)
    for dt, within in ((1e-3, 4e-3), (2e-4, 1.6e-4)):  # second order: 25 times nearer
        peer = ExudynLegs([Limb(geometry, drive=Prescribed())], HELD, beginning(gait), dt=dt)
        record = peer.run(1.0, 50)
        assert_right(record, ALL, geometry, gait, within)
        assert record.closure.max() < 1e-14


@pytest.mark.peers
@pytest.mark.parametrize("legs", [1, 4])
def test_mujoco_stays_together_on_its_own_ground(legs):
    """The model that speed is measured on walks: its loops hold, its motors keep turning."""
    geometry = load_geometry()
    limbs = [Limb(geometry, hip=hip, drive=Motor()) for hip in (HIPS if legs > 1 else [(0.0, 0.0)])]
    high = geometry.hip_height
    cranks = tuple(0.3 + np.array([0.0, np.pi, np.pi / 2, -np.pi / 2])[:legs])
    start = Start(cranks, (2 * np.pi,) * legs, (0.4,) * legs, position=(0.0, high))
    trunk = Trunk(kind="free" if legs > 1 else "suspended", mass=80.0, height=high)
    peer = MujocoLegs(limbs, trunk, start, dt=1e-3, contact=True)
    gaps, touching = [], 0
    for _ in range(500):
        peer.step()
        gaps.append(peer.closure())
        touching += peer.data.ncon > 0
    assert touching > 50
    assert max(gaps) < 1e-3
    assert (peer.crank > np.array(cranks) + 1.0).all()
