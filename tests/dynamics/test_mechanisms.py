"""Legs of other mechanisms in both solvers: Eq. 2, each body's laws of motion, energy, a hoof of one
point."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Limits, Motor, Prescribed, Result, Trunk
from hoof_env.gait import GaitParameters, Motion
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.mechanism import FRAME
from hoof_env.paper_solver.constraints import Constraints, closed_form
from hoof_env.paper_solver.solver import ConstrainedLeg, new_trace
from tests.dynamics.scenes import NATURAL, drives_less_losses, energy, inertia, loads
from tests.leg.mechanisms import leg_with_everything, random_leg

LEGS = {
    "jansen": load_geometry("jansen"),
    "klann": load_geometry("klann"),
    "fourbar": load_geometry("fourbar"),
    "everything": leg_with_everything(),
    "mirrored": leg_with_everything(travel=-1, toe="G", heel="H"),
}
ONE_FOOT = ("jansen", "klann", "fourbar")
GAIT = GaitParameters(6.0, 0.02, -0.05, 0.04)


def in_stance(leg):
    """A crank angle at which the toe is lowest in `GAIT`, and where it is then."""
    theta = np.linspace(0, 2 * np.pi, 60)
    swing = GAIT.swing_offset + GAIT.swing_sin * np.sin(theta) + GAIT.swing_cos * np.cos(theta)
    places = np.array([leg.pose(*each).point(leg.toe) for each in zip(theta, swing, strict=True)])
    lowest = np.argmin(places[:, 1])
    return float(theta[lowest]), places[lowest]


def check_eq_2(leg, theta):
    """The closed form satisfies Eq. 2 and its rate, and its Jacobian and gamma agree with finite
    differences."""
    constraints = Constraints(leg)
    motion = Motion(theta, 4.0, 1.5, 0.2, -0.7, 0.4)
    q, qd = closed_form(leg, motion)
    closure = constraints(q, qd, motion)
    assert closure.error.shape == (3 * len(leg.mechanism.bodies),)
    assert np.abs(closure.error).max() < 1e-12
    assert np.abs(closure.error_rate).max() < 1e-11
    h = 1e-6
    columns = [
        (constraints(q + h * e, qd, motion).error - constraints(q - h * e, qd, motion).error) / (2 * h)
        for e in np.eye(len(q))
    ]
    np.testing.assert_allclose(np.transpose(columns), closure.jacobian, atol=1e-8)
    # along a motion on which the constraints hold, Phi_q qdd = gamma; differences of the closed form give qdd
    rates = []
    for time in (-1e-5, 1e-5):
        theta_t = motion.theta + 4.0 * time + 1.5 * time**2 / 2
        phi_t = 0.2 - 0.7 * time + 0.4 * time**2 / 2
        moved = Motion(theta_t, 4.0 + 1.5 * time, 1.5, phi_t, -0.7 + 0.4 * time, 0.4)
        rates.append(closed_form(leg, moved)[1])
    qdd = (rates[1] - rates[0]) / 2e-5
    np.testing.assert_allclose(closure.jacobian @ qdd, closure.gamma, atol=1e-5 * max(1, np.abs(qdd).max()))


@pytest.mark.parametrize("theta", [0.3, 2.0, 5.1])
@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_the_closed_form_satisfies_eq_2(leg, theta):
    check_eq_2(leg, theta)


@given(seed=st.integers(0, 2**32 - 1), dyads=st.integers(1, 5))
@settings(deadline=None, max_examples=25)
def test_random_mechanisms_satisfy_eq_2(seed, dyads):
    leg, _ = random_leg(np.random.default_rng(seed), dyads)
    if (
        np.isfinite(leg.pose(1e-4).points).all()
        and np.abs(leg.pose(0.0, theta_rate=1).point_velocities).max() < 9
    ):
        check_eq_2(leg, 0.0)


# Every leg stands on the ground at one of these. Where a foot is about to leave it, as Jansen's at 0.3, its
# force is what spring and damper leave of each other, and rounding of the table is not small then.
@pytest.mark.parametrize("theta", [0.0, 0.35, 2.0, 3.5, 4.7])
@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_joint_reactions_agree_with_eq_8(leg, theta):
    """Dyad by dyad, and by a system of equations of all bodies, to the accuracy of the table; the hoof is in
    the ground in some."""
    full = ConstrainedLeg(leg, NATURAL, height=leg.hip_height - 0.05)
    full.reset(GAIT, theta=theta)
    expected = full.reactions()
    trunk = Trunk("fixed", height=leg.hip_height - 0.05)
    engine = TrunkEngine(Limb(leg, drive=Prescribed()), trunk, NATURAL, reactions=True)
    engine.reset(GAIT, theta)
    found = engine.reactions()
    accuracy = 1e-10 * np.abs(expected.joints).max()
    np.testing.assert_allclose(found.joints[0, :, :, 0], expected.joints, rtol=0, atol=accuracy)
    for name in ("driver", "hip"):
        assert getattr(found, name)[0, 0] == pytest.approx(getattr(expected, name), abs=accuracy)
    np.testing.assert_allclose(found.lock.ravel(), expected.lock, rtol=0, atol=accuracy)


@pytest.mark.parametrize("slope", [0.0, -0.2])
@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_every_body_obeys_newton_and_euler(leg, slope):
    """And the powers of the drives are the rate of all energy less the power of the ground (virtual work)."""
    terrain = Terrain.slope(slope) if slope else None
    start, (x, y) = in_stance(leg)
    trunk = Trunk("fixed", height=-y - 0.08 + np.tan(slope) * x)
    engine = TrunkEngine(Limb(leg, drive=Prescribed()), trunk, NATURAL, terrain, reactions=True)
    engine.reset(GAIT, start - 1.0)
    turned = np.array([[np.cos(slope), -np.sin(slope)], [np.sin(slope), np.cos(slope)]])
    pressed = 0.0
    for k in range(12):
        assert not engine.advance([6.0 - 0.3 * k, 0.02, -0.05 + 0.01 * k, 0.04], 40).any()
        r, s = ({n: float(v.ravel()[0]) for n, v in rows.items()} for rows in (engine.report, engine.state))
        frame = FrameMotion(
            r["swing_angle"],
            r["swing_angle_rate"],
            r["swing_angle_acceleration"],
            position=(0.0, trunk.height),
        )
        motion = pose(leg, s["crank_angle"], s["crank_angle_rate"], r["crank_angle_acceleration"], frame)
        ground = [turned @ (r[f"{p}_friction"], r[f"{p}_normal"]) for p in ("toe", "heel")]
        joints, lock, driver, hip = (part[0, ..., 0] for part in engine.reactions())
        force, moment = loads(leg, motion, joints, lock, driver, hip, *ground)
        need, turn = inertia(leg, motion)
        scale = np.abs(joints).max()
        np.testing.assert_allclose(force[:-1], need, rtol=0, atol=1e-9 * scale)
        np.testing.assert_allclose(moment[:-1], turn, rtol=0, atol=1e-9 * scale)
        assert moment[FRAME] == pytest.approx(0, abs=1e-9 * scale)
        power = (need * motion.centre_velocities).sum() + turn @ motion.angular_velocities
        for foot, pushed in zip((leg.toe, leg.heel), ground, strict=True):
            if foot is not None:
                power -= motion.point_velocities[leg.mechanism.number[foot]] @ pushed
        assert r["crank_power"] + r["hip_power"] == pytest.approx(power, abs=1e-7 * scale)
        pressed = max(pressed, r["toe_normal"] + r["heel_normal"])
    assert pressed > 100


@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_energy_balances_drives_with_ground_and_dampers(leg):
    start, (_, y) = in_stance(leg)
    trunk = Trunk("suspended", mass=80.0, height=-y, damping=50.0)
    engine = TrunkEngine(Limb(leg, drive=Motor()), trunk, NATURAL, sim_dt=2.5e-4)
    engine.reset(GAIT, start - 1.0)
    before = energy(engine)[0]
    pressed = 0.0
    for _ in range(20):
        assert not engine.advance(steps=100).any()
        pressed = max(pressed, engine.report["toe_normal"].max())
    change = energy(engine)[0] - before
    assert pressed > 300
    assert abs(change) > 1
    assert change == pytest.approx(drives_less_losses(engine)[0], abs=2e-3 * abs(change) + 0.05)


@pytest.mark.parametrize("name", ONE_FOOT)
def test_a_hoof_of_one_point_has_a_heel_that_is_nothing(name):
    leg = LEGS[name]
    start, (_, y) = in_stance(leg)
    made = [
        TrunkEngine(
            Limb(leg, drive=Motor()),
            Trunk("suspended", mass=80.0, height=-y),
            NATURAL,
            num_envs=n,
            strides=True,
        )
        for n in (1, 20)
    ]
    for engine in made:
        engine.reset(GAIT, start - 0.5)
        engine.advance(steps=100)
    engine, batch = made
    for values, many in ((engine.report, batch.report), (engine.state, batch.state)):
        for key, row in values.items():
            np.testing.assert_array_equal(row[..., 0], many[key][..., 0])
            if key.startswith("heel"):
                assert (row == 0).all(), key
    r = {key: float(row.ravel()[0]) for key, row in engine.report.items()}
    # the foot is where the leg has its point, and carries all there is
    motion = pose(
        leg,
        float(engine.state["crank_angle"][0, 0]),
        frame=FrameMotion(r["swing_angle"], position=(r["x"], r["y"])),
    )
    np.testing.assert_allclose(motion.point(leg.toe), (r["toe_x"], r["toe_y"]), atol=1e-10)
    impulse = engine.strides["normal_impulse"].ravel()[0]
    assert impulse > 0
    paper = ConstrainedLeg(leg, NATURAL, height=leg.hip_height - 0.03)
    paper.reset(GAIT, 1.0)
    trace = new_trace(200)
    assert paper.advance(np.array(GAIT.to_array()), trace) is Result.OK
    for key in trace.dtype.names:
        if key.startswith("heel"):
            assert (trace[key] == 0).all(), key


@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_the_lowest_joint_is_found(leg):
    """The limit is passed just where a joint other than the feet is too low, by the places of all points."""
    number = leg.mechanism.number
    others = [k for name, k in number.items() if name not in leg.mechanism.feet]
    trunk = Trunk("fixed", height=leg.hip_height)
    gait = GaitParameters(0.0, 0.0, 0.0, 0.0)
    theta = np.linspace(0, 6.28, 24)
    lowest = np.array([pose(leg, t).points[others, 1].min() for t in theta]) + leg.hip_height
    clearance = float(np.median(lowest))
    engine = TrunkEngine(
        Limb(leg, drive=Prescribed()), trunk, NATURAL, num_envs=24, limits=Limits(clearance=clearance)
    )
    engine.reset(gait, theta[None])
    found = engine.advance(steps=5) == Result.LOW_JOINT
    clear = np.abs(lowest - clearance) > 1e-9
    np.testing.assert_array_equal(found[clear], (lowest < clearance)[clear])
    assert 5 < found.sum() < 20
