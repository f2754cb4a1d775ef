"""Joint reactions out of the engine of several legs, against Eq. 8 and against the trunk's motion."""

import numpy as np
import pytest

from hoof_env.dynamics.constrained import ConstrainedLeg
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import GRAVITY, Limb, Prescribed, Trunk
from hoof_env.errors import ParameterError
from hoof_env.gait.gait import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.linkage import FRAME, JOINTS

GROUND = Ground(restitution=0.5, approach_floor=0.1, friction_fast=0.05)
LEG = load_geometry("first_fit")
WALK = load_gait("walk", "first_fit")


@pytest.mark.parametrize("preset", ["first_fit", "identified"])
@pytest.mark.parametrize("theta", [0.3, 2.0, 4.4])
def test_a_prescribed_crank_has_the_reactions_of_eq_8(preset, theta):
    leg, gait = load_geometry(preset), load_gait("run", preset)
    full = ConstrainedLeg(leg, GROUND)
    full.reset(gait, theta=theta)
    expected = full.reactions()
    limb, trunk = Limb(leg, drive=Prescribed()), Trunk("fixed", height=leg.hip_height)
    engine = TrunkEngine(limb, trunk, GROUND, reactions=True)
    engine.reset(gait, theta)
    found = engine.reactions()
    scale = np.abs(expected.joints).max()
    np.testing.assert_allclose(found.joints[0, :, :, 0], expected.joints, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(found.lock[0, 0], expected.lock, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(found.driver[0, 0], expected.driver, rtol=0, atol=1e-9 * scale)


def horse(n=1, **changes):
    limbs = [Limb(LEG, (x, 0.05)) for x in (-0.75, -0.7, 0.7, 0.75)]
    trunk = Trunk("free", mass=320.0, pitch_inertia=80.0, height=LEG.hip_height - 0.05, drag=30.0)
    made = TrunkEngine(limbs, trunk, GROUND, num_envs=n, **changes)
    made.reset(WALK, np.linspace(0, 6, n) + 1.5 * np.arange(4)[:, None], vx=1.0)
    return made


def test_forces_and_moments_at_the_hips_move_the_trunk():
    engine = horse(reactions=True)
    for _ in range(20):
        engine.advance(steps=10)
        found, r, s = engine.reactions(), engine.report, engine.state
        at_frame = [k for k, joint in enumerate(JOINTS) if joint.j == FRAME]
        on_trunk = -found.joints[..., 0][:, at_frame].sum(1)  # (legs, 2): by each leg's frame
        others = np.array([-engine.trunk.drag * r["vx"][0], -engine.trunk.mass * GRAVITY])
        outer = on_trunk.sum(0) + others
        scale = np.abs(on_trunk).sum()
        np.testing.assert_allclose(
            outer, engine.trunk.mass * np.array([r["ax"][0], r["ay"][0]]), rtol=0, atol=1e-8 * scale
        )
        arms = np.exp(1j * s["pitch"][0]) * np.array([complex(*limb.hip) for limb in engine.limbs])
        moment = (arms.conj() * (on_trunk[:, 0] + 1j * on_trunk[:, 1])).imag.sum() - found.hip[:, 0].sum()
        rotors = sum(rotor_moment(engine, i) for i in range(4))
        np.testing.assert_allclose(
            moment - rotors, engine.trunk.pitch_inertia * r["pitch_acc"][0], rtol=0, atol=1e-8 * scale
        )


def rotor_moment(engine, i):
    """What a leg's rotor takes of the hip's moment: it turns with the frame and, geared, with the crank."""
    motor, side, r = engine.limbs[i].drive, engine.limbs[i].geometry.travel, engine.report
    frame_acc = r["pitch_acc"][0] + side * r["phi_acc"][i, 0]
    return motor.rotor_inertia * (frame_acc - side * motor.gear_ratio * r["theta_acc"][i, 0])


def test_reactions_change_no_bit_of_the_motion_and_are_the_same_in_a_batch():
    alone, batch, silent = horse(reactions=True), horse(40, reactions=True), horse(40)
    for engine in (alone, batch, silent):
        assert not engine.advance(steps=50).any()
    for name, row in batch.state.items():
        np.testing.assert_array_equal(row, silent.state[name], name)
    for one, many in zip(alone.reactions(), batch.reactions(), strict=True):
        np.testing.assert_array_equal(one[..., 0], many[..., 0])


def test_an_engine_without_them_says_so():
    with pytest.raises(ParameterError, match="reactions=True"):
        horse().reactions()
