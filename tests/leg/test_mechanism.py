"""The closed form of any mechanism against a solver that knows distances only, and against differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve

from hoof_env.leg.assembly import body_coordinate, solve
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.mechanism import Dyad
from tests.leg.mechanisms import leg_with_everything, random_leg

SHIPPED = ["jansen", "klann", "fourbar"]


def distances(leg, theta, z):
    """How far points are from being at their lengths, for a crank angle; squares, shape (2 dyads,)."""
    at = dict(zip(leg.mechanism.points, z, strict=True))
    at |= leg.fixed
    at[leg.mechanism.pin] = leg.crank_length * np.exp(-1j * theta)
    wrong = []
    for step in leg.mechanism.steps:
        assert isinstance(step, Dyad)
        for end, length in ((step.first, step.from_first), (step.second, step.from_second)):
            wrong.append(abs(at[step.point] - at[end]) ** 2 - leg.lengths[length] ** 2)
    return wrong


def newton(leg, theta, start):
    """Close the loops by Newton's method from places near them: no step knows of the order or of sides."""
    first = len(leg.fixed) + 1

    def wrong(flat):
        z = np.concatenate([start[:first], flat[::2] + 1j * flat[1::2]])
        return distances(leg, theta, z)

    begin = np.stack([start[first:].real, start[first:].imag], 1).ravel()
    found = fsolve(wrong, begin, xtol=1e-13)
    return found[::2] + 1j * found[1::2]


@given(seed=st.integers(0, 2**32 - 1), dyads=st.integers(1, 6), turn=st.floats(-0.05, 0.05))
@settings(deadline=None, max_examples=60)
def test_random_mechanisms_close_where_newton_closes_them(seed, dyads, turn):
    leg, at = random_leg(np.random.default_rng(seed), dyads)
    z = solve(leg, [0.0, turn])[0]
    np.testing.assert_allclose(z[0], list(at.values()), atol=1e-9)
    near = solve(leg, turn + np.array([-0.01, 0.01]))[0]
    # near a dead point Newton's method may end on the other side
    if np.isfinite(near).all() and leg_is_far_from_dead_points(leg, turn):
        np.testing.assert_allclose(z[1][len(leg.fixed) + 1 :], newton(leg, turn, z[0]), atol=1e-7)


def leg_is_far_from_dead_points(leg, theta):
    z = dict(zip(leg.mechanism.points, solve(leg, [theta])[0][0], strict=True))
    for dyad in leg.mechanism.dyads:
        one, two = z[dyad.point] - z[dyad.first], z[dyad.point] - z[dyad.second]
        if not abs((one.conjugate() * two).imag) > 0.3 * abs(one) * abs(two):
            return False
    return True


LEGS = {
    "identified": load_geometry("identified"),
    "jansen": load_geometry("jansen"),
    "klann": load_geometry("klann"),
    "everything": leg_with_everything(),
    "mirrored": leg_with_everything(travel=-1),
}


@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_rates_are_derivatives_of_the_positions(leg):
    theta = np.linspace(0, 2 * np.pi, 50)
    h = 1e-5
    before, here, after = (solve(leg, theta + shift) for shift in (-h, 0.0, h))
    size = np.abs(here[0]).max()
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), here[1], atol=1e-8 * size)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * h), here[2], atol=1e-7 * size)


@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_pose_has_all_points_bodies_and_their_rates(leg):
    theta, swing, rates = (
        0.7,
        -0.3,
        {"theta_rate": 5.0, "swing_rate": -1.0, "theta_acc": 3.0, "swing_acc": 2.0},
    )
    h = 1e-5

    def at(time):
        a, b = rates["theta_acc"], rates["swing_acc"]
        return leg.pose(
            theta + rates["theta_rate"] * time + a * time**2 / 2,
            swing + rates["swing_rate"] * time + b * time**2 / 2,
            rates["theta_rate"] + a * time,
            rates["swing_rate"] + b * time,
            a,
            b,
        )

    before, here, after = at(-h), at(0.0), at(h)
    for place, rate, second in (
        ("points", "point_velocities", "point_accelerations"),
        ("centres", "centre_velocities", "centre_accelerations"),
        ("angles", "angular_velocities", "angular_accelerations"),
    ):
        change = (getattr(after, place) - getattr(before, place)) / (2 * h)
        np.testing.assert_allclose(change, getattr(here, rate), atol=1e-6)
        change = (getattr(after, rate) - getattr(before, rate)) / (2 * h)
        np.testing.assert_allclose(change, getattr(here, second), atol=1e-5)


