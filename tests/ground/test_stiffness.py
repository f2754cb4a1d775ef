"""The rule for the step length against a bouncing mass: its promise holds, and not by a wide margin."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hoof_env.ground.contact import Ground
from hoof_env.ground.stiffness import SCHEME_LIMITS, ContactRates, contact_rates
from hoof_env.ground.terrain import Terrain
from tests.ground.plain_laws import friction_force, normal_force

GRAVITY = 9.81
STAGES = {  # fractions of the step, each stage from the one before, and weights
    "midpoint": ((0, 1 / 2), (0, 1)),
    "rk3": ((0, 1 / 3, 2 / 3), (1 / 4, 0, 3 / 4)),
    "rk4": ((0, 1 / 2, 1 / 2, 1), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}
FLOOR = 1e-4


def approach_speed(kept, d_before, rate_before, d, rate):
    """At the interpolated touch-down, held while the point stays inside; 0 outside."""
    if d <= 0.0 or kept > 0.0:
        return 0.0 if d <= 0.0 else kept
    part = d_before / (d_before - d) if d_before < 0.0 else 1.0
    return max(rate_before + part * (rate - rate_before), FLOOR)


def pull(d, rate, v0, mass, k, n, chi, weight):
    return (weight - normal_force(d, rate, v0, k, n, chi, 0.0)) / mass


def fall(d, rate, h, steps, fractions, weights, mass, k, n, chi, weight):
    """Depth and rate after some steps; the approach speed is latched at whole steps, provisional within."""
    before, rate_before, v0 = d, rate, 0.0
    for _ in range(steps):
        v0 = approach_speed(v0, before, rate_before, d, rate)
        before, rate_before = d, rate
        speed, acc = rate, pull(d, rate, v0, mass, k, n, chi, weight)
        if len(fractions) == 0:  # semi-implicit Euler
            rate = rate + h * acc
            d = d + h * rate
            continue
        mean_speed, mean_acc = weights[0] * speed, weights[0] * acc
        for j in range(1, len(fractions)):
            at, speed = before + fractions[j] * h * speed, rate_before + fractions[j] * h * acc
            latched = approach_speed(v0, before, rate_before, at, speed)
            acc = pull(at, speed, latched, mass, k, n, chi, weight)
            mean_speed, mean_acc = mean_speed + weights[j] * speed, mean_acc + weights[j] * acc
        d, rate = d + h * mean_speed, rate + h * mean_acc
    return d, rate


def exact_bounce(speed, depth, *law):
    """Time in the ground [s], rate at lift-off [m/s] and deepest penetration [m]; `depth` is its scale."""

    def motion(_, y):
        return y[1], pull(y[0], y[1], speed, *law) if y[0] > 0 else law[4] / law[0]

    def leaves(t, y):
        return y[0] if t > 0 else 1.0

    leaves.terminal, leaves.direction = True, -1
    tight = {"rtol": 1e-11, "atol": [1e-13 * depth, 1e-13 * speed], "max_step": 0.05 * depth / speed}
    path = solve_ivp(motion, (0, 30 * depth / speed), (0, speed), "DOP853", events=leaves, **tight)
    assert path.t_events[0].size, "the mass stays"
    return path.t[-1], path.y[1, -1], path.y[0].max()


def error(scheme, h, bounce, speed, law, phases=16):
    """Of the state after the bounce, the worst over the places of the touch-down within a step."""
    duration, lift_off, deepest = bounce
    g = law[4] / law[0]
    stages = STAGES.get(scheme, ((), ()))
    worst = 0.0
    for phase in range(phases):
        lead = (2 + (phase + 0.5) / phases) * h
        steps = math.ceil((lead + duration) / h) + 1
        d, rate = fall(-(speed * lead - g * lead**2 / 2), speed - g * lead, h, steps, *stages, *law)
        rest = steps * h - lead - duration
        off = abs(d - lift_off * rest - g * rest**2 / 2) / deepest
        worst = max(worst, off, abs(rate - lift_off - g * rest) / speed)
    return worst


@pytest.mark.parametrize("n", [1.0, 1.375, 1.5, 2.0, 3.0])
def test_the_error_of_a_bounce_is_within_the_rule_and_near_it(n):
    share = {scheme: [] for scheme in SCHEME_LIMITS}
    for chi, weight in ((0.0, 0.0), (0.0, 0.3), (0.75, 0.1), (3.0, 0.0)):
        depth = ((n + 1) / 2) ** (1 / (n + 1))
        law = (1.0, 1.0, n, chi, weight * depth**n)
        bounce = exact_bounce(1.0, depth, *law)
        rates = contact_rates(Ground(stiffness=1.0, exponent=n), 1.0, law[4], speed=1.0)
        for scheme, limits in SCHEME_LIMITS.items():
            for angle in (0.4, 0.1, 0.025):
                bound = limits.error * angle ** min(limits.order, n + 1)
                h = rates.longest_steps(scheme, bound)["elastic"]
                assert h == pytest.approx(angle / rates.elastic)
                share[scheme].append(error(scheme, h, bounce, 1.0, law) / bound)
    for scheme, shares in share.items():
        assert max(shares) < 1, scheme
        if n == 1:
            assert max(shares) > 0.7, scheme  # no idle margin
        if n == 1.5:
            assert max(shares) < (0.7 if scheme in ("semi_implicit_euler", "midpoint") else 0.4), scheme


@pytest.mark.parametrize("scheme", SCHEME_LIMITS)
@pytest.mark.parametrize("mass", [3.0, 125.0])
def test_a_quarter_of_a_horse_on_stiff_ground(scheme, mass):
    """125 kg, and 3 kg, at 1 m/s on 1e6 N/m^1.5."""
    ground = Ground(stiffness=1e6, exponent=1.5)
    rates = contact_rates(ground, mass, mass * GRAVITY, speed=1.0)
    law = (mass, 1e6, 1.5, 0.0, mass * GRAVITY)
    bounce = exact_bounce(1.0, (1.25 * mass / 1e6) ** 0.4, *law)
    for tolerance in (1e-2, 1e-3):
        h = rates.longest_steps(scheme, tolerance)["elastic"]
        assert error(scheme, h, bounce, 1.0, law) < tolerance


def test_the_step_of_that_horse():
    """A millisecond is short enough for 125 kg on a spring; 3 kg under their weight need three parts."""
    ground = Ground(stiffness=1e6, exponent=1.5, friction=0.0)

    def longest(mass, scheme):
        return min(contact_rates(ground, mass, 125 * GRAVITY).longest_steps(scheme).values())

    assert longest(125.0, "midpoint") > 1e-3
    assert 1e-3 / 3 < longest(3.0, "midpoint") < 1e-3 / 2
    assert longest(3.0, "rk3") > 1e-3


@pytest.mark.parametrize("scheme", STAGES)
@pytest.mark.parametrize("law", ["ambrosio", "threlfall", "tanh"])
def test_friction_comes_to_rest_within_its_limit(scheme, law):
    ground = Ground(stiffness=1e6, friction_law=law)
    mass, load = 3.0, 600.0
    rates = contact_rates(ground, mass, load, speed=0.0)
    force = ((ground.exponent + 1) * load) * (1 + 1e-9)  # the overshoot that the rate is for
    limit = rates.longest_steps(scheme)["friction"]
    index = ("ambrosio", "threlfall", "tanh").index(law)

    def slide(v):
        settings = (index, ground.friction, ground.friction_slow, ground.friction_fast)
        return friction_force(v, force, *settings) / mass

    def fastest_in_the_end(h, v=0.1):
        speeds = []
        for _ in range(400):
            acc = mean = 0.0
            for fraction, weight in zip(*STAGES[scheme], strict=True):
                acc = slide(v + fraction * h * acc)
                mean += weight * acc
            v += h * mean
            speeds.append(abs(v))
        return max(speeds[200:])

    assert fastest_in_the_end(limit) <= 1.001 * ground.friction_slow
    for factor in (5, 10, 20):
        assert fastest_in_the_end(factor * limit) <= 1.5 * ground.friction * force * factor * limit / mass


@pytest.mark.parametrize("scheme", STAGES)
def test_a_slow_touch_down_under_load_is_damped_without_ringing(scheme):
    """Light hoof, heavy load, strong damping: the fastest motion is the decay."""
    ground = Ground(stiffness=1e6, exponent=1.5, restitution=0.0)
    mass, load, speed = 3.0, 600.0, 0.05
    rates = contact_rates(ground, mass, load, speed)
    assert rates.damping > rates.elastic
    h = min(rates.longest_steps(scheme)[name] for name in ("elastic", "damping"))
    d, rate = fall(-1e-9, speed, h, int(2 / h), *STAGES[scheme], mass, 1e6, 1.5, 0.75, load)
    assert d == pytest.approx((load / 1e6) ** (1 / 1.5), rel=1e-6)
    assert rate == pytest.approx(0, abs=1e-6)


def test_rates_follow_their_formulas():
    ground = Ground(2e4, 1.0, normal_law="kelvin-voigt", restitution=0.5, friction_law="tanh")
    terrain = Terrain((0, 0), stiffness=(1, 4), friction=(2, 0.5))
    rates = contact_rates(ground, 8.0, 100.0, sliding_mass=2.0, terrain=terrain)
    depth = (2 * 8.0 * 0.1**2 / (2 * 8e4)) ** 0.5 + 2 * 100 / 8e4
    assert rates.elastic == pytest.approx(math.sqrt(8e4 / 8))
    assert rates.damping == pytest.approx(ground.damping[1] / 8)
    assert rates.friction == pytest.approx(0.8 * 8e4 * depth / 0.01 / 2)
    free = ContactRates(0.0, 0.0, 0.0, 1.5)
    assert set(free.longest_steps("rk4").values()) == {math.inf}


@pytest.mark.parametrize("scheme", SCHEME_LIMITS)
def test_decay_is_followed_to_half_of_where_a_scheme_is_stable(scheme):
    """The factor by which a step of `h rate` multiplies what decays, by the scheme's own stages."""

    def factor(x):
        if scheme == "semi_implicit_euler":
            return 1 - x
        fractions, weights = STAGES[scheme]
        slope = -x
        mean = weights[0] * slope
        for fraction, weight in zip(fractions[1:], weights[1:], strict=True):
            slope = -x * (1 + fraction * slope)
            mean += weight * slope
        return 1 + mean

    steps = np.linspace(0.01, 4, 400)
    stable = steps[np.argmax(np.abs([factor(x) for x in steps]) > 1) - 1]
    assert SCHEME_LIMITS[scheme].decay == pytest.approx(stable / 2, abs=0.01)
