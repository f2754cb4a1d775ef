"""Force columns: the centre of pressure, the threshold, body weights, and frame and signs on a slope."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hoof_env import Terrain, records
from hoof_env.constants import GRAVITY
from hoof_env.envs.policies import make_policy
from hoof_env.lab.forces import above_threshold, in_units, limbs_of, loaded, onto_surface
from hoof_env.record.columns import RECORD
from hoof_env.tasks.horse_gaits import LEGS

ANGLES = (-0.05, 0.0, 0.05)


def on_slope(angle):
    """A record of the leg on a slope [rad], under a trunk that is held."""
    slope = {"height": [-1000 * math.tan(angle), 1000 * math.tan(angle)], "start": -1000.0, "spacing": 2000.0}
    with gym.make("hoof_env/HorseLegTerrain-v0", terrain=slope, trunk="fixed") as env:
        return records.record_episode(env, make_policy("run", env), 2, 1.5), env.unwrapped.weight


@pytest.fixture(scope="module")
def slopes():
    return {angle: on_slope(angle) for angle in ANGLES}


@pytest.mark.parametrize("angle", ANGLES)
def test_on_a_slope_forces_are_the_world_s_and_the_centre_lies_on_the_surface(slopes, angle):
    """Turned by the slope, force_x and force_y are friction along and normal force across it."""
    record, _ = slopes[angle]
    bears = loaded(record, "")
    assert 0.1 < bears.mean() < 0.9
    force = (record["force_x"] + 1j * record["force_y"]) * np.exp(-1j * angle)
    np.testing.assert_allclose(force.imag, record["toe_normal"] + record["heel_normal"], atol=1e-8)
    np.testing.assert_allclose(force.real, record["toe_friction"] + record["heel_friction"], atol=1e-8)
    assert (force.imag[bears] > 0).all()
    np.testing.assert_allclose(
        record["cop_y"][bears], np.tan(angle) * record["cop_x"][bears], atol=1e-9
    )  # through (0, 0)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_forces_have_no_moment_about_the_centre(slopes, angle):
    record, _ = slopes[angle]
    moment = sum(
        (record[f"{point}_x"] - record["cop_x"]) * record[f"{point}_force_y"]
        - (record[f"{point}_y"] - record["cop_y"]) * record[f"{point}_force_x"]
        for point in ("toe", "heel")
    )
    bears = loaded(record, "")
    assert np.abs(moment[bears]).max() < 1e-6
    between = [np.minimum(record["toe_x"], record["heel_x"]), np.maximum(record["toe_x"], record["heel_x"])]
    apart = np.maximum(between[0] - record["cop_x"], record["cop_x"] - between[1])[bears]
    depth = max((record["cop_y"] - record[f"{point}_y"])[bears].max() for point in ("toe", "heel"))
    tilt = np.abs(record["force_x"][bears] / record["force_y"][bears]).max()
    assert apart.max() < depth * tilt  # as far as friction tilts the force over the depth of the hoof


@pytest.mark.parametrize("angle", [0.0, 0.03])
def test_over_a_stride_a_horse_s_vertical_forces_bear_its_weight(angle):
    """On a slope, too: what is vertical is the world's."""
    with gym.make("hoof_env/Horse-v0", target_speed=1.853, terrain=Terrain.slope(angle).to_dict()) as env:
        record = records.record_episode(env, make_policy("reference", env), 1, 2.0)
        weight = env.unwrapped.weight
    upward = sum(record[f"{leg}_force_y"] for leg in LEGS)
    time = record["time"]
    mean = np.trapezoid(upward, time) / time[-1]
    change = weight / GRAVITY * (record["vy"][-1] - record["vy"][0]) / time[-1]
    assert mean == pytest.approx(weight + change, rel=0.05)
    for leg in LEGS:
        bears = loaded(record, f"{leg}_")
        assert bears.any()
        height = math.tan(angle) * record[f"{leg}_cop_x"][bears]
        np.testing.assert_allclose(record[f"{leg}_cop_y"][bears], height, atol=1e-9)


def test_vertical_forces_on_level_ground_act_at_the_weighted_mean():
    toe, heel = np.array([300.0, 0.0]), np.array([100.0, 0.0])
    record = {
        "force_x": np.zeros(2), "force_y": toe + heel,
        "cop_x": np.array([(300 * 1.2 + 100 * 1.0) / 400, 0.0]), "cop_y": np.array([-0.03, 0.0]),
    }  # fmt: skip
    found = onto_surface(record, Terrain.flat())
    np.testing.assert_allclose(found["cop_x"], [1.15, 0.0])
    np.testing.assert_allclose(found["cop_y"], 0.0, atol=1e-15)


def zigzag(rise, width):
    """Up by `rise` and down again over `width` each [m]."""
    return Terrain((0.0, rise) * 40, start=-40 * width, spacing=width)


