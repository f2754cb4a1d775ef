"""Joint reactions by dyads against Eq. 8's multipliers and Newton and Euler's laws."""

import numpy as np
import pytest
from numba import njit

from hoof_env.dynamics.constrained import ConstrainedLeg
from hoof_env.dynamics.constraints import closed_form
from hoof_env.dynamics.parts import GRAVITY
from hoof_env.dynamics.reactions import LegConstants, Reactions, leg_constants, leg_reactions
from hoof_env.gait.gait import evaluate_motion, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import BODIES, CRANK, FRAME, JOINTS
from hoof_env.leg.linkage import LOCK as LOCKED
from hoof_env.simd import columns as columns_of
from hoof_env.simd import fill, rows, store_vectors
from hoof_env.simd.layout import Layout, Row, Vector, views
from hoof_env.simd.memory import address, doubles
from research.identify.ensemble import load_ensemble

PRESETS = {name: load_geometry(name) for name in ("first_fit", "identified")}
LEGS = {
    **PRESETS,
    "mirrored": PRESETS["first_fit"].replace(travel=-PRESETS["first_fit"].travel),
    "other toe": PRESETS["identified"].replace(
        toe=PRESETS["identified"].heel, heel=PRESETS["identified"].toe
    ),
    "own masses": PRESETS["identified"].replace(masses=tuple(np.linspace(3, 0.2, 14)), inertia="paper"),
    **{
        f"ensemble {k}": load_geometry(member)
        for k, member in enumerate(load_ensemble("identified"))
        if k % 5 == 0
    },
}
RUN = load_gait("run", "first_fit")
GROUND = ((-40.0, 900.0), (25.0, 1700.0))
AIR = ((0.0, 0.0), (0.0, 0.0))


def columns(count, seed=0):
    """Random states of legs, rows as `solve` has columns, shape (14, count); their angles theta and beta."""
    rng = np.random.default_rng(seed)
    theta, beta = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.5, 0.5, count)
    rates = rng.normal(0, 10, (4, count))
    state = [np.cos(theta), np.sin(theta), rates[0], rates[1], np.cos(beta), np.sin(beta), rates[2], rates[3]]
    return np.array([*state, *rng.normal(0, 5, (2, count)), *rng.normal(0, 500, (4, count))]), theta, beta


def cross(arms, forces):
    """Moments, shape (...), of forces at arms, shape (..., 2)."""
    return arms[..., 0] * forces[..., 1] - arms[..., 1] * forces[..., 0]


class State(Layout):
    """What `columns` has."""

    turn: Vector
    rate: Row
    acceleration: Row
    frame_turn: Vector
    frame_rate: Row
    frame_acceleration: Row
    lift: Vector
    toe: Vector
    heel: Vector


CONSTANTS = LegConstants.size


@njit(error_model="numpy")
def solve(state, constants, out):
    """A leg a column: turn, rate and acceleration of crank and of frame, lift, forces on toe and heel."""
    count = state.shape[1]
    g = rows(doubles(CONSTANTS), 1, LegConstants)
    fill(g, columns_of(address(constants), 1, LegConstants, 0, 1, 1))
    for k in range(count):
        now = columns_of(address(state), 1, State, k, count, 1)
        kept = columns_of(address(out), 1, Reactions, k, count, 1)
        joints, lock, driver, hip = leg_reactions(
            g, now.turn, now.rate, now.acceleration, now.frame_turn, now.frame_rate, now.frame_acceleration,
            now.lift, now.toe, now.heel,
        )  # fmt: skip
        store_vectors(kept.joints, joints)
        kept.lock, kept.driver, kept.hip = lock, driver, hip


def solved(geometry, state):
    """Reactions of legs alike by name, last axis the legs."""
    out = np.full((Reactions.size, state.shape[1]), np.nan)
    solve(np.ascontiguousarray(state), leg_constants(geometry), out)
    return views(Reactions, out)


def assert_close(value, expected, scale, rtol=1e-9):
    np.testing.assert_allclose(value, expected, rtol=0, atol=rtol * scale)


