"""Ground under a trunk that keeps its height in the world: it may rise and fall, and must not drift away."""

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.errors import ParameterError
from hoof_env.ground.terrain import Terrain
from hoof_env.tasks.terrains import DRIFT, STRETCH, farthest_mean, make_terrain

HELD = {"suspended": "hoof_env/HorseLeg-v0", "rail": "hoof_env/HorseLegRail-v0"}
HIP = gym.make(HELD["rail"]).unwrapped.geometry.hip_height


def step_up(height, length=30.0):
    """Level, then a ramp to another level, which goes on."""
    return Terrain.ramp(height / length, 5.0, length).to_dict()


@pytest.mark.parametrize("trunk", HELD)
@pytest.mark.parametrize(
    "terrain",
    [
        None, {"kind": "slope"}, {"kind": "hills"}, {"kind": "hills", "seed": 3, "rise": 0.3}, step_up(0.04),
        Terrain.through([0, 1, 2, 400], [0, 0.2, 0, 0]).to_dict(), {"height": [0.0], "stiffness": 0.5},
        Terrain.patches([(5, 9, 0.3, 0.5)]).to_dict(),
    ],
    ids=repr,
)  # fmt: skip
def test_ground_that_stays_is_taken(trunk, terrain):
    gym.make(HELD[trunk], terrain=terrain).reset(seed=0)


@pytest.mark.parametrize("env_id", ["hoof_env/HorseLegFixed-v0", "hoof_env/Horse-v0"])
def test_slopes_are_for_trunks_that_follow_them_or_stay(env_id):
    gym.make(env_id, terrain={"kind": "slope", "angle": 0.02}).reset(seed=0)


def test_the_bound_is_a_part_of_the_hip_height():
    one = gym.make(HELD["suspended"], terrain={"height": [0.99 * DRIFT * HIP]})
    assert one.unwrapped.terrain.height == (0.99 * DRIFT * HIP,)
    with pytest.raises(ParameterError, match="terrain: expected ground whose mean"):
        gym.make(HELD["suspended"], terrain={"height": [1.01 * DRIFT * HIP]})


@pytest.mark.parametrize("seed", range(5))
def test_the_farthest_mean_agrees_with_many_sums(seed):
    """Against a sum over every centimetre."""
    rng = np.random.default_rng(seed)
    terrain = Terrain(tuple(rng.uniform(-1, 1, 40)), start=rng.uniform(-5, 5), spacing=rng.uniform(0.2, 3))
    fine = np.arange(terrain.x[0] - 15, terrain.x[-1] + 15, 0.01)
    width = round(STRETCH / 0.01)
    means = np.convolve(terrain.height_at(fine), np.full(width, 1 / width), "valid")
    where, mean = farthest_mean(terrain, STRETCH)
    inside = np.abs(fine - where) < STRETCH / 2
    assert mean == pytest.approx(terrain.height_at(fine)[inside].mean(), abs=2e-3)
    assert abs(mean) == pytest.approx(np.abs(means).max(), abs=0.05)


def test_hills_do_not_drift():
    """Of twenty seeds: their mean over a stretch is within their rise, and over all is near none."""
    for seed in range(20):
        terrain = make_terrain({"kind": "hills", "seed": seed, "rise": 0.15})
        assert abs(np.mean(terrain.height)) < 0.03


@pytest.mark.parametrize("seed", range(5))
def test_ditches_are_as_deep_wide_and_far_apart_as_asked(seed):
    depth, width, gap = 0.2, 0.4, (0.5, 1.5)
    asked = {"kind": "ditches", "seed": seed, "depth": depth, "width": width, "gap": gap}
    terrain = make_terrain(asked)
    assert set(terrain.height) == {0.0, -depth}
    assert terrain == make_terrain(asked)
    assert terrain != make_terrain(asked | {"seed": seed + 10})
    is_deep = np.array(terrain.height) < 0
    begin, end = (np.flatnonzero(np.diff(is_deep.astype(int)) == step) for step in (1, -1))
    last = min(len(begin), len(end)) - 1
    # From the last level knot to the next one
    widths = terrain.x[end[:last] + 1] - terrain.x[begin[:last]]
    np.testing.assert_allclose(widths, width, atol=1e-9)
    gaps = terrain.x[begin[1 : last + 1]] - terrain.x[end[:last] + 1]
    assert gap[0] - 0.03 < gaps.min() < gap[0] + 0.05
    assert gap[1] - 0.05 < gaps.max() < gap[1] + 0.03
    assert np.mean(gaps) == pytest.approx(np.mean(gap), abs=0.1)


@pytest.mark.parametrize("seed", range(60))
def test_beyond_ditches_the_ground_is_level(seed):
    terrain = make_terrain({"kind": "ditches", "seed": seed, "length": 40.0})
    assert terrain.height[0] == terrain.height[-1] == 0.0
    assert terrain.height_at(np.array([-5.0, 45.0])).tolist() == [0.0, 0.0]


def test_a_ditch_of_no_depth_is_level():
    assert not any(make_terrain({"kind": "ditches", "depth": 0.0}).height)
