"""The peers against each other on this project's ground, whose forces come from outside."""

import numpy as np
import pytest

from benchmarks.common import RIGID, GroundForces, Start
from hoof_env.dynamics.parts import Limb, Motor, Trunk
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("exudyn")

from benchmarks.exudyn_legs import ExudynLegs  # noqa: E402
from benchmarks.mujoco_legs import MujocoLegs  # noqa: E402

pytestmark = pytest.mark.peers

HIPS = ((0.6, 0.0), (0.55, -0.05), (-0.6, 0.0), (-0.65, 0.03))


@pytest.mark.parametrize(("kind", "legs", "duration"), [("suspended", 1, 1.0), ("free", 4, 0.5)])
def test_peers_agree_on_the_ground(kind, legs, duration):
    geometry = load_geometry()
    limbs = [Limb(geometry, hip=hip, drive=Motor()) for hip in (HIPS if legs > 1 else [(0.0, 0.0)])]
    high = geometry.hip_height
    cranks = tuple(0.3 + np.array([0.0, np.pi, np.pi / 2, -np.pi / 2])[:legs])
    start = Start(cranks, (2 * np.pi,) * legs, (0.4,) * legs, position=(0.0, high))
    trunk = Trunk(kind=kind, mass=80.0, height=high)
    one, two = (
        peer(limbs, trunk, start, dt=1e-4, outside=GroundForces(Ground(), legs)).run(duration, 10)
        for peer in (MujocoLegs, ExudynLegs)
    )
    assert two.crank_torque.max() > 100  # the ground was felt
    assert one.crank == pytest.approx(two.crank, abs=2e-6)
    assert one.body[:, :3] == pytest.approx(two.body[:, :3], abs=5e-6)
    assert one.crank_torque == pytest.approx(two.crank_torque, abs=1e-2)
    forces = RIGID.pin_forces(two.pins)
    assert np.abs(one.pins - forces).max() < 1e-3 * np.abs(forces).max()


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
