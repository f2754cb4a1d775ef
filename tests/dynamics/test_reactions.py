"""Joint reactions out of the engine: Newton and Euler's laws of every body, Eq. 8, the trunk's motion."""

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Trunk
from hoof_env.gait import load_gait
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.paper_solver.solver import ConstrainedLeg
from tests.dynamics.scenes import LEG, NATURAL, RUN, WALK, horse, inertia, loads
from tests.legs import PRESETS, load_ensemble
from tests.linkage import FRAME, JOINTS

OTHER = load_geometry("identified")
LEGS = {
    "first_fit": LEG,
    "identified": OTHER,
    "mirrored": LEG.replace(travel=-LEG.travel),
    "other toe": OTHER.replace(toe=OTHER.heel, heel=OTHER.toe),
    "own masses": OTHER.replace(masses=tuple(np.linspace(3, 0.2, 14)), inertia="paper"),
    **{f"ensemble {k}": load_geometry(m) for k, m in enumerate(load_ensemble()) if k % 5 == 0},
}


def assert_close(value, expected, scale, rtol=1e-9):
    np.testing.assert_allclose(value, expected, rtol=0, atol=rtol * scale)


def leg_motion(engine, i):
    """All links of a leg as the engine says it moves, and the ground's forces on toe and heel."""
    r, s = ({name: row[..., 0] for name, row in rows.items()} for rows in (engine.report, engine.state))
    limb, side = engine.limbs[i], engine.limbs[i].geometry.travel
    arm = np.exp(1j * s["pitch"]) * complex(*limb.hip)
    place = complex(r["x"], r["y"]) + arm
    acc = complex(r["ax"], r["ay"]) + (1j * r["pitch_acceleration"] - r["pitch_rate"] ** 2) * arm
    frame = FrameMotion(
        r["swing_angle"][i] + side * s["pitch"], r["swing_angle_rate"][i] + side * r["pitch_rate"],
        r["swing_angle_acceleration"][i] + side * r["pitch_acceleration"],
        position=(place.real, place.imag), acceleration=(acc.real, acc.imag),
    )  # fmt: skip
    motion = pose(
        limb.geometry, s["crank_angle"][i], s["crank_angle_rate"][i], r["crank_angle_acceleration"][i], frame
    )
    return motion, *(np.array([r[f"{p}_friction"][i], r[f"{p}_normal"][i]]) for p in ("toe", "heel"))


@pytest.mark.parametrize("slope", [0.0, 0.2])
@pytest.mark.parametrize("height", [-0.05, 10.0], ids=["ground", "air"])
@pytest.mark.parametrize("geometry", LEGS.values(), ids=LEGS)
def test_every_body_obeys_newton_and_euler(geometry, height, slope):
    """Under a trunk that moves and pitches, with commands on the move, a motor and a prescribed crank."""
    limbs = [Limb(geometry, (0.4, 0.1), Motor()), Limb(geometry, (-0.4, 0.0), Prescribed())]
    trunk = Trunk("free", mass=150.0, height=geometry.hip_height + height, pitch_inertia=30.0)
    terrain = Terrain.slope(slope) if slope else None
    engine = TrunkEngine(limbs, trunk, NATURAL, terrain, reactions=True)
    engine.reset([RUN, WALK], [0.4, 2.0], vx=1.0, pitch_rate=0.3)
    highest, turned = 0.0, np.array([[np.cos(slope), -np.sin(slope)], [np.sin(slope), np.cos(slope)]])
    for k in range(8):
        assert not engine.advance([9.0 - k, 0.3 + 0.1 * k, -0.4, 0.1 * k], 30).any()
        found = engine.reactions()
        for i in range(2):
            motion, *ground = leg_motion(engine, i)
            toe, heel = (turned @ force for force in ground)  # from tangent and normal to the world
            joints, *moments = (part[i, ..., 0] for part in found)
            force, moment = loads(geometry, motion, joints, *moments, toe, heel)
            need, turn = inertia(geometry, motion)
            scale, highest = np.abs(joints).max(), max(highest, toe[1] + heel[1])
            assert_close(force[:14], need, scale)
            assert_close(moment[:14], turn, scale)
            assert_close(moment[FRAME], 0, scale)
    assert (highest > 100) == (height < 0)


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
@pytest.mark.parametrize("theta", [0.3, 2.0, 4.4])
def test_a_prescribed_crank_has_the_reactions_of_eq_8(preset, theta):
    leg, gait = load_geometry(preset), load_gait("run", preset)
    full = ConstrainedLeg(leg, NATURAL)
    full.reset(gait, theta=theta)
    expected = full.reactions()
    trunk = Trunk("fixed", height=leg.hip_height)
    engine = TrunkEngine(Limb(leg, drive=Prescribed()), trunk, NATURAL, reactions=True)
    engine.reset(gait, theta)
    found, scale = engine.reactions(), np.abs(expected.joints).max()
    assert_close(found.joints[0, :, :, 0], expected.joints, scale)
    for name in ("lock", "driver", "hip"):
        assert_close(getattr(found, name)[0, 0], getattr(expected, name), scale)


def walker(n=1, **settings):
    hips = [(x, 0.05) for x in (-0.75, -0.7, 0.7, 0.75)]
    made = horse(NATURAL, None, hips, settings | {"num_envs": n}, height=LEG.hip_height - 0.05, drag=30.0)
    made.reset(WALK, np.linspace(0, 6, n) + 1.5 * np.arange(4)[:, None], vx=1.0)
    return made


def test_forces_and_moments_at_the_hips_move_the_trunk():
    engine = walker(reactions=True)
    trunk = engine.trunk
    at_frame = [k for k, joint in enumerate(JOINTS) if joint.j == FRAME]
    for _ in range(20):
        engine.advance(steps=10)
        found, r = engine.reactions(), {name: row[..., 0] for name, row in engine.report.items()}
        on_trunk = -found.joints[..., 0][:, at_frame].sum(1)  # (legs, 2): by each leg's frame
        outer = np.add(on_trunk.sum(0), (-trunk.drag * r["vx"], -trunk.mass * GRAVITY))
        scale = np.abs(on_trunk).sum()
        assert_close(outer, trunk.mass * np.array([r["ax"], r["ay"]]), scale, 1e-8)
        arms = np.exp(1j * engine.state["pitch"]) * [complex(*limb.hip) for limb in engine.limbs]
        moment = (arms.conj() * (on_trunk @ [1, 1j])).imag.sum() - found.hip[:, 0].sum()
        # A rotor is not among the links: it turns with the frame and, geared, with the crank.
        motor, side = engine.limbs[0].drive, LEG.travel
        turning = (
            r["pitch_acceleration"]
            + side * r["swing_angle_acceleration"]
            - side * motor.gear_ratio * r["crank_angle_acceleration"]
        )
        moment -= motor.rotor_inertia * turning.sum()
        assert_close(moment, trunk.pitch_inertia * r["pitch_acceleration"], scale, 1e-8)


def test_reactions_change_no_bit_of_the_motion_and_are_the_same_in_a_batch():
    alone, batch, silent = walker(reactions=True), walker(40, reactions=True), walker(40)
    for engine in (alone, batch, silent):
        assert not engine.advance(steps=50).any()
    for name, row in batch.state.items():
        np.testing.assert_array_equal(row, silent.state[name], name)
    for one, many in zip(alone.reactions(), batch.reactions(), strict=True):
        np.testing.assert_array_equal(one[..., 0], many[..., 0])
