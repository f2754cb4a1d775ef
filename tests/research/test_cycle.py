"""Paths of the linkage and its variants: lengths kept, rates true, laws that coincide where they must."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numba import njit

from hoof_env.leg.geometry import load_geometry, tables
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS
from research.identify.candidate import LINK9, SWINGS, decode, names, random_choice, random_start
from research.identify.cycle import leg_paths, swing_hoof
from research.identify.evaluate import construction
from research.identify.features import FEATURES, measure_gait
from research.identify.objective import Objective

NUMBER = {name: i for i, name in enumerate((*POINTS, "Q"))}
N = 721


@cache
def turning_leg(link9, swing="crank"):
    """A random leg of this kind that turns well clear of its dead points."""
    rng = np.random.default_rng(5)
    while True:
        choice = random_choice(rng, (link9,), (swing,))
        objective = Objective(choice)
        for _ in range(200):
            x = random_start(choice, rng)
            leg = objective.measured(x)
            if leg["leg.miss"] <= 0 and leg["leg.transmission"] > 0.2:
                return choice, x


def paths(choice, x, n=N, oval=(0j, 0j)):
    """Points and derivatives, miss and transmission; `values` made in plain Python."""
    leg, sign = decode(x, choice), dict(zip("BDFEJI", choice.assembly, strict=True))
    steps, _ = construction(choice)
    s, part = leg.lengths, leg.link9.get("part", 0.0)
    middle = {
        "F": lambda: [(s["CF"], s["PF"], sign["F"]), (s["DE"], s["EF"], sign["E"])],
        "E": lambda: [(s["DE"], s["PE"], sign["E"]), (s["CF"], s["EF"], sign["F"])],
        "6": lambda: [(part * s["DE"], s["PQ"], sign["E"]), (1 / part,), (s["CF"], s["EF"], sign["F"])],
        "7": lambda: [
            (s["DE"], s["EF"], s["CF"], s["PQ"], part, leg.link9["angle_DE"], leg.link9["angle_CF"]),
            (part,),
        ],
    }[choice.link9]()
    rows = [
        (s["CB"], s["PB"], sign["B"]), (s["CD"], s["BD"], sign["D"]), *middle,
        (s["FG"] / s["EF"],), (s["CA"] / s["CF"],),
        (s["GJ"], s["AJ"], sign["J"]), (s["GI"], s["IJ"], sign["I"]),
    ]  # fmt: skip
    values = np.array([(*row, *[0.0] * (7 - len(row))) for row in rows])
    z, dz = np.zeros((2, len(NUMBER), n), np.complex128)
    found = leg_paths(s["OP"], complex(*leg.pivot), np.array(oval), steps, values, z, dz)
    return z, dz, *found


@pytest.mark.parametrize("link9", LINK9)
def test_every_link_keeps_its_length(link9):
    choice, x = turning_leg(link9)
    z, _, miss, transmission = paths(choice, x)
    assert miss <= 0
    assert 0.1 < transmission <= 1
    lengths, link9_at = decode(x, choice).lengths, decode(x, choice).link9
    for name, length in lengths.items():
        one, two = (z[NUMBER[letter]] for letter in name)
        np.testing.assert_allclose(abs(two - one), length, rtol=0, atol=1e-9, err_msg=name)
    for on, end in ((("E", "F"), "G"), (("C", "F"), "A")):  # collinear
        one, two, three = (z[NUMBER[p]] for p in (*on, end))
        np.testing.assert_allclose((np.conj(two - one) * (three - one)).imag, 0, atol=1e-9)
    if link9 in "67":
        start, end = (z[NUMBER[p]] for p in ("DE" if link9 == "6" else "EF"))
        np.testing.assert_allclose(z[NUMBER["Q"]], start + link9_at["part"] * (end - start), atol=1e-9)


@pytest.mark.parametrize("link9", LINK9)
@pytest.mark.parametrize("oval", [(0j, 0j), (0.004 + 0.003j, -0.002 + 0.005j)])
def test_rates_are_the_derivatives_of_the_paths(link9, oval):
    z, dz, _, _ = paths(*turning_leg(link9), n=20001, oval=oval)
    h = 2 * np.pi / 20000
    fourth = (z[:, :-4] - 8 * z[:, 1:-3] + 8 * z[:, 3:-1] - z[:, 4:]) / (12 * h)
    np.testing.assert_allclose(dz[:, 2:-2], fourth, rtol=0, atol=1e-6)


def test_the_ellipse_of_the_pivot():
    choice, x = turning_leg("F", "oval")
    still, _, _, _ = paths(choice, x)
    moved, _, _, _ = paths(choice, x, oval=(0.03j, 0.01 + 0j))
    theta = np.linspace(0, 2 * np.pi, N)
    shift = 0.03j * np.exp(1j * theta) + 0.01 * np.exp(-1j * theta)
    np.testing.assert_allclose(moved[NUMBER["C"]] - still[NUMBER["C"]], shift, atol=1e-12)


def test_the_paths_are_those_of_the_product():
    geometry = load_geometry("first_fit")
    z, dz = np.zeros((2, len(POINTS), 9), np.complex128)
    miss, transmission = leg_paths(
        geometry.lengths["OP"], complex(*geometry.pivot), np.zeros(2, np.complex128), *tables(geometry), z, dz
    )
    assert miss <= 0
    assert transmission >= geometry.transmission_margin - 1e-9
    mirror = np.array([geometry.travel, 1.0])
    for k, theta in enumerate(np.linspace(0, 2 * np.pi, 9)):
        there = pose(geometry, theta, 1.0)
        np.testing.assert_allclose(
            np.stack([z[:, k].real, z[:, k].imag], 1) * mirror, there.points, atol=1e-12
        )
        rates = np.stack([dz[:, k].real, dz[:, k].imag], 1) * mirror
        np.testing.assert_allclose(rates, there.point_velocities, atol=1e-8)


def test_the_hoof_swings_as_in_the_product():
    geometry, n = load_geometry("first_fit"), 9
    gait, toe, heel = np.array([3.0, 0.4, -0.3, 0.2]), POINTS.index(geometry.toe), POINTS.index(geometry.heel)
    z, dz = np.zeros((2, len(POINTS), n), np.complex128)
    leg_paths(
        geometry.lengths["OP"], complex(*geometry.pivot), np.zeros(2, np.complex128), *tables(geometry), z, dz
    )
    at, velocity, ankle = *np.zeros((2, 2, n), np.complex128), np.zeros(n)
    swing_hoof(z, dz, gait, False, float(geometry.travel), toe, heel, at, velocity, ankle)
    for k, theta in enumerate(np.linspace(0, 2 * np.pi, n)):
        phi = gait[1] + gait[2] * np.sin(theta) + gait[3] * np.cos(theta)
        rate = 3.0 * (gait[2] * np.cos(theta) - gait[3] * np.sin(theta))
        there = pose(geometry, theta, 3.0, frame=FrameMotion(phi, rate))
        for i, corner in enumerate((toe, heel)):
            assert at[i, k] == pytest.approx(complex(*there.points[corner]), abs=1e-10)
            assert velocity[i, k] == pytest.approx(complex(*there.point_velocities[corner]), abs=1e-8)
        assert ankle[k] == pytest.approx(there.point("G")[1], abs=1e-10)


@pytest.mark.parametrize("link9", LINK9)
def test_a_leg_that_does_not_close_misses(link9):
    choice, x = turning_leg(link9)
    x = x.copy()
    strut = next(i for i, name in enumerate(names(choice)) if name in ("log PF", "log PE", "log PQ"))
    x[strut] += 1.5
    z, dz, miss, _ = paths(choice, x)
    assert miss > 0.01
    assert np.isfinite(z).all()
    assert np.isfinite(dz).all()


@pytest.mark.parametrize("swing", SWINGS[1:])
def test_without_a_motion_all_swings_are_the_same(swing):
    """Neither a frame at rest nor a still pivot tells the laws apart, only where the origin is."""
    choice, x = turning_leg("F")
    entry = {name: i for i, name in enumerate(names(choice))}
    for gait in ("walk", "run"):
        x[[entry[f"{gait}.swing_offset"], entry[f"{gait}.swing_sin"], entry[f"{gait}.swing_cos"]]] = 0.3, 0, 0
    one = Objective(choice).measured(x)
    other = type(choice)(choice.assembly, choice.toe, choice.travel, "F", swing)
    if swing == "oval":
        y = np.concatenate([x[:18], [0.3, 0, 0, 0, 0], [0.3, 0, 0, 0, 0]])
    else:
        y = x.copy()
        y[entry["hip_height"]] += (complex(*x[15:17]) * np.exp(0.3j)).imag  # of C instead of O
    two = Objective(other).measured(y)
    same = [key for key in one if not key.startswith(("leg.hip", "leg.sole_part"))]
    np.testing.assert_allclose([one[k] for k in same], [two[k] for k in same], rtol=1e-9, atol=1e-9)


def test_a_swing_about_the_pivot_is_one_about_the_crank_with_a_moving_origin():
    """About C the hoof goes where it would about O, less the way that C goes about O."""
    choice, x = turning_leg("F")
    z, dz, _, _ = paths(choice, x)
    gait, toe, heel = np.array([2.0, 0.2, 0.3, -0.4]), POINTS.index("I"), POINTS.index("J")
    results = []
    for about_pivot in (False, True):
        at, velocity, ankle = *np.zeros((2, 2, N), np.complex128), np.zeros(N)
        lowest = swing_hoof(z, dz, gait, about_pivot, 1.0, toe, heel, at, velocity, ankle)
        results.append((at, velocity, ankle, lowest))
    theta = np.linspace(0, 2 * np.pi, N)
    phi = 0.2 + 0.3 * np.sin(theta) - 0.4 * np.cos(theta)
    rate = 2.0 * (0.3 * np.cos(theta) + 0.4 * np.sin(theta))
    origin = z[NUMBER["C"]] * np.exp(1j * phi)
    np.testing.assert_allclose(results[0][0] - origin, results[1][0], atol=1e-12)
    np.testing.assert_allclose(results[0][1] - 1j * rate * origin, results[1][1], atol=1e-11)
    np.testing.assert_allclose(results[0][2] - origin.imag, results[1][2], atol=1e-12)


@njit
def measured(at, velocity, ankle, speed, work, out):
    """With the literal False of the product's own calls: another type is five seconds of compiling more."""
    return measure_gait(at, velocity, ankle, 0.0, speed, False, 2e4, 1.5, work, out)


def test_points_that_begin_in_the_ground_and_have_no_whole_contact_have_no_stance():
    """The toe leaves and comes back, the heel leaves: neither has a first contact before its last."""
    t = np.linspace(0, 1, 101)
    at = 1j * np.array([(t - 0.1) * (0.3 - t), t - 0.5])
    velocity = 1j * np.array([0.4 - 2 * t, np.ones_like(t)])
    found = np.full(1, np.nan, FEATURES)
    work, speed = np.zeros((7, 101)), 2 * np.pi
    assert not measured(at, velocity, np.ones(101), speed, work, found[0])
    assert np.isnan(found["contact_start"][0])
    assert found["start_depth"][0] == pytest.approx(0.5)
    whole = 1j * np.array([0.01 - (t - 0.3) * (0.6 - t), 0.02 - (t - 0.3) * (0.6 - t)])  # the same way, once
    rates = 1j * np.array([2 * t - 0.9, 2 * t - 0.9])
    assert measured(whole, rates, np.ones(101), speed, work, found[0])
    assert 0.3 < found["contact_start"][0] < found["contact_end"][0] < 0.6
