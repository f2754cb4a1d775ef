"""The fast kernel of the paper's solver against the dense system of Eq. 8, and its own claims."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hoof_env.dynamics.constrained import ConstrainedLeg, Constraints, new_trace
from hoof_env.dynamics.parts import Result
from hoof_env.errors import GeometryError
from hoof_env.gait import LIMITS, MOTION, GaitParameters, evaluate_motion, load_gait, steady_filters
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry, tables
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import LENGTHS
from research.identify.euler import Points, accelerate, euler_cycle
from research.identify.leg import NUMBER
from research.identify.measure import Setup, new_bodies
from tests.legs import FIRST_FIT

GEOMETRY = load_geometry(FIRST_FIT)
GAITS = {name: load_gait(name, FIRST_FIT) for name in ("walk", "run")}
PAPER_BETA = math.sqrt(30)


def perturbed(size, seed, **changes):
    """The leg with every length and the pivot off by up to `size` of itself."""
    generator = np.random.default_rng(seed)
    factors = 1 + generator.uniform(-size, size, len(LENGTHS) + 2)
    return GEOMETRY.replace(
        lengths={name: GEOMETRY.lengths[name] * f for name, f in zip(LENGTHS, factors[2:], strict=True)},
        pivot=(GEOMETRY.pivot[0] * factors[0], GEOMETRY.pivot[1] * factors[1]),
        **changes,
    )


def leg_of(geometry):
    """The leg as the kernels take it."""
    return complex(*geometry.pivot), tables(geometry)[1]


def points():
    return Points(*[np.empty(11, np.complex128) for _ in range(3)])


def euler(geometry, gait, *, theta=0.0, sim_dt=1e-3, steps=1000, alpha=15.0, beta=PAPER_BETA):
    """A cycle by the fast kernel: whether it stayed finite, bodies, toe and heel with velocities, ankle, and
    the closure error at the end."""
    corners = NUMBER[geometry.toe], NUMBER[geometry.heel]
    setup = Setup(np.zeros(8), float(geometry.travel), *corners, 2e4, 1.5, alpha, beta, False)
    bodies, ankle, command = new_bodies(), np.empty(steps + 1), gait.to_array()
    at, velocity = np.empty((2, 2, steps + 1), np.complex128)
    finite = euler_cycle(
        geometry.lengths["OP"], *leg_of(geometry), setup, command, theta, sim_dt, bodies, at, velocity, ankle
    )
    motion = np.zeros(1, MOTION)[0]
    motion["theta"] = theta + steps * sim_dt * command[0]
    evaluate_motion(motion, steady_filters(command))
    error = np.abs(Constraints(geometry)(bodies.q.ravel(), bodies.qd.ravel(), motion).error).max()
    return finite, bodies, at, velocity, ankle, error


def assert_same_motion(geometry, gait, steps, tolerance, theta=0.0, **solver):
    leg = ConstrainedLeg(geometry, Ground(), **solver)
    start, rest = leg.reset(gait, theta), new_trace(steps)
    assert leg.advance(gait.to_array(), rest) is Result.OK
    trace = np.concatenate([start, rest])
    finite, bodies, at, velocity, _, error = euler(geometry, gait, theta=theta, steps=steps, **solver)
    assert finite
    for i, end in enumerate(("toe", "heel")):
        columns = {
            "x": at[i].real, "penetration": -(leg.trunk.height + at[i].imag),
            "slide": velocity[i].real, "rate": -velocity[i].imag,
        }  # fmt: skip
        for name, got in columns.items():
            np.testing.assert_allclose(got, trace[f"{end}_{name}"], rtol=0, atol=tolerance, err_msg=name)
    np.testing.assert_allclose(bodies.q.ravel(), leg.state.q, rtol=0, atol=tolerance)
    np.testing.assert_allclose(bodies.qd.ravel(), leg.state.qd, rtol=0, atol=tolerance)
    assert error == pytest.approx(np.abs(leg.closure().error).max(), abs=tolerance)
    return error


@pytest.mark.parametrize("beta", [PAPER_BETA, 21.2])
@pytest.mark.parametrize("gait", GAITS)
def test_a_cycle_is_that_of_the_dense_system(gait, beta):
    assert assert_same_motion(GEOMETRY, GAITS[gait], 1000, 1e-10, beta=beta) > 1e-4  # it drifts


def test_another_leg_and_other_settings():
    other = perturbed(0.03, 1, travel=1, toe="J" if GEOMETRY.toe == "I" else "I", heel=GEOMETRY.toe)
    assert_same_motion(other, GAITS["run"], 400, 1e-10, theta=2.0, sim_dt=2e-3, alpha=5.0, beta=0.0)


@settings(max_examples=15, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.builds(GaitParameters, *(st.floats(low, high) for low, high in LIMITS.values())),
    st.sets(st.sampled_from(sorted(GEOMETRY.assembly)), max_size=2),
    st.sampled_from([1, -1]),
    st.floats(-7, 7),
)
def test_any_leg_that_turns(seed, gait, flipped, travel, theta):
    try:
        geometry = perturbed(0.05, seed, travel=travel, assembly={p: -GEOMETRY.assembly[p] for p in flipped})
    except GeometryError:
        assume(False)
    assume(geometry.transmission_margin > 0.05)
    assert_same_motion(geometry, gait, 25, 1e-9, theta=theta)


@pytest.mark.parametrize("seed", range(5))
def test_open_loops_accelerate_as_in_the_dense_system(seed):
    """Every row's own error acts, the lock's too, which stays closed in a cycle."""
    alpha, beta = 15.0, 21.2
    leg = ConstrainedLeg(GEOMETRY, Ground(), alpha=alpha, beta=beta)
    leg.reset(GAITS["run"], seed)
    generator = np.random.default_rng(seed)
    leg.state.q += generator.uniform(-0.02, 0.02, 42)
    leg.state.qd += generator.uniform(-1, 1, 42)
    bodies = new_bodies()
    bodies.q[:], bodies.qd[:] = leg.state.q.reshape(14, 3), leg.state.qd.reshape(14, 3)
    bodies.length[0] = GEOMETRY.lengths["OP"]
    motion = tuple(float(leg.state.motion[n]) for n in ("theta", "theta_rate", "phi", "phi_rate", "phi_acc"))
    assert accelerate(*leg_of(GEOMETRY), motion, 2 * alpha, beta**2, bodies, points())
    np.testing.assert_allclose(bodies.qdd.ravel(), leg.solve(ground=False)[0], rtol=1e-10, atol=1e-8)


def test_the_drift_is_of_first_order():
    gait, closure, path = GAITS["run"], [], []
    phi = gait.swing_offset + gait.swing_cos  # back at theta = 0 after a revolution
    exact = pose(GEOMETRY, 0.0, frame=FrameMotion(phi)).point(GEOMETRY.toe)
    for steps in (1000, 2000, 4000):
        _, _, at, _, _, error = euler(GEOMETRY, gait, sim_dt=1 / steps, steps=steps)
        path.append(abs(at[0, -1] - complex(*exact)))
        closure.append(error)
    assert gait.crank_speed == pytest.approx(2 * np.pi)
    assert np.diff(-np.log2(closure)) == pytest.approx(1, abs=0.1)
    assert np.diff(-np.log2(path)) == pytest.approx(1, abs=0.1)


def test_the_ankle_is_the_point_between_shank_and_hoof():
    ankle = euler(GEOMETRY, GaitParameters(2 * np.pi, 0.0, 0.0, 0.0), steps=1)[4]
    assert ankle[0] == pytest.approx(pose(GEOMETRY, 0.0).point("G")[1], abs=1e-14)


def test_a_diverging_integration_is_nan_and_says_so():
    finite, bodies, *paths, error = euler(GEOMETRY, GAITS["run"], sim_dt=0.5, steps=2000)
    assert not finite
    assert all(np.isnan(part).all() for part in (bodies.q, bodies.qd, *paths))
    assert np.isnan(error)


def test_a_stretched_out_leg_is_singular():
    assert not accelerate(*leg_of(GEOMETRY), (0.0, 1.0, 0.0, 0.0, 0.0), 30.0, 30.0, new_bodies(), points())
