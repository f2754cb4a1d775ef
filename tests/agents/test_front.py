"""Fronts: points that no other dominates, the volume below them, and the stored front of the agents."""

import json

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agents import front
from agents.front import STEPS, Trained, returns_of, shares, summarise
from hoof_env.envs.policies import Scripted
from hoof_env.errors import ParameterError
from hoof_env.evaluation.fronts import hypervolume, non_dominated, read_front
from hoof_env.tasks.objectives import REFERENCE_POINT
from hoof_env.tasks.reward import OBJECTIVES

whole = st.integers(-3, 6).map(float)
points = st.integers(1, 12).flatmap(lambda n: arrays(float, (n, 3), elements=whole))


@given(points)
def test_the_volume_is_the_number_of_unit_cubes(found):
    """Points on a grid: a cube counts if some point is at least as far in every direction."""
    cubes = np.stack(np.meshgrid(*[np.arange(0.0, 6.0)] * 3, indexing="ij"), -1).reshape(-1, 3) + 1
    counted = sum((cube <= found).all(axis=1).any() for cube in cubes)
    assert hypervolume(found, (0.0, 0.0, 0.0)) == pytest.approx(counted)


@given(points)
def test_dominated_points_add_nothing_and_the_rest_something(found):
    kept = found[non_dominated(found)]
    volume = hypervolume(found, (-4.0, -4.0, -4.0))
    assert hypervolume(kept, (-4.0, -4.0, -4.0)) == volume
    for k in range(len(kept)):
        assert hypervolume(np.delete(kept, k, axis=0), (-4.0, -4.0, -4.0)) < volume
    others = kept[:, None, :]
    assert not ((kept >= others).all(-1) & (kept > others).any(-1)).any()


@pytest.mark.parametrize("bad", [[1.0, 2.0], [[1.0, np.nan, 2.0]], "front", [[1, 2, 3], [1, 2]]])
def test_bad_points_are_refused(bad):
    for use in (non_dominated, hypervolume):
        with pytest.raises(ParameterError, match="points: expected finite numbers"):
            use(bad)
    with pytest.raises(ParameterError, match=r"expected shapes \(n, 3\) and \(3,\), got \(1, 2\)"):
        hypervolume([[1.0, 2.0]])


def test_the_stored_front_is_one_and_has_its_volume():
    about = read_front()
    found = np.array([point["returns"] for point in about["front"]])
    assert about["objectives"] == list(OBJECTIVES)
    assert about["reference_point"] == list(REFERENCE_POINT)
    assert non_dominated(found).all()
    assert (found > REFERENCE_POINT).all(axis=1).sum() >= 5
    volume = about["hypervolume"]
    assert hypervolume(found) == pytest.approx(volume["all"], rel=1e-9)
    assert len(volume["seeds"]) == len(about["seeds"]) >= 2
    assert max(volume["seeds"]) < volume["all"]
    low, high = volume["interval95"]
    assert low <= volume["iqm"] <= high
    for point in about["front"]:
        assert sum(point["weight"]) == pytest.approx(1.0, abs=1e-5)
        assert point["seed"] in about["seeds"] or point["steps"] > 2 * STEPS


def test_the_page_shows_the_stored_front():
    about = read_front()
    page = (front.EVIDENCE / "front.md").read_text()
    assert f"**{about['hypervolume']['all']:,.0f}**" in page
    for point in about["front"]:
        cells = " | ".join(f"{value:.1f}" for value in point["returns"])
        assert f"| {point['seed']} | {point['steps']:,} | {cells} |" in page


def test_the_shipped_agent_returns_what_the_front_says():
    """The one point of which the policy is in the package."""
    (stored,) = [point for point in read_front()["front"] if point["steps"] > 2 * STEPS]
    assert front.shipped().returns == pytest.approx(stored["returns"], abs=1e-2)


def test_returns_of_each_objective_equal_single_environments():
    policy = Scripted(lambda observation, time: np.zeros(4), 0.02)
    found = returns_of(policy, range(3))
    env = gym.make("hoof_env/HorseLegMO-v0")
    for seed, returns in enumerate(found):
        env.reset(seed=seed)
        total, ended = np.zeros(3), False
        while not ended:
            _, reward, terminated, truncated, _ = env.step(np.zeros(4, np.float32))
            total += reward
            ended = terminated or truncated
        np.testing.assert_allclose(returns, total, rtol=1e-9)


def test_a_summary_has_the_front_of_all_and_the_volume_of_each_seed():
    found = [
        Trained(shares((1, 0, 0)), 0, STEPS, (10.0, -50.0, -20.0)),
        Trained(shares((1, 1, 1)), 0, STEPS, (5.0, -20.0, -10.0)),
        Trained(shares((1, 0, 0)), 1, STEPS, (9.0, -60.0, -30.0)),
        Trained(shares((1, 1, 1)), 1, STEPS, (4.0, -10.0, -10.0)),
    ]
    about = summarise(found, [Trained(shares((1, 1, 1)), 4, 10 * STEPS, (5.0, -20.0, -5.0))])
    assert [point["returns"][0] for point in about["front"]] == [10.0, 5.0, 4.0]
    assert about["front"][1]["steps"] == 10 * STEPS
    first = 10 * 50 * 30 + 5 * 80 * 40 - 5 * 50 * 30
    assert about["hypervolume"]["seeds"][0] == pytest.approx(first)
    json.dumps(about)