@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_bodies_are_rigid_and_their_points_stay_where_they_are(leg):
    """All distances within a body, of its centre of mass too, are the same at all crank angles."""
    number = leg.mechanism.number
    poses = [leg.pose(theta, 0.1 * theta) for theta in np.linspace(0, 6, 20)]
    for i, body in enumerate(leg.mechanism.bodies):
        places = np.array(
            [[*(pose.points[number[name]] for name in body.all_points), pose.centres[i]] for pose in poses]
        )
        apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
        np.testing.assert_allclose(apart, np.broadcast_to(apart[0], apart.shape), atol=1e-12)
        assert apart[0, 0, 1] == pytest.approx(leg.body_lengths[i])
        for k, name in enumerate(body.all_points):
            assert abs(body_coordinate(leg, name, i)) == pytest.approx(apart[0, k, -1], abs=1e-12)


def test_scaled_solids_keep_their_shape():
    leg = leg_with_everything()
    half = leg.scaled(0.5, mass_per_metre=2.0)
    np.testing.assert_allclose(half.body_centres, leg.body_centres)
    own = ("CB", "DE", "ankle", "crank")
    named = {body.name: i for i, body in enumerate(leg.mechanism.bodies)}
    for name in own:
        assert half.body_masses[named[name]] == pytest.approx(half.body_lengths[named[name]] * 2.0)
    # the radius of gyration goes with the length
    radius = np.sqrt(leg.body_inertias / leg.body_masses)
    np.testing.assert_allclose(np.sqrt(half.body_inertias / half.body_masses), radius / 2)
    again = Geometry.from_dict(leg.to_dict())
    assert again == leg
    assert again.mechanism == leg.mechanism


@pytest.mark.parametrize(
    ("name", "stroke", "lift", "low", "share"),
    [("jansen", 67.9, 22.5, -91.8, 0.58), ("klann", 64.0, 31.0, -45.7, 0.48)],
)
def test_feet_of_legs_with_published_lengths_keep_their_paths(name, stroke, lift, low, share):
    """In the units of these lengths. Jansen's path is from circles by hand, see `test_jansen`; Klann's leg
    has no published path, and its figures are stored from our closed form."""
    leg = load_geometry(name)
    unit = leg.crank_length / {"jansen": 15.0, "klann": 17.5}[name]
    foot = solve(leg, np.linspace(0, 2 * np.pi, 720, endpoint=False))[0][:, -1] / unit
    assert np.ptp(foot.real) == pytest.approx(stroke, abs=0.3)
    assert np.ptp(foot.imag) == pytest.approx(lift, abs=0.3)
    assert foot.imag.min() == pytest.approx(low, abs=0.1)
    assert np.mean(foot.imag < foot.imag.min() + 3) == pytest.approx(share, abs=0.02)
    assert leg.hip_height == pytest.approx(-low * unit, rel=2e-3)


def test_bends_of_klanns_links_are_near_his_patents():
    """30 degrees of the leg and 12.8 of the arm, by diywalkers.com/klann-linkage-optimizer.html; ours are the
    lengths of a leg that was made more level."""
    leg = load_geometry("klann")
    at = dict(zip(leg.mechanism.points, solve(leg, [0.0])[0][0], strict=True))
    for first, middle, last, bend in (("E", "F", "G", 30.0), ("P", "H", "F", 12.8)):
        turned = np.angle((at[last] - at[middle]) / (at[middle] - at[first]), deg=True)
        assert abs(turned) == pytest.approx(bend, abs=4.0)


def test_a_leg_that_rocks_has_no_place_where_it_does_not_close():
    rocks = load_geometry("klann").replace(lengths={"BH": 0.2}, full_turn=False)
    assert np.isnan(rocks.pose(np.pi).points).any()


@pytest.mark.parametrize("name", SHIPPED)
def test_in_stance_the_foot_goes_back(name):
    """Else the leg would walk backward: its direction of travel is data."""
    leg = load_geometry(name)
    foot = solve(leg, np.linspace(0, 2 * np.pi, 720, endpoint=False))
    stance = foot[0][:, -1].imag < foot[0][:, -1].imag.min() + 0.02
    assert (leg.travel * foot[1][stance, -1].real < 0).mean() > 0.9
