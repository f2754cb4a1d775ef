"""The latch: the approach speed is taken at touch-down and held until the point leaves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.ground.contact import HEEL, TOE, Ground, latch, new_contacts, touch
from tests.oracle.laws import friction_force, normal_force

INTERPOLATED = Ground(restitution=0.5, approach_floor=0.01).to_record()
SAMPLED = Ground(restitution=0.5, approach_floor=0.01, approach="sampled").to_record()


def follow(path, ground):
    """Approach speed after each (penetration, rate) of a path."""
    contact = new_contacts()[TOE]
    seen = []
    for penetration, rate in path:
        latch(contact, penetration, rate, ground)
        seen.append((contact.inside, contact.approach))
    return seen


def test_it_holds_until_the_point_leaves_and_latches_anew():
    path = [(-0.1, 1.0), (0.1, 1.0), (0.2, 0.4), (0.1, -2.0), (-0.1, -2.0), (-0.05, 3.0), (0.05, 3.0)]
    assert follow(path, INTERPOLATED) == [
        (False, 0.0), (True, 1.0), (True, 1.0), (True, 1.0), (False, 0.0), (False, 0.0), (True, 3.0),
    ]  # fmt: skip


@given(st.floats(-1.0, -1e-6), st.floats(0.02, 10.0), st.floats(-5.0, 20.0), st.floats(1e-4, 1e-2))
@settings(deadline=None, max_examples=100)
def test_interpolation_meets_the_crossing(start, rate, acc, h):
    """Exact where the point moves uniformly, of second order in the step where it accelerates."""
    for a in (0.0, acc):
        times = np.arange(0, 1000) * h
        depth, speed = start + rate * times + a * times**2 / 2, rate + a * times
        inside = np.flatnonzero(depth > 0)
        if not inside.size or speed[inside[0]] < 0.02:
            continue
        end = inside[0] + 1
        seen = follow(zip(depth[:end].tolist(), speed[:end].tolist(), strict=True), INTERPOLATED)
        true = np.sqrt(rate**2 - 2 * a * start)
        step = speed[end - 1] - speed[end - 2]  # over the step of the crossing
        assert seen[-1][1] == pytest.approx(true, rel=1e-9, abs=step**2 / true)


def test_the_speed_at_entry():
    """Sampled, interpolated, of a grazing point and of one that begins inside."""
    path = [(-0.3, 1.0), (0.1, 2.0)]
    assert follow(path, SAMPLED)[-1] == (True, 2.0)
    assert follow(path, INTERPOLATED)[-1] == (True, pytest.approx(1.75))  # three quarters of the way
    for ground in (INTERPOLATED, SAMPLED):
        assert follow([(-0.1, -1.0), (1e-3, 1e-5)], ground)[-1] == (True, 0.01)
        assert follow([(0.1, -0.5)], ground)[-1] == (True, 0.01)  # begins inside, on its way out
    assert follow([(0.1, 0.7), (0.2, 0.1)], INTERPOLATED) == [(True, 0.7), (True, 0.7)]


def test_points_latch_each_for_itself():
    contacts = new_contacts()
    touch(contacts[TOE], complex(0.3, -0.01), complex(0.5, -0.8), INTERPOLATED)
    touch(contacts[HEEL], complex(0.1, 0.02), complex(0.5, -0.3), INTERPOLATED)
    assert [contact.inside for contact in contacts] == [True, False]
    assert [contact.approach for contact in contacts] == [0.8, 0.0]


@given(x=st.floats(-5, 5), y=st.floats(-0.3, 0.3), vx=st.floats(-8, 8), vy=st.floats(-8, 8))
@settings(deadline=None, max_examples=60)
def test_touch_is_the_two_laws_at_the_place_of_the_point(x, y, vx, vy):
    ground = Ground(restitution=0.3, normal_law="hunt-crossley")
    record, contact = ground.to_record(), new_contacts()[TOE]
    force = touch(contact, complex(x, y), complex(vx, vy), record)
    normal = friction = 0.0
    if y < 0:
        chi = 1.5 * (1 - 0.3)  # Hunt and Crossley's, which is not 1.05 in its last bit
        # Rounded as `touch` does, which multiplies by 1 / approach where the law divides
        damped = chi * -vy * (1 / max(-vy, 1e-4))
        normal = normal_force(-y, damped, 1.0, 2e4, 1.5, 1.0, 0.0)
        friction = friction_force(vx, normal, 0, 0.4, 1e-3, 1e-2)
    assert force == complex(friction, normal)
    assert (contact.x, contact.vx, contact.penetration, contact.rate) == (x, vx, -y, -vy)
    assert (contact.normal, contact.friction) == (normal, friction)


def test_a_penetration_without_bounds_has_a_force_without_bounds():
    """As in a solution that diverges, which is no error of Python's."""
    contact = new_contacts()[TOE]
    assert touch(contact, complex(0.0, -1e250), 0j, INTERPOLATED).imag == np.inf
