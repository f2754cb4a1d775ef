"""Each scheme by its order, its use of time, and what semi-implicit Euler keeps bounded."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env.dynamics.constrained import INTEGRATORS

ORDERS = {"euler": 1, "semi_implicit_euler": 1, "midpoint": 2, "rk4": 4}


def forced_oscillator(time, q, qd):
    """q'' = -q - q'/5 + cos 3t, in two components."""
    return -q - 0.2 * qd + np.array([np.cos(3 * time), np.sin(time)])


def run(scheme, acceleration, q, qd, h, steps):
    for k in range(steps):
        start = k * h
        q, qd = scheme(lambda elapsed, x, v, t0=start: acceleration(t0 + elapsed, x, v), q, qd, h)
    return np.concatenate([q, qd])


def test_every_scheme_has_its_known_order():
    assert set(ORDERS) == set(INTEGRATORS)


@pytest.mark.parametrize(("name", "order"), ORDERS.items())
def test_order_of_convergence(name, order):
    from scipy.integrate import solve_ivp

    q, qd = np.array([1.0, -0.5]), np.array([0.3, 2.0])
    exact = solve_ivp(
        lambda t, u: np.concatenate([u[2:], forced_oscillator(t, u[:2], u[2:])]),
        (0, 1), np.concatenate([q, qd]), method="DOP853", rtol=1e-13, atol=1e-13,
    ).y[:, -1]  # fmt: skip
    errors = [
        np.abs(run(INTEGRATORS[name], forced_oscillator, q, qd, 1 / n, n) - exact).max()
        for n in (25, 50, 100)
    ]
    slopes = np.diff(-np.log2(errors))
    assert slopes == pytest.approx(order, abs=0.15)


def test_rk4_integrates_a_quadratic_acceleration_exactly():
    q, qd = INTEGRATORS["rk4"](lambda t, q, qd: np.array([t**2]), np.array([0.0]), np.array([0.0]), 0.7)
    assert q == pytest.approx(0.7**4 / 12)
    assert qd == pytest.approx(0.7**3 / 3)


def test_only_semi_implicit_euler_keeps_an_oscillator_bounded():
    def energy(name):
        u = run(INTEGRATORS[name], lambda t, q, qd: -q, np.array([1.0]), np.array([0.0]), 0.05, 5000)
        return (u**2).sum() / 2

    assert energy("semi_implicit_euler") == pytest.approx(0.5, rel=0.06)
    assert energy("euler") > 1e4


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_arguments_are_not_changed(name):
    q, qd = np.array([1.0]), np.array([2.0])
    INTEGRATORS[name](lambda t, q, qd: -q, q, qd, 0.1)
    assert (q[0], qd[0]) == (1.0, 2.0)
