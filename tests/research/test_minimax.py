"""Descents on problems whose answer is known, and on the leg against CMA-ES."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from research.identify.leg import encode
from research.identify.minimax import Rating, descend
from research.identify.objective import Objective
from tests.legs import FIRST_FIT

MET = np.array([-1.0])


def test_the_best_polynomial_is_found_and_its_errors_alternate():
    """Chebyshev: the best quadratic for exp on [-1, 1] errs equally, with changing sign, at four points."""
    t = np.linspace(-1, 1, 201)
    powers = np.vander(t, 3)

    def rate(y):
        return Rating(powers @ y - np.exp(t), MET, {})

    found = descend(rate, np.zeros(3), np.ones(3), radius=0.3)
    errors = found.rating.rows
    assert np.abs(errors).max() == pytest.approx(0.0450174, rel=1e-3)  # Powell 1981, table 7.1's example
    tops = [k for k in range(1, 200) if abs(errors[k]) >= 0.999 * np.abs(errors).max()]
    signs = np.sign([errors[0], *errors[tops], errors[-1]])
    assert np.count_nonzero(np.diff(signs)) == 3


def test_a_curved_valley_with_a_limit():
    """Madsen's problem of three rows, and the same with x1 >= 0.5, whose optimum lies on the limit."""

    def rows(y):
        return np.array([y[0] ** 2 + y[1] ** 2 + y[0] * y[1], np.sin(y[0]), np.cos(y[1])])

    free = descend(lambda y: Rating(rows(y), MET, {}), np.array([3.0, 1.0]), np.ones(2), radius=0.3)
    assert np.abs(free.rating.rows).max() == pytest.approx(0.6164324, abs=1e-4)
    held = descend(
        lambda y: Rating(rows(y), np.array([0.5 - y[0]]), {}), np.array([3.0, 1.0]), np.ones(2), radius=0.3
    )
    assert held.rating.demands[0] == pytest.approx(0.0, abs=1e-6)
    z = brentq(lambda z: 0.25 + z**2 + 0.5 * z - np.cos(z), -2, 0)  # where two rows cross on the limit
    assert np.abs(held.rating.rows).max() == pytest.approx(np.cos(z), abs=1e-4)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_it_never_ends_worse_than_it_began_and_counts_what_it_spends(seed):
    rng = np.random.default_rng(seed)
    a, b, c = rng.normal(size=(6, 4)), rng.normal(size=6), rng.normal(size=(2, 4))
    calls = []

    def rate(y):
        calls.append(y)
        return Rating(a @ y + 0.3 * np.sin(3 * b * y.sum()), c @ y - 1.0, {})

    start = rng.normal(size=4)
    before = rate(start).merit(2.0)
    calls.clear()
    found = descend(rate, start, np.ones(4), central=bool(rng.integers(2)))
    assert found.rating.merit(2.0) <= before
    assert found.evaluations == len(calls)
    again = descend(rate, start, np.ones(4), central=False)
    assert again.y.tolist() == descend(rate, start, np.ones(4), central=False).y.tolist()


def test_the_highest_of_many_values_needs_all_of_them():
    """Two peaks of one row cross where it is lowest: told of both, a descent arrives there."""

    def peaks(y):
        return np.array([1.0 + y[0] + 0.1 * y[1] ** 2, 1.0 - 2 * y[0] + 0.1 * y[1] ** 2])

    def told(y):
        return Rating(np.array([peaks(y).max()]), MET, {0: peaks(y)})

    found = descend(told, np.array([0.4, 1.0]), np.ones(2))
    np.testing.assert_allclose(found.y[0], 0.0, atol=1e-6)
    assert found.rating.merit(1.0) == pytest.approx(1.0, abs=1e-3)


def test_a_goal_ends_it_early_and_a_rating_without_numbers_is_survived():
    goal = descend(lambda y: Rating(y - 3.0, MET, {}), np.zeros(2), np.ones(2), goal=2.0)
    assert goal.rating.merit(1.0) <= 2.0
    assert np.abs(goal.y).max() < 3.0

    def broken(y):
        return Rating(np.where(y > 0.5, 1e300, y - 3.0), np.where(y > 0.5, 1e300, -1.0), {})

    found = descend(broken, np.zeros(2), np.ones(2))
    assert found.rating.merit(1.0) == pytest.approx(2.5, abs=1e-3)


def test_a_rating_is_the_objectives_rows_and_shortages():
    choice, x = encode(FIRST_FIT)
    for paper_solver in (False, True):
        objective = Objective(choice, samples=2001, paper_solver=paper_solver)
        rating = objective.rate(x)
        np.testing.assert_allclose(rating.rows[:22], objective.rows(x), atol=0.02)
        positive = rating.demands[rating.demands > 0.01]
        assert sorted(positive - 0.01) == pytest.approx(sorted(objective.plausibility(x).values()), abs=1e-6)