@pytest.mark.parametrize("forces", [AIR, GROUND], ids=["air", "ground"])
@pytest.mark.parametrize("geometry", LEGS.values(), ids=LEGS)
def test_reactions_are_the_multipliers_of_eq_8(geometry, forces):
    leg = ConstrainedLeg(geometry, Ground())
    sigma, state = geometry.travel, leg.state
    for theta in np.linspace(0.1, 6.2, 12):
        leg.reset(RUN, theta)
        state.filters["rate"], state.filters["acc"] = (3.0, 1.0, -0.7, 0.4), (0.0, 5.0, 8.0, -3.0)
        evaluate_motion(state.motion, state.filters)
        state.q, state.qd = closed_form(geometry, state.motion)
        for contact, (friction, normal) in zip(state.contacts, forces, strict=True):
            contact["friction"], contact["normal"] = friction, normal
        turn, beta = np.exp(1j * theta), np.exp(1j * sigma * state.motion["phi"])
        motion = state.motion
        found = solved(geometry, np.array([[
            turn.real, turn.imag, motion["theta_rate"], motion["theta_acc"],
            beta.real, beta.imag, sigma * motion["phi_rate"], sigma * motion["phi_acc"],
            0.0, GRAVITY, *forces[0], *forces[1],
        ]]).T)  # fmt: skip
        expected = leg.reactions()
        scale = np.abs(expected.joints).max()
        assert_close(found.joints[:, 0].reshape(-1, 2), expected.joints, scale)
        assert_close(found.lock[0], expected.lock, scale * geometry.lengths["EF"])
        assert_close(found.driver[0], expected.driver, scale * geometry.lengths["OP"])
        hip = sigma * leg.solve()[1] @ leg.closure().by_phi
        assert_close(found.hip[0], hip, scale * geometry.lengths["EF"])


@pytest.mark.parametrize("name", ["first_fit", "identified", "mirrored", "other toe", "own masses"])
def test_every_body_obeys_newton_and_euler(name):
    """With a hip that accelerates, and a frame that turns: forces and moments from positions by `pose`."""
    geometry = LEGS[name]
    state, theta, beta = columns(20)
    found = solved(geometry, state)
    sigma = geometry.travel
    for k in range(state.shape[1]):
        column, pushes = state[:, k], found.joints[:, k].reshape(-1, 2)
        lift = column[8:10]
        frame = FrameMotion(
            sigma * beta[k], sigma * column[6], sigma * column[7], acceleration=(lift[0], lift[1])
        )
        motion = pose(geometry, theta[k], column[2], column[3], frame)
        need = geometry.body_masses[:, None] * motion.centre_accelerations
        turn = geometry.body_inertias * motion.angular_accelerations
        force, moment = np.zeros((15, 2)), np.zeros(15)  # the last is the leg's frame, about O
        centres = np.vstack([motion.centres, [0, 0]])

        def act(body, point, push, force=force, moment=moment, motion=motion, centres=centres):
            force[body] += push
            moment[body] += cross(motion.point(point) - centres[body], push)

        for joint, push in zip(JOINTS, pushes, strict=True):
            act(joint.i, joint.point, push)
            act(joint.j, joint.point, -push)
        moment[LOCKED[0]] += found.lock[k]
        moment[LOCKED[1]] -= found.lock[k]
        moment[CRANK] += found.driver[k]
        moment[FRAME] += found.hip[k] - found.driver[k]
        sole = next(i for i, body in enumerate(BODIES) if (body.tail, body.head) == ("I", "J"))
        act(sole, geometry.toe, column[10:12])
        act(sole, geometry.heel, column[12:14])
        scale = np.abs(pushes).max()
        assert_close(force[:14], need, scale)
        assert_close(moment[:14], turn, scale)
        assert_close(moment[FRAME], 0, scale)

        # The whole leg: what the trunk gives at the hip and the ground at the hoof moves all its links.
        ground = column[10:12] + column[12:14]
        assert_close(-force[FRAME] + ground, need.sum(axis=0), scale)
        about = cross(motion.centres, need).sum() + turn.sum()
        about -= cross(motion.point(geometry.toe), column[10:12])
        about -= cross(motion.point(geometry.heel), column[12:14])
        assert_close(found.hip[k], about, scale)


def test_a_massless_leg_in_the_air_carries_nothing():
    geometry = PRESETS["identified"].replace(masses=(1e-12,) * 14)
    state, _, _ = columns(50)
    state[10:] = 0
    found = solved(geometry, state)
    assert max(np.abs(part).max() for part in vars(found).values()) < 1e-6
