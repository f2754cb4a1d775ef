"""The closed form against what a rigid linkage is: constant lengths, and derivatives that are derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from tests.legs import FIRST_FIT
from tests.linkage import BODIES, CONSTRUCTION, LOCK, NUMBER, Dyad

LEG = load_geometry(FIRST_FIT)
THETAS = np.linspace(-7.0, 7.0, 500)

# Central differences of eighth order: their error is far below the bars here, and they know nothing of the
# closed form.
OFFSETS = np.arange(-4, 5)
FIRST = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
SECOND = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040
STEP = 2e-3

unit = st.floats(-1, 1, allow_nan=False)


def distance(at, one, two):
    return np.linalg.norm(at.point(one) - at.point(two))


def unit_vector(at, one, two):
    return (at.point(two) - at.point(one)) / distance(at, one, two)


@pytest.mark.parametrize("phi", [0.0, 1.3])
def test_links_keep_their_lengths_over_a_revolution(phi):
    for theta in THETAS:
        at = pose(LEG, theta, frame=FrameMotion(phi=phi))
        for body, length in zip(BODIES, LEG.body_lengths, strict=True):
            assert abs(distance(at, body.tail, body.head) - length) < 1e-13
        assert abs(distance(at, "C", "A") - LEG.lengths["CA"]) < 1e-13


def test_the_frame_holds_crank_centre_and_pivot_and_the_crank_turns_clockwise_in_it():
    plain = LEG.replace(travel=1)
    for theta in THETAS:
        at = pose(plain, theta)
        assert (at.point("O") == 0).all()
        assert at.point("C") == pytest.approx(LEG.pivot, abs=0)
        assert at.point("P") == pytest.approx(
            LEG.lengths["OP"] * np.array([np.cos(theta), -np.sin(theta)]), abs=1e-15
        )


def test_extensions_are_straight_and_the_lock_holds():
    for theta in THETAS:
        at = pose(LEG, theta)
        assert unit_vector(at, "E", "F") == pytest.approx(unit_vector(at, "F", "G"), abs=1e-12)
        assert unit_vector(at, "C", "F") == pytest.approx(unit_vector(at, "C", "A"), abs=1e-12)
        assert np.exp(1j * at.angles[LOCK[0]]) == pytest.approx(np.exp(1j * at.angles[LOCK[1]]), abs=1e-12)


def test_every_dyad_is_assembled_on_its_side():
    plain = LEG.replace(travel=1)
    for theta in THETAS:
        at = pose(plain, theta)
        for dyad in (step for step in CONSTRUCTION if isinstance(step, Dyad)):
            base, arm = (at.point(end) - at.point(dyad.first) for end in (dyad.second, dyad.point))
            assert np.sign(base[0] * arm[1] - base[1] * arm[0]) == LEG.assembly[dyad.point]


def test_travel_mirrors_the_world_and_nothing_else():
    frame = FrameMotion(phi=0.4, phi_rate=1.1, phi_acc=-3.0)
    left, right = (pose(LEG.replace(travel=t), 0.7, 5.0, 2.0, frame) for t in (-1, 1))
    for name in ("points", "point_velocities", "point_accelerations", "centres", "centre_accelerations"):
        assert (getattr(left, name) == getattr(right, name) * [-1, 1]).all()
    assert left.angular_velocities == pytest.approx(-right.angular_velocities, rel=1e-12)
    assert left.angular_accelerations == pytest.approx(-right.angular_accelerations, rel=1e-12)


@st.composite
def motions(draw):
    """Coefficients of theta(t), phi(t), x(t), y(t), each a polynomial of second degree in t."""
    scales = np.array([[np.pi, 6.0, 20.0], [1.5, 4.0, 40.0], [2.0, 3.0, 10.0], [2.0, 3.0, 10.0]])
    return scales * np.array([[draw(unit) for _ in range(3)] for _ in range(4)])


def pose_at(geometry, motion, t):
    value = motion @ [1.0, t, t * t / 2]
    rate = motion @ [0.0, 1.0, t]
    acc = motion[:, 2]
    frame = FrameMotion(value[1], rate[1], acc[1], tuple(value[2:]), tuple(rate[2:]), tuple(acc[2:]))
    return pose(geometry, value[0], rate[0], acc[0], frame)


@given(motion=motions(), travel=st.sampled_from([-1, 1]))
@settings(deadline=None, max_examples=40)
def test_rates_and_accelerations_are_the_derivatives_of_the_motion(motion, travel):
    geometry = LEG.replace(travel=travel)
    now = pose_at(geometry, motion, 0.0)
    around = [pose_at(geometry, motion, STEP * k) for k in OFFSETS]
    for name, rate, acc in (
        ("points", "point_velocities", "point_accelerations"),
        ("centres", "centre_velocities", "centre_accelerations"),
        ("angles", "angular_velocities", "angular_accelerations"),
    ):
        path = np.array([getattr(at, name) for at in around])
        if name == "angles":
            path = np.unwrap(path, axis=0)
        assert getattr(now, rate) == pytest.approx(np.tensordot(FIRST, path, 1) / STEP, rel=1e-8, abs=1e-8)
        assert getattr(now, acc) == pytest.approx(np.tensordot(SECOND, path, 1) / STEP**2, rel=1e-6, abs=1e-5)


@given(motion=motions())
@settings(deadline=None, max_examples=40)
def test_every_body_moves_rigidly(motion):
    at = pose_at(LEG, motion, 0.0)
    for k, body in enumerate(BODIES):
        arm = (at.point(body.head) - at.point(body.tail)) / 2
        turned = np.array([-arm[1], arm[0]])
        rate, acc = at.angular_velocities[k], at.angular_accelerations[k]
        for end, sign in ((body.head, 1), (body.tail, -1)):
            i = NUMBER[end]
            assert at.points[i] == pytest.approx(at.centres[k] + sign * arm, abs=1e-12)
            assert at.point_velocities[i] == pytest.approx(
                at.centre_velocities[k] + sign * rate * turned, rel=1e-9, abs=1e-9
            )
            assert at.point_accelerations[i] == pytest.approx(
                at.centre_accelerations[k] + sign * (acc * turned - rate**2 * arm), rel=1e-9, abs=1e-8
            )
