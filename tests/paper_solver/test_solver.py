"""Eq. 8 against the closed form, Newton and Euler's laws, its own drift equation and its own claims."""

from __future__ import annotations

import copy
import itertools
import math
import pickle
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Prescribed, Result, Trunk
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.gait import LIMITS, GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.profile import CELLS, leg_profile
from hoof_env.paper_solver.constraints import closed_form
from hoof_env.paper_solver.integrators import INTEGRATORS
from hoof_env.paper_solver.solver import TRACE, ConstrainedLeg, new_trace
from tests.dynamics.scenes import LEG as GEOMETRY
from tests.dynamics.scenes import RUN, WALK, inertia, loads
from tests.linkage import FRAME, POINTS

OTHER = load_geometry("identified")
LEGS = (
    GEOMETRY,
    GEOMETRY.replace(travel=-GEOMETRY.travel),
    OTHER,
    OTHER.replace(masses=tuple(np.linspace(3, 0.2, 14)), inertia="paper"),
)
PAPER_BETA = math.sqrt(30)
ORDERS = {"euler": 1, "semi_implicit_euler": 1, "midpoint": 2, "rk4": 4}

AIR = 10.0
"""A height at which nothing touches [m]."""

MOMENTA = ("momentum_x", "momentum_y", "angular_momentum")
"""Of the leg as a whole, which `ConstrainedLeg` does not report."""

gaits = st.builds(GaitParameters, *(st.floats(low, high) for low, high in LIMITS.values()))


def exact(geometry, height, gait, theta, command=None, steps=0, **settings):
    """The last row of `TrunkEngine`, which on a fixed trunk is the closed form, and nothing is integrated.

    Its table is the finest. The usual one is good to 1e-9 of the largest derivative, so that torques that
    nearly cancel in a fast leg missed the bound in one run of ten.
    """
    limb, trunk = Limb(geometry, drive=Prescribed()), Trunk("fixed", height=height)
    with warnings.catch_warnings(), pytest.MonkeyPatch.context() as patch:
        warnings.simplefilter("ignore", StepWarning)
        patch.setattr("hoof_env.dynamics.engine.leg_profile", lambda leg: leg_profile(leg, CELLS[-1]))
        engine = TrunkEngine(limb, trunk, **{"ground": Ground(), "substeps": 1} | settings)
    engine.reset(gait, theta, x=0.7)
    record = engine.run(command, steps)
    assert not record.pop("result").any()
    return {name: values[-1].item() for name, values in record.items()}


def normal(rows):
    return rows["toe_normal"] + rows["heel_normal"]


def travelled(leg, gait, theta, seconds):
    """The last trace row of a constant gait from crank angle `theta`."""
    leg.reset(gait, theta)
    trace = new_trace(round(seconds / leg.sim_dt))
    assert leg.advance(gait.to_array(), trace) is Result.OK
    return trace[-1]


def drift(leg):
    """Largest distance of q from the closed form, angles by their directions."""
    error = leg.state.q - closed_form(leg.geometry, leg.state.motion)[0]
    error[2::3] = np.angle(np.exp(1j * error[2::3]))
    return np.abs(error).max()


def assert_same_rows(row, expected, rtol=1e-9):
    """Every field of two rows agrees, torques and powers relative to the ground force that they balance."""
    for name in TRACE.names:
        if name in MOMENTA:
            continue
        force = np.hypot(normal(expected), expected["toe_friction"] + expected["heel_friction"])
        scale = max(1.0, force) if "torque" in name or "power" in name else 1.0
        assert row[name] == pytest.approx(expected[name], rel=rtol, abs=rtol * scale, nan_ok=True), name


