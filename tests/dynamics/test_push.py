"""Pushes on trunks whose legs have motors: momentum, work, and the same bits alone and among many."""

import numpy as np
import pytest

from hoof_env import Limb, Motor, Prescribed, Trunk, TrunkEngine, load_gait, load_geometry
from hoof_env.errors import NotStartedError, ParameterError
from hoof_env.ground.contact import load_ground
from tests.dynamics.tally import tally_of

LEG = load_geometry("identified")
HIPS = (0.6, 0.6, -0.6, -0.6)
ENVS = 5


def engine_on(kind, drives, envs=ENVS):
    hips = HIPS if len(drives) == 4 else (0.0,)
    limbs = [Limb(LEG, (x, 0.0), drive) for x, drive in zip(hips, drives, strict=True)]
    height = {"height": LEG.hip_height} if kind == "free" else {}
    trunk = Trunk(kind, mass=80.0, share=1.0, pitch_inertia=30.0, **height)
    return TrunkEngine(limbs, trunk, load_ground("identified"), num_envs=envs)


def started(kind, drives, rng, envs=ENVS):
    engine = engine_on(kind, drives, envs)
    angles = rng.uniform(0.0, 2 * np.pi, (len(drives), envs))
    walk = load_gait("walk", "identified")
    are_motors = [[isinstance(drive, Motor)] for drive in drives]
    rates = np.where(are_motors, rng.uniform(2.0, 9.0, angles.shape), walk.crank_speed)
    engine.reset(walk, crank_angle=angles, crank_angle_rate=rates, vx=rng.uniform(0.0, 2.0, envs))
    return engine


@pytest.mark.parametrize(
    ("kind", "legs"), [("free", 4), ("free", 1), ("suspended", 1), ("suspended", 4), ("rail", 1)]
)
def test_a_push_adds_its_momentum_and_the_work_of_an_impulse(kind, legs):
    """An impulse J on a point does the work J (v + v') / 2, if no other force on a moving point acts at once:
    true of no other change of the cranks' speeds."""
    rng = np.random.default_rng(legs)
    engine = started(kind, [Motor(rotor_inertia=3e-4)] * legs, rng)
    before = tally_of(engine)
    velocity = np.array([engine.report[name] for name in ("vx", "vy")])
    rates = engine.state["crank_angle_rate"]
    impulse = rng.uniform(-60.0, 60.0, (2, ENVS))
    if kind == "rail":
        impulse[1] = 0.0
    engine.push(*impulse)
    engine.observe()
    after = tally_of(engine)
    mean = (velocity + np.array([engine.report[name] for name in ("vx", "vy")])) / 2
    work = (impulse * mean).sum(0)
    np.testing.assert_allclose(after.kinetic - before.kinetic, work, rtol=1e-9, atol=1e-9)
    gain = after.momentum - before.momentum
    np.testing.assert_allclose(gain.real, impulse[0], atol=1e-9)
    if kind != "rail":  # which takes the rest
        np.testing.assert_allclose(gain.imag, impulse[1], atol=1e-9)
    assert (np.abs(engine.state["crank_angle_rate"] - rates) > 1e-3).all()


def test_prescribed_cranks_among_motors_keep_their_speeds():
    engine = started("free", [Motor(), Prescribed(), Motor(), Prescribed()], np.random.default_rng(3))
    before = engine.state["crank_angle_rate"]
    engine.push(40.0, -10.0, [1, 3])
    changed = engine.state["crank_angle_rate"] != before
    np.testing.assert_array_equal(changed[:, [1, 3]], [[True] * 2, [False] * 2] * 2)
    assert not changed[:, [0, 2, 4]].any()


def test_a_push_has_the_same_bits_alone_and_among_many():
    motors = [Motor()] * 4
    many = started("free", motors, np.random.default_rng(7), 11)
    before = [many.column(env) for env in range(11)]
    impulses = np.linspace(-50.0, 50.0, 11)
    many.push(impulses, 5.0)
    alone = engine_on("free", motors, 1)
    for env in (0, 4, 10):
        alone.set_column(0, before[env])
        alone.push(impulses[env], 5.0)
        np.testing.assert_array_equal(alone.column(0), many.column(env))
        assert (alone.column(0) != before[env]).any()


def test_an_engine_that_was_never_reset_is_not_pushed():
    with pytest.raises(NotStartedError, match="before reset"):
        engine_on("suspended", [Motor()]).push(1.0)


def test_a_push_of_nothing_changes_nothing():
    engine = started("suspended", [Motor()], np.random.default_rng(1))
    before = engine.state
    engine.push(0.0, 0.0)
    for name, values in engine.state.items():
        np.testing.assert_array_equal(values, before[name])


@pytest.mark.parametrize("drive", [Prescribed(), Motor()], ids=["prescribed", "motor"])
def test_a_trunk_is_pushed_once_in_a_call(drive):
    """Its momentum would take one of two impulses, and the cranks of motors both."""
    engine = started("suspended", [drive], np.random.default_rng(1))
    before = engine.state
    with pytest.raises(ParameterError, match=r"envs: expected each environment once, got \[2, 0, 2\]"):
        engine.push([1.0, 2.0, 3.0], 0.0, [2, 0, 2])
    for name, values in engine.state.items():
        np.testing.assert_array_equal(values, before[name])
