"""Eq. 2 from the joint table against the paper's own rows, symbolic derivatives and Newton's method."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.gait import Motion
from hoof_env.leg.geometry import load_geometry
from hoof_env.paper_solver.constraints import Constraints, closed_form
from tests.legs import FIRST_FIT
from tests.linkage import BODY_LENGTHS, SIZE

GEOMETRY = load_geometry(FIRST_FIT)
CONSTRAINTS = Constraints(GEOMETRY)

# The joints of Eq. 2 as the paper shares them out: T and H are the tail and the head of a link, A8 is the
# point at distance CA from the head of link 8 towards its tail. (The print is garbled at F and A.)
PRINTED = (
    "T1=O", "T2=H1", "H3=H2", "T3=C", "H4=H2", "H5=T4", "T5=C", "H6=T4", "H7=T6", "T8=T7", "H8=C", "H9=T7",
    "T9=H1", "H10=T7", "T11=T10", "T12=H11", "H12=A8", "H13=T10", "T14=T13", "H14=T12",
)  # fmt: skip

angle = st.floats(-50, 50)
swing = st.floats(-1.5, 1.5)
rate = st.floats(-15, 15)


@pytest.fixture(scope="module")
def symbolic():
    """(q, qd, motion) -> Phi, its rate, Phi_q, dPhi/dphi, gamma: the rows differentiated symbolically.

    Coordinates move as q + qd tau, crank and swing with their accelerations too: Phi'' = -gamma at tau = 0.
    """
    q, qd, motion = sympy.symbols("q:42"), sympy.symbols("v:42"), sympy.symbols("m:6")
    tau = sympy.Symbol("tau")
    moved = [x + v * tau for x, v in zip(q, qd, strict=True)]
    theta, phi = (m[0] + m[1] * tau + m[2] * tau**2 / 2 for m in (motion[:3], motion[3:]))
    turn = sympy.Matrix([[sympy.cos(phi), -sympy.sin(phi)], [sympy.sin(phi), sympy.cos(phi)]])

    def place(end):
        if end in "OC":
            return turn * sympy.Matrix(GEOMETRY.pivot if end == "C" else (0, 0))
        body = int(end[1:]) - 1
        x, y, th = moved[3 * body : 3 * body + 3]
        length = GEOMETRY.lengths[BODY_LENGTHS[body]]
        along = {"T": -length / 2, "H": length / 2, "A": length / 2 - GEOMETRY.lengths["CA"]}[end[0]]
        return sympy.Matrix([x + along * sympy.cos(th), y + along * sympy.sin(th)])

    rows = [
        component
        for joint in PRINTED
        for component in place(joint.split("=")[0]) - place(joint.split("=")[1])
    ]
    rows += [moved[3 * 9 + 2] - moved[3 * 6 + 2], moved[2] + theta - phi]
    constraint = sympy.Matrix(rows)
    slopes = constraint.jacobian(q), constraint.diff(motion[3])
    results = (constraint, constraint.diff(tau), *slopes, -constraint.diff(tau, 2))
    return sympy.lambdify((q, qd, motion), [r.subs(tau, 0) for r in results], cse=True)


def test_jacobian_and_gamma_are_the_derivatives_of_the_printed_rows(symbolic):
    generator = np.random.default_rng(0)
    for _ in range(20):  # anywhere, also with the loops open
        q, qd, m = generator.normal(size=42), generator.normal(size=42), generator.normal(size=6)
        closure = CONSTRAINTS(q, qd, Motion(*m))
        names = ("error", "error_rate", "jacobian", "by_phi", "gamma")
        for name, expected in zip(names, symbolic(q, qd, m), strict=True):
            got = getattr(closure, name)
            np.testing.assert_allclose(got, np.reshape(expected, got.shape), atol=1e-13, err_msg=name)


@settings(max_examples=100, deadline=None)
@given(angle, rate, swing, rate, st.sampled_from([1, -1]))
def test_the_closed_form_solves_position_and_velocity(theta, theta_rate, phi, phi_rate, travel):
    motion = Motion(theta, theta_rate, phi=phi, phi_rate=phi_rate)
    closure = CONSTRAINTS(*closed_form(GEOMETRY.replace(travel=travel), motion), motion)
    assert np.abs(closure.error).max() < 1e-12
    assert np.abs(closure.error_rate).max() < 1e-12 * (1 + abs(theta_rate) + abs(phi_rate))


@settings(max_examples=25, deadline=None)
@given(angle, swing, st.integers(0, 2**32 - 1))
def test_newton_returns_to_the_closed_form(theta, phi, seed):
    motion = Motion(theta, phi=phi)
    exact, rest = closed_form(GEOMETRY, motion)
    q = exact + np.random.default_rng(seed).uniform(-1e-2, 1e-2, SIZE)
    for _ in range(8):
        closure = CONSTRAINTS(q, rest, motion)
        q = q - np.linalg.solve(closure.jacobian, closure.error)
    np.testing.assert_allclose(q, exact, atol=1e-12)


def test_nothing_is_free():
    for theta in np.linspace(0, 2 * np.pi, 60):
        motion = Motion(theta, phi=0.3)
        assert np.linalg.matrix_rank(CONSTRAINTS(*closed_form(GEOMETRY, motion), motion).jacobian) == 42
