"""What engines of whole animals have: limits, slip, legs of their own in each environment."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.leg_constants import constants_layout, leg_constants, structure_of
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.observables import stance_figures
from hoof_env.dynamics.parts import HoofSpring, Limb, Limits, Motor, Prescribed, Result, Trunk
from hoof_env.gait import GaitParameters, HarmonicGait
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.profile import places
from tests.dynamics.scenes import HIPS, LEG, LOWEST, NATURAL, THETA, WALK
from tests.linkage import POINTS

SPRING = HoofSpring(4e4, 600.0)
ROCKER = LEG.replace(lengths={"CF": 0.8 * LEG.lengths["CF"]}, full_turn=False)
FREE = Trunk("free", mass=320.0, height=LOWEST, drag=0.0, pitch_inertia=80.0)


def animal(limits, num_envs=1, trunk=FREE, ground=NATURAL, terrain=None, **settings):
    limbs = [Limb(LEG, hip, Motor(), SPRING) for hip in HIPS]
    return TrunkEngine(
        limbs, trunk, ground, terrain, limits=limits, num_envs=num_envs, strides=True, **settings
    )


# -- limits ----------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-10, 10), st.floats(-0.1, 1.2), st.floats(-3.1, 3.1), st.floats(0.7, 1.3), st.booleans(),
    st.booleans(),
)  # fmt: skip
def test_the_lowest_joint_is_where_the_closed_form_has_it(theta, swing, pitch, size, mirrored, turned):
    """Without forces for a moment: the limit is passed just below the height of the lowest joint."""
    leg = LEG.replace(travel=-LEG.travel) if mirrored else LEG
    leg = leg.replace(toe=leg.heel, heel=leg.toe) if turned else leg
    scaled, gait = leg.scaled(size), GaitParameters(0.0, swing, 0.1, 0.05)
    phi = swing + 0.1 * np.sin(theta) + 0.05 * np.cos(theta)
    hip = (0.3, -0.1)
    at = complex(*hip) * np.exp(1j * pitch) + 9j
    frame = FrameMotion(phi=phi + leg.travel * pitch, position=(at.real, at.imag))
    points = pose(scaled, theta, 0.0, 0.0, frame).points[:, 1]
    lowest = min(y for name, y in zip(POINTS, points, strict=True) if name not in (leg.toe, leg.heel))
    for below, result in ((1e-6, Result.LOW_JOINT), (-1e-6, Result.OK)):
        engine = TrunkEngine(
            Limb(leg, hip, Prescribed()), FREE, Ground(stiffness=100.0), sim_dt=1e-5, substeps=1,
            limits=Limits(clearance=lowest + below),
        )  # fmt: skip
        engine.vary(0, limbs=[Limb(scaled, hip, Prescribed())])
        engine.reset(gait, theta, y=9.0, pitch=pitch)
        assert engine.advance() == result


def test_of_a_larger_leg_the_farthest_joint_is_the_lowest():
    """Right below O, the hoof beside them: only how far joints come from O says that one may be low."""
    theta = np.linspace(0, 2 * np.pi, 1000)
    z = places(LEG, theta)[0][:, [k for k, point in enumerate(POINTS) if point not in "GIJ"]]
    joint = z[:, np.argmax(np.abs(z).max(0))]
    k = np.argmax(np.abs(joint))
    pitch, lowest = -np.pi / 2 - np.angle(joint[k]), 9.0 - 1.3 * np.abs(joint[k])
    for below, result in ((-1e-6, Result.OK), (1e-6, Result.LOW_JOINT)):
        engine = TrunkEngine(
            Limb(LEG, (0.0, 0.0), Prescribed()), FREE, Ground(stiffness=100.0), sim_dt=1e-5, substeps=1,
            limits=Limits(clearance=lowest + below),
        )  # fmt: skip
        engine.vary(0, limbs=[Limb(LEG.scaled(1.3), (0.0, 0.0), Prescribed())])
        engine.reset(GaitParameters(0.0, 0.0, 0.0, 0.0), theta[k], y=9.0, pitch=pitch)
        assert engine.advance() == result


@pytest.mark.parametrize("leg", [LEG, ROCKER], ids=["turns", "rocks"])
def test_no_joint_is_farther_from_the_crank_centre_than_limits_take_it_to_be(leg):
    z = places(leg, np.random.default_rng(0).uniform(0, 2 * np.pi, 10**5))[0]
    others = [k for k, point in enumerate(POINTS) if point not in "GIJ"]
    reach = leg_constants(leg)[constants_layout(structure_of(leg)).rows("reach")][0]
    assert 0.9 * reach < np.nanmax(np.abs(z[:, others])) < 0.99 * reach


@pytest.mark.parametrize("num_envs", [1, 9])
def test_beyond_a_limit_the_motion_goes_on(num_envs):
    limits = Limits(pitch=(-0.2, 0.2), height=(1.0, 1.6))
    engine, free = animal(limits, num_envs), animal(Limits(), num_envs)
    for one in (engine, free):
        one.reset(WALK, THETA, pitch=0.15, pitch_rate=3.0)
    assert (engine.advance(steps=5) == Result.OK).all()
    assert (engine.advance(steps=95) == Result.PITCH).all()
    assert not free.advance(steps=100).any()
    assert {name: values.tolist() for name, values in engine.state.items()} == {
        name: values.tolist() for name, values in free.state.items()
    }
    assert engine.messages()[0] == "the trunk pitched beyond its limits"
    engine.reset(WALK, THETA, y=1.7)
    assert (engine.advance() == Result.HEIGHT).all()
    engine.reset(WALK, THETA)
    assert (engine.advance() == Result.OK).all()


@pytest.mark.parametrize("num_envs", [1, 9])
@pytest.mark.parametrize(("drop", "first"), [(0.05, Result.PITCH), (0.001, Result.HEIGHT)])
def test_the_first_limit_that_is_passed_counts(num_envs, drop, first):
    """In one call, where both are; each by itself ends a call that has the other not."""
    pitch, height = {"pitch": (-1.0, 0.2)}, {"height": (LOWEST + 0.3 - drop, 3.0)}
    found = []
    for bounds in (pitch, height, pitch | height):
        engine = animal(Limits(**bounds), num_envs)
        engine.reset(WALK, THETA, y=LOWEST + 0.3, pitch=0.15, pitch_rate=3.0)
        found.append(engine.advance(steps=120).tolist())
    assert found == [[kind] * num_envs for kind in (Result.PITCH, Result.HEIGHT, first)]


@pytest.mark.parametrize("num_envs", [1, 9])
def test_a_record_has_the_instant_at_which_a_limit_was_passed(num_envs):
    engine = animal(Limits(pitch=(-0.2, 0.2)), num_envs)
    engine.reset(WALK, THETA, pitch=0.15, pitch_rate=3.0)
    record = engine.run(steps=200, every=10)
    assert (record["result"] == Result.PITCH).all()
    assert (record["pitch"][-1] > 0.2).all()
    assert (record["pitch"][:-1] <= 0.2).all()
    assert (record["pitch"][-1] == engine.state["pitch"]).all()


def test_a_trunk_over_longer_legs_begins_higher():
    engine = animal(Limits(), 3)
    engine.vary(1, replace(FREE, height=1.2 * LOWEST), limbs=[
        Limb(LEG.scaled(1.2), hip, Motor(), SPRING) for hip in HIPS
    ])  # fmt: skip
    engine.reset(WALK, THETA)
    assert engine.report["y"] == pytest.approx([LOWEST, 1.2 * LOWEST, LOWEST])


def test_height_is_above_the_ground_below():
    engine = animal(Limits(height=(1.0, 2.0)), terrain=Terrain(height=(5.0,)))
    engine.reset(WALK, THETA, y=LOWEST + 5)
    assert engine.advance() == Result.OK
    engine.reset(WALK, THETA, y=LOWEST + 6)
    assert engine.advance() == Result.HEIGHT


# -- sums ------------------------------------------------------------------------------------------------


def test_slip_is_the_sliding_of_the_soles_in_stance():
    """Motion back and forth adds up; impulses are of the horizontal force."""
    h = 2e-4
    engine = animal(Limits(), ground=replace(NATURAL, friction=0.1), sim_dt=h, substeps=1)
    engine.reset(WALK, THETA, vx=0.5)
    slip, pushes, travel = np.zeros(4), np.zeros((2, 4)), np.zeros(4)
    total = dict.fromkeys(engine.strides, 0.0)
    for _ in range(1500):
        engine.advance()
        r, sums = engine.report, engine.strides
        total = {name: total[name] + sums[name] for name in total}
        normal = np.array([r["toe_normal"], r["heel_normal"]])[..., 0]
        slide = np.array([r["toe_slide"], r["heel_slide"]])[..., 0]
        load = normal.sum(0)
        down = load > 0
        stands = load > LIFT_OFF * engine.weight / 4
        slip[stands] += h * (normal * np.abs(slide)).sum(0)[stands] / load[stands]
        travel[down] -= h * (normal * slide).sum(0)[down] / load[down]
        push = (r["toe_friction"] + r["heel_friction"])[:, 0]
        pushes += h * np.array([np.maximum(-push, 0), np.maximum(push, 0)])
    assert slip.min() > 0.01
    assert total["slip"][:, 0] == pytest.approx(slip)
    assert total["backward_travel"][:, 0] == pytest.approx(travel)
    assert [total["braking"][:, 0], total["propulsion"][:, 0]] == [pytest.approx(p) for p in pushes]
    figures = stance_figures(total, 0.3, np.full((4, 1), 0.25))
    assert set(figures) >= {"peak", "mean", "duty", "stances_per_turn", "slip", "braking", "propulsion"}
    assert (figures["peak"] >= figures["mean"]).all()
    assert ((figures["duty"] > 0) & (figures["duty"] <= 1)).all()


# -- legs of one's own -----------------------------------------------------------------------------------


@pytest.mark.parametrize("num_envs", [1, 9])
def test_a_leg_of_another_size_moves_like_one_that_was_made_so(num_envs):
    scaled = LEG.scaled(1.15, mass_per_metre=3.0)
    trunk, hips = replace(FREE, mass=200.0), [(x * 0.8, 0.1) for x, _ in HIPS]
    other = [Limb(scaled, hip, Motor(), HoofSpring(6e4, 800.0)) for hip in hips]
    soft = replace(NATURAL, stiffness=1e5)
    engine = animal(Limits(), num_envs, substeps=2)
    engine.vary(num_envs - 1, trunk, soft, limbs=other)
    native = TrunkEngine(other, trunk, soft, limits=Limits(), strides=True, substeps=2)
    for one in (engine, native):
        one.reset(WALK, THETA, y=1.15 * LOWEST)
        assert not one.advance(steps=200).any()
    found, expected = engine.state, native.state
    for name, values in expected.items():
        assert found[name][..., num_envs - 1] == pytest.approx(values[..., 0], rel=1e-7, abs=1e-7), name
    if num_envs > 1:  # the others are the engine's own
        plain = animal(Limits(), substeps=2)
        plain.reset(WALK, THETA, y=1.15 * LOWEST)
        plain.advance(steps=200)
        assert all(np.array_equal(found[name][..., 0], v[..., 0]) for name, v in plain.state.items())


def test_commands_after_a_partial_reset():
    """The remaining environments do not change, and `observe` changes only the report."""
    engine, gait = animal(Limits(), 9, harmonics=2), HarmonicGait(5.0, 0.4, 0.1, 0.0, (0.1, 0.0))
    engine.reset(gait, THETA)
    engine.advance(np.tile(gait.to_array(), (4, 1)), 20)
    before = engine.get_state()
    engine.reset(gait, THETA, envs=[2, 5])
    wanted = np.random.default_rng(0).uniform(0.1, 0.3, (4, 6, 2))
    engine.command(wanted, envs=[2, 5])
    engine.observe()
    after = engine.get_state()
    others = [0, 1, 3, 4, 6, 7, 8]
    for name in ("trunk", "limbs", "command", "account"):
        assert np.array_equal(before[name][..., others], after[name][..., others]), name
    assert np.array_equal(after["command"][..., [2, 5]], wanted)