# -- motion ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 0.0), (15.0, PAPER_BETA), (15.0, 15 * math.sqrt(2))])
@pytest.mark.parametrize(("scheme", "order"), ORDERS.items())
def test_drift_shrinks_with_the_order_of_the_scheme(scheme, order, alpha, beta):
    assert set(ORDERS) == set(INTEGRATORS)
    drifts = []
    for sim_dt in (1e-2, 5e-3, 2.5e-3):
        leg = ConstrainedLeg(
            GEOMETRY, Ground(), sim_dt, alpha=alpha, beta=beta, integrator=scheme, height=AIR
        )
        travelled(leg, RUN, 0.4, 0.2)
        drifts.append(drift(leg))
    assert np.diff(-np.log2(drifts)) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("beta", [PAPER_BETA, 15 * math.sqrt(2), 0.0])
def test_an_open_loop_closes_by_the_roots_of_baumgarte(beta):
    """Every row of Phi obeys Phi'' + 2 alpha Phi' + beta^2 Phi = 0, whatever the leg does."""
    alpha, seconds = 15.0, 0.1
    leg = ConstrainedLeg(GEOMETRY, Ground(), alpha=alpha, beta=beta, integrator="rk4")
    leg.reset(RUN, 1.0)
    generator = np.random.default_rng(1)
    leg.state.q += generator.uniform(-1e-3, 1e-3, 42)
    leg.state.qd += generator.uniform(-1e-2, 1e-2, 42)
    start = leg.closure()
    assert leg.advance(RUN.to_array(), new_trace(round(seconds / leg.sim_dt))) is Result.OK
    split = np.sqrt(complex(alpha**2 - beta**2))
    fast, slow = -alpha - split, -alpha + split
    decay = (start.error_rate - slow * start.error) / (fast - slow) * np.exp(fast * seconds)
    decay = decay + (start.error_rate - fast * start.error) / (slow - fast) * np.exp(slow * seconds)
    np.testing.assert_allclose(leg.closure().error, decay.real, atol=1e-8)


def test_a_constant_command_is_the_paper_s_crank():
    leg = ConstrainedLeg(GEOMETRY, Ground())
    leg.reset(WALK)
    trace = new_trace(100)
    leg.advance(WALK.to_array(), trace)
    np.testing.assert_allclose(trace["time"], np.arange(1, 101) * 1e-3, rtol=1e-14)
    np.testing.assert_allclose(trace["crank_angle"], 2 * np.pi * trace["time"], rtol=1e-13)


def test_contact_changes_the_multipliers_and_never_the_motion():
    low, high = ConstrainedLeg(GEOMETRY, Ground()), ConstrainedLeg(GEOMETRY, Ground(), height=AIR)
    rows = []
    for leg in (low, high):
        leg.reset(RUN, 1.2)
        rows.append(new_trace(200))
        assert leg.advance(RUN.to_array(), rows[-1]) is Result.OK
    assert normal(rows[0]).max() > 1000
    assert normal(rows[1]).max() == 0
    assert low.state.q.tobytes() == high.state.q.tobytes()
    assert low.state.qd.tobytes() == high.state.qd.tobytes()
    assert np.abs(rows[0]["crank_torque"] - rows[1]["crank_torque"]).max() > 100

    qdd, multipliers = low.solve()  # Eq. 8 says the same with the ground's forces in h
    free_qdd, free_multipliers = low.solve(ground=False)
    np.testing.assert_allclose(qdd, free_qdd, atol=1e-9 * np.abs(qdd).max())
    assert np.abs(multipliers - free_multipliers).max() > 100


# -- torques -----------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(gaits, st.floats(-30, 30), st.floats(-0.3, 1.0), st.sampled_from(LEGS), st.sampled_from([0.0, 1.0]))
def test_at_one_instant_everything_equals_the_closed_form(gait, theta, above, geometry, restitution):
    ground, height = Ground(restitution=restitution), geometry.hip_height + above
    leg = ConstrainedLeg(geometry, ground, height=height)
    expected = exact(geometry, height, gait, theta, ground=ground)
    assert_same_rows(leg.reset(gait, theta, x=0.7)[0], expected)


