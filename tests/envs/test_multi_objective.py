"""The vector reward: its parts, that they add up to the scalar one, and what a fall costs."""

import numpy as np
import pytest
from family import FALLS

from hoof_env.envs.horse_leg import HorseLegEnv, HorseLegMOEnv, vector_reward
from hoof_env.errors import ParameterError
from hoof_env.tasks.reward import OBJECTIVES, Term
from hoof_env.tasks.reward import TERMS as REWARD

TERMS = {term.key: 0.0 for term in REWARD} | {
    "reward_progress": 0.5,
    "reward_peak": -0.2,
    "reward_energy": -0.1,
    "reward_slip": -0.02,
    "reward_support": 0.3,
    "reward_overspeed": -0.04,
    "reward_loading": -0.05,
}


def test_each_objective_has_its_terms():
    np.testing.assert_allclose(
        vector_reward({**TERMS, "reward_failure": 0.0}), [0.76, -0.25, -0.12], rtol=1e-6
    )


def test_a_new_term_goes_to_its_objective_and_one_without_to_all():
    own = Term("own", 1.0, "1", "own", lambda step, weight: weight, objective="energy")
    shared = Term("shared", 1.0, "1", "shared", lambda step, weight: weight)
    info = {**TERMS, "reward_failure": 0.0, "reward_own": 0.7, "reward_shared": 0.3}
    np.testing.assert_allclose(vector_reward(info, (*REWARD, own, shared)), [0.86, -0.15, 0.68], rtol=1e-6)
    with pytest.raises(
        ParameterError, match=r"objective: expected .*energy, peak force, progress, got 'joy'"
    ):
        Term("own", 1.0, "1", "own", lambda step, weight: weight, objective="joy")


@pytest.mark.parametrize("weights", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.2, 0.3, 0.5)])
def test_a_fall_costs_every_preference_the_same(weights):
    fell, stood = (vector_reward({**TERMS, "reward_failure": failure}) for failure in (-700.0, 0.0))
    assert np.dot(weights, fell - stood) == pytest.approx(-700.0 / 3, rel=1e-6)


@pytest.mark.parametrize(
    "kwargs", [{}, {"reward_weights": {"peak": 2.0, "overspeed": 3.0, "loading": 0.5}}, FALLS]
)
def test_objectives_add_up_to_the_scalar_reward_and_all_else_is_the_same(kwargs):
    one, many = HorseLegEnv(**kwargs), HorseLegMOEnv(**kwargs)
    generator = np.random.default_rng(0)
    one.reset(seed=1), many.reset(seed=1)
    assert many.reward_space.shape == (many.reward_dim,) == (len(OBJECTIVES),)
    for _ in range(400):
        action = generator.uniform(-1, 1, 4).astype(np.float32)
        (seen, reward, *flags, info), (seen_too, rewards, *flags_too, info_too) = (
            one.step(action),
            many.step(action),
        )
        np.testing.assert_array_equal(seen, seen_too)
        assert (flags, info) == (flags_too, info_too)
        assert rewards in many.reward_space
        assert rewards.sum() == pytest.approx(reward, rel=1e-5, abs=1e-6)
        if any(flags):
            break
    assert flags[0] == (kwargs is FALLS)