def test_a_force_through_a_knot_far_from_the_origin_meets_the_ground():
    """100 km away, where the places of knots are rounded; the ground rises and falls by 1 cm."""
    knots = 1e5 + 0.1 * np.arange(40)
    ground = Terrain(tuple(0.01 * (k % 2) for k in range(40)), start=1e5, spacing=0.1)
    at = knots[1:-1]
    upward = np.ones(len(at))
    record = {"force_x": 0.0 * at, "force_y": upward, "cop_x": at, "cop_y": 0.0 * at - 0.02}
    found = onto_surface(record, ground)
    np.testing.assert_allclose(found["cop_y"], np.array(ground.heights)[1:-1], rtol=0, atol=1e-8)


@pytest.mark.parametrize("ground", [
    zigzag(0.05, 0.05), zigzag(0.05, 0.1), zigzag(0.2, 0.1), Terrain.slope(-0.6), Terrain.ramp(0.5, 0.0, 0.3),
    Terrain((0.0, 0.3), start=0.0, spacing=0.01), Terrain.flat(),
])  # fmt: skip
@given(x=st.floats(-0.9, 0.9), depth=st.floats(0, 0.03), tilt=st.floats(-0.6, 0.6))
@example(x=0.049, depth=0.02, tilt=0.6)
def test_on_bent_ground_the_centre_is_the_nearest_meeting_of_force_and_surface(ground, x, depth, tilt):
    """Against a walk along the line in steps of 0.2 mm; friction tilts the force from the normal."""
    slope = float(np.diff(ground.height_at(np.array([x - 1e-6, x + 1e-6])))[0] / 2e-6)
    force = 500 * np.exp(1j * (np.arctan(slope) + np.pi / 2 - tilt))
    y = float(ground.height_at(np.array([x]))[0]) - depth
    record = {name: np.array([value]) for name, value in
              (("force_x", force.real), ("force_y", force.imag), ("cop_x", x), ("cop_y", y))}  # fmt: skip
    found = onto_surface(record, ground)
    centre = complex(found["cop_x"][0], found["cop_y"][0])
    moved = centre - complex(x, y)
    assert (moved.conjugate() * force).imag == pytest.approx(0, abs=1e-9)  # no moment
    walk = np.arange(-0.5, 0.5, 2e-4)
    points = complex(x, y) + walk * force / abs(force)
    above = points.imag > ground.height_at(points.real)
    crossings = np.abs(walk[np.flatnonzero(np.diff(above.astype(int)))])
    if crossings.size and crossings.min() < 0.499:
        assert float(ground.height_at(np.array([centre.real]))[0]) == pytest.approx(centre.imag, abs=1e-9)
        assert abs(moved) <= crossings.min() + 2e-4
    assert abs(moved) <= 0.5


def test_the_threshold_is_of_the_force_along_the_normal():
    """As a plate in the slope measures it: 25 N upward are 19 N across a slope of 40 degrees."""
    angle = math.radians(40)
    record = {
        "force_x": np.zeros(2),
        "force_y": np.array([25.0, 27.0]),
        "cop_x": np.ones(2),
        "cop_y": np.ones(2),
    }
    found = above_threshold(record, 20.0, Terrain.slope(angle))
    np.testing.assert_array_equal(found["force_y"], [0.0, 27.0])
    along = {**record, "force_x": np.array([-30.0, 0.0])}  # friction counts: the normal points backward
    np.testing.assert_array_equal(above_threshold(along, 20.0, Terrain.slope(angle))["force_y"], [25.0, 27.0])


forces = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=30)


@given(forces, st.floats(0, 1e3))
def test_nothing_is_left_below_the_threshold_and_all_above(upward, threshold):
    up = np.array(upward)
    record = {"force_y": up} | dict.fromkeys(("force_x", "cop_x", "cop_y"), up + 1.0)
    found = above_threshold(record, threshold, Terrain.flat())
    below = up < threshold
    for name, values in record.items():
        assert not found[name][below].any()
        np.testing.assert_array_equal(found[name][~below], values[~below])
    again = above_threshold(found, threshold, Terrain.flat())
    assert all((again[name] == found[name]).all() for name in found)


def test_body_weights_are_forces_over_the_weight(slopes):
    record, weight = slopes[0.0]
    about = {"weight_n": weight, "units": RECORD}
    found, said = in_units(record, about, "BW")
    np.testing.assert_allclose(found["force_y"] * weight, record["force_y"])
    np.testing.assert_array_equal(found["cop_x"], record["cop_x"])
    units = {name: said["units"][name] for name in ("force_y", "toe_normal", "free_moment", "cop_x")}
    assert units == {"force_y": "BW", "toe_normal": "BW", "free_moment": "BW m", "cop_x": "m"}
    assert about["units"]["force_y"] == "N"


def test_limbs_are_found_by_their_vertical_force():
    assert limbs_of(["time", "toe_force_y", "force_y"]) == [""]
    assert limbs_of(["left_fore_force_y", "left_fore_heel_force_y"]) == ["left_fore_"]