@settings(max_examples=15, deadline=None)
@given(gaits, gaits, st.floats(0, 6.3), st.sampled_from(LEGS))
def test_a_changing_gait_equals_the_closed_form(gait, command, theta, geometry):
    """The swing's accelerations and the filters' own: every derivative of the motion law is in Eq. 8."""
    leg, trace = ConstrainedLeg(geometry, Ground(), 2.5e-4, integrator="rk4"), new_trace(40)
    leg.reset(gait, theta, x=0.7)
    assert leg.advance(command.to_array(), trace) is Result.OK
    expected = exact(geometry, geometry.hip_height, gait, theta, command.to_array(), 40, sim_dt=2.5e-4)
    assert_same_rows(trace[-1], expected, rtol=1e-6)
    assert np.abs(leg.closure().error).max() < 1e-8


@pytest.mark.parametrize("height", [AIR, GEOMETRY.hip_height])
@pytest.mark.parametrize(("scheme", "order"), ORDERS.items())
def test_torques_converge_to_the_closed_form(scheme, order, height):
    true = exact(GEOMETRY, height, RUN, 1.6, steps=150)
    assert (normal(true) > 1000) == (height < AIR)
    longest = {1: 2e-3, 2: 5e-3, 4: 1e-2}[order]  # where the scheme shows its order and round-off does not
    for name in ("crank_torque", "hip_torque"):
        errors = []
        for sim_dt in (longest, longest / 2, longest / 4):
            leg = ConstrainedLeg(GEOMETRY, Ground(), sim_dt, integrator=scheme, height=height)
            errors.append(abs(travelled(leg, RUN, 1.6, 0.15)[name] - true[name]))
        assert np.diff(-np.log2(errors)) == pytest.approx(order, abs=0.3)


# -- joint reactions ---------------------------------------------------------------------------


@pytest.fixture(params=itertools.product((1, -1), (WALK, RUN), (0.3, 2.2)))
def loaded(request):
    """A leg at one instant of its cycle, on the ground at the second angle, and its motion in the world."""
    travel, gait, theta = request.param
    geometry = GEOMETRY.replace(travel=travel, inertia="paper" if travel == 1 else "uniform_rod")
    leg = ConstrainedLeg(geometry, Ground(restitution=0.3), height=GEOMETRY.hip_height - 0.05)
    row = leg.reset(gait, theta)[0]
    assert (normal(row) > 0) == (theta > 1)
    frame = FrameMotion(
        row["swing_angle"],
        row["swing_angle_rate"],
        row["swing_angle_acceleration"],
        position=(0.0, leg.trunk.height),
    )
    return leg, row, pose(geometry, theta, row["crank_angle_rate"], 0.0, frame)


def test_every_body_obeys_newton_and_euler(loaded):
    leg, row, motion = loaded
    toe, heel = (np.array([row[f"{end}_friction"], row[f"{end}_normal"]]) for end in ("toe", "heel"))
    reactions = leg.reactions()
    force, moment = loads(leg.geometry, motion, *reactions, toe, heel)
    need, turn = inertia(leg.geometry, motion)
    scale = np.abs(reactions.joints).max()
    np.testing.assert_allclose(force[:14], need, atol=1e-11 * scale)
    np.testing.assert_allclose(moment[:14], turn, atol=1e-11 * scale)


