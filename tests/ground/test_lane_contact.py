"""The contact as plain functions is the contact with records: and it accounts for energy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from hoof_env.ground import friction
from hoof_env.ground import lane_contact as lanes
from hoof_env.ground import normal_force as reference
from hoof_env.ground.contact import TOE, Ground, latch, new_contacts
from hoof_env.ground.exact_math import root_power, root_power_lanes

FLOOR = 1e-2
laws = st.sampled_from(range(len(friction.FRICTION_LAWS)))
depths = st.floats(-0.1, 0.2).filter(lambda d: d == 0 or abs(d) > 1e-9)
rates = st.floats(-5, 5)


def latched(stored, before, now, interpolated):
    return lanes.approach_speed(stored > 0, stored, *before, *now, FLOOR, interpolated)


@given(st.lists(st.tuples(depths, rates), min_size=1, max_size=30), st.booleans())
@settings(deadline=None, max_examples=300)
def test_it_latches_as_the_record_does(path, interpolated):
    ground = Ground(approach_floor=FLOOR, approach="interpolated" if interpolated else "sampled").to_record()
    contact, stored, before = new_contacts()[TOE], 0.0, (0.0, 0.0)
    for now in path:
        latch(contact, *now, ground)
        as_number = lanes.approach_speed(float(stored > 0), stored, *before, *now, FLOOR, interpolated)
        stored = latched(stored, before, now, interpolated)
        assert stored == as_number == contact["approach"]
        before = now


@given(
    d=depths, rate=rates, v0=st.floats(FLOOR, 5), k=st.floats(1e3, 1e7), eighths=st.integers(8, 24),
    chi=st.floats(0, 2), dashpot=st.sampled_from([0.0, 500.0]),
)  # fmt: skip
@settings(deadline=None, max_examples=500)
def test_the_normal_force_is_that_of_the_law(d, rate, v0, k, eighths, chi, dashpot):
    force = lanes.normal_force(d, rate, v0, root_power(d, eighths), k, chi, dashpot)
    expected = reference.normal_force(d, rate, v0, k, eighths / 8, chi, dashpot)
    terms = k * max(d, 0) ** (eighths / 8) * (1 + chi * abs(rate) / v0) + dashpot * abs(rate)
    assert force == pytest.approx(expected, rel=1e-12, abs=1e-12 * terms)
    assert force >= 0


@given(
    v=st.floats(-20, 20) | st.floats(-0.02, 0.02), law=laws, normal=st.floats(0, 1e4), slow=st.floats(0, 0.01)
)
@settings(deadline=None, max_examples=500)
def test_friction_is_that_of_the_law(v, law, normal, slow):
    settings_ = (law, 0.4, slow, slow + 0.02)
    mu = lanes.friction_coefficient(abs(v), *settings_)
    assert mu == pytest.approx(friction.friction_coefficient(abs(v), *settings_), rel=0, abs=1e-13)
    expected = friction.friction_force(v, normal, *settings_)
    assert lanes.friction_force(v, normal, mu) == pytest.approx(expected, rel=0, abs=1e-13 * max(normal, 1))


@given(d=depths, rate=rates, v0=st.floats(FLOOR, 5), v=rates, chi=st.floats(0, 2), law=laws)
@settings(deadline=None, max_examples=300)
def test_what_the_leg_gives_is_stored_or_lost(d, rate, v0, v, chi, law):
    k, power = 2e4, root_power(d, 12)
    normal = lanes.normal_force(d, rate, v0, power, k, chi, 100.0)
    force = lanes.friction_force(v, normal, lanes.friction_coefficient(abs(v), law, 0.4, 1e-3, 1e-2))
    elastic, damping, sliding = lanes.contact_power(d, rate, power, normal, k, v, force)
    assert elastic + damping + sliding == pytest.approx(normal * rate - force * v, rel=1e-9, abs=1e-9)
    assert damping >= -1e-12 * abs(elastic)
    assert sliding >= 0


@pytest.mark.parametrize("eighths", [8, 11, 12, 16, 24])
def test_the_elastic_power_is_the_rate_of_the_elastic_energy(eighths):
    d, step, k = 0.03, 1e-5, 2e4
    energy = [lanes.elastic_energy(x, root_power(x, eighths), k, eighths / 8) for x in (d - step, d + step)]
    elastic, _, _ = lanes.contact_power(d, 1.0, root_power(d, eighths), 0.0, k, 0.0, 0.0)
    assert elastic == pytest.approx((energy[1] - energy[0]) / (2 * step), rel=1e-6)
    assert lanes.elastic_energy(-d, 0.0, k, eighths / 8) == 0


def test_above_the_ground_there_is_nothing_whatever_is_stored():
    assert lanes.normal_force(-0.1, 1.0, 0.0, 0.0, 2e4, 0.5, 10.0) == 0
    assert lanes.contact_power(-0.1, 1.0, 0.3, 0.0, 2e4, 1.0, 0.0) == (0, 0, 0)


def test_what_is_not_a_number_stays_so():
    nan = math.nan
    assert math.isnan(lanes.normal_force(nan, 1.0, 1.0, nan, 2e4, 0.5, 0.0))
    assert math.isnan(lanes.normal_force(0.1, nan, 1.0, 0.01, 2e4, 0.5, 0.0))
    assert all(math.isnan(lanes.friction_part(nan, law, 1e-3, 1e-2)) for law in range(3))
    assert math.isnan(latched(0.0, (-0.1, nan), (0.1, nan), True))


@njit(error_model="numpy")
def all_lanes(before, now, stored, velocity, law, parts, speed, power, out):
    root_power_lanes(now[0], 12, power)
    for lane in range(speed.size):
        speed[lane] = abs(velocity[lane])
    lanes.friction_part_lanes(speed, law, 1e-3, 1e-2, parts)
    for lane in range(speed.size):
        d, rate = now[0, lane], now[1, lane]
        v0 = lanes.approach_speed(
            stored[lane] > 0.0, stored[lane], before[0, lane], before[1, lane], d, rate, 1e-2, True
        )
        force = lanes.normal_force(d, rate, v0, power[lane], 2e4, 0.5, 0.0)
        out[0, lane] = v0
        out[1, lane] = force
        out[2, lane] = lanes.friction_force(velocity[lane], force, 0.4 * parts[lane])


@pytest.mark.parametrize("law", range(3))
@pytest.mark.parametrize("count", [3, 64, 1000])
def test_a_lane_has_the_bits_that_it_has_alone(law, count):
    rng = np.random.default_rng(count)
    before, now = rng.normal(scale=0.02, size=(2, 2, count))
    stored = np.where(before[0] > 0, 0.3, 0.0)
    velocity = rng.normal(scale=0.02, size=count)
    together = np.empty((3, count))
    all_lanes(before, now, stored, velocity, law, *np.empty((3, count)), together)
    for lane in range(count):
        one, alone = slice(lane, lane + 1), np.empty((3, 1))
        rows = (np.ascontiguousarray(a[..., one]) for a in (before, now, stored, velocity))
        all_lanes(*rows, law, *np.empty((3, 1)), alone)
        np.testing.assert_array_equal(alone[:, 0].view(np.int64), together[:, lane].copy().view(np.int64))