def test_the_frame_carries_the_leg(loaded):
    """Sums over the leg: the frame's forces are momentum rate less weight and ground force; their moment
    about O is the hip torque; the drives' power is the rate of all energy less the power of the ground."""
    leg, row, motion = loaded
    geometry, reactions = leg.geometry, leg.reactions()
    toe, heel = (np.array([row[f"{end}_friction"], row[f"{end}_normal"]]) for end in ("toe", "heel"))
    force, moment = loads(geometry, motion, *reactions, toe, heel)
    need, turn = inertia(geometry, motion)
    scale = np.abs(reactions.joints).max()
    np.testing.assert_allclose(-force[FRAME], need.sum(axis=0) - toe - heel, atol=1e-11 * scale)
    # the frame turns in its own sense, before the mirror; the crank turns clockwise in it
    assert moment[FRAME] == pytest.approx(0, abs=1e-11 * scale)
    assert geometry.travel * reactions.hip == pytest.approx(row["hip_torque"], abs=1e-11 * scale)
    assert -geometry.travel * reactions.driver == pytest.approx(row["crank_torque"], abs=1e-11 * scale)

    power = (need * motion.centre_velocities).sum() + turn @ motion.angular_velocities
    for point, pushed in ((geometry.toe, toe), (geometry.heel, heel)):
        power -= motion.point_velocities[POINTS.index(point)] @ pushed
    assert row["crank_power"] + row["hip_power"] == pytest.approx(power, abs=1e-10 * scale)


# -- state and failure -------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ORDERS)
def test_a_restored_state_continues_bit_for_bit(scheme):
    leg = ConstrainedLeg(GEOMETRY, Ground(restitution=0.0), integrator=scheme)
    leg.reset(WALK, 1.5)
    leg.advance(RUN.to_array(), new_trace(40))
    saved, first, again = leg.state.copy(), new_trace(60), new_trace(60)
    leg.advance(WALK.to_array(), first)
    assert normal(first).max() > 0
    leg.advance(RUN.to_array(), new_trace(5))
    leg.state = saved.copy()
    leg.advance(WALK.to_array(), again)
    assert first.tobytes() == again.tobytes()


def test_a_reset_forgets_what_was_before():
    used, fresh = (ConstrainedLeg(GEOMETRY, Ground(restitution=0.0)) for _ in range(2))
    travelled(used, RUN, 1.0, 0.1)
    assert used.reset(WALK, 1.9).tobytes() == fresh.reset(WALK, 1.9).tobytes()
    rows = [travelled(leg, WALK, 1.9, 0.05) for leg in (used, fresh)]
    assert rows[0].tobytes() == rows[1].tobytes()


@pytest.mark.parametrize(
    ("spoil", "result"),
    [
        (lambda state: state.q.fill(0.0), Result.SINGULAR),  # all links along x: the loops close in one way
        (lambda state: state.qd.fill(1e200), Result.NOT_FINITE),
    ],
)
def test_a_failure_is_a_result_and_puts_the_state_back(spoil, result):
    leg = ConstrainedLeg(GEOMETRY, Ground())
    leg.reset(WALK)
    spoil(leg.state)
    before = leg.state.copy()
    assert leg.advance(WALK.to_array(), new_trace(10)) is result
    assert "put back" in result.message
    for name, value in before.to_arrays().items():
        assert leg.state.to_arrays()[name].tobytes() == value.tobytes(), name


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda leg: pickle.loads(pickle.dumps(leg))])
def test_a_copy_goes_on_bit_for_bit(copied):
    leg, runs = ConstrainedLeg(GEOMETRY, Ground()), []
    leg.reset(RUN, theta=0.2)
    for runner in (leg, copied(leg)):
        first, second = new_trace(30), new_trace(30)
        runner.advance(WALK.to_array(), first)
        start = runner.reset(WALK, theta=2.0, x=0.5)
        runner.advance(RUN.to_array(), second)
        after = runner.state.to_arrays().values()
        runs.append([rows.tobytes() for rows in (first, start, second, *after)])
    assert runs[0] == runs[1]


def test_only_semi_implicit_euler_keeps_an_oscillator_bounded():
    def energy(name):
        q, qd = np.array([1.0]), np.array([0.0])
        for _ in range(5000):
            q, qd = INTEGRATORS[name](lambda t, q, qd: -q, q, qd, 0.05)
        return ((q**2 + qd**2) / 2).item()

    assert energy("semi_implicit_euler") == pytest.approx(0.5, rel=0.06)
    assert energy("euler") > 1e4
