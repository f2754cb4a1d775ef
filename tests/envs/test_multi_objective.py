"""The vector reward: its parts, that they add up to the scalar one, what a fall costs, many side by side, and
one number again by weights."""

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, MODES, actions, same, same_rows
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st

import hoof_env
from hoof_env.envs.horse_leg import HorseLegEnv, HorseLegMOEnv
from hoof_env.errors import ParameterError
from hoof_env.tasks.objectives import scalar_weights, vector_reward
from hoof_env.tasks.reward import OBJECTIVES, Term
from hoof_env.tasks.reward import TERMS as REWARD

MO = "hoof_env/HorseLegMO-v0"
SHORT = {"episode_seconds": 0.1}  # five steps
WEIGHT = [0.5, 0.2, 0.3]

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


def test_a_cost_is_part_of_no_objective():
    cost = Term("own", 1.0, "1", "own", lambda step, weight: weight, is_cost=True)
    info = {**TERMS, "reward_failure": 0.0}
    np.testing.assert_array_equal(
        vector_reward({**info, cost.key: 5.0}, (*REWARD, cost)), vector_reward(info, REWARD)
    )


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


class Summed(gym.Wrapper):
    """The leg whose reward is the position of its three rewards in a list, because Gymnasium's vector
    environment keeps one number."""

    def __init__(self, env, kept):
        super().__init__(env)
        self.kept = kept

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        self.kept.append(reward)
        return observation, float(len(self.kept) - 1), *rest


def many_by_gymnasium(n, mode, **settings):
    """Gymnasium's vector environment over single ones, with their vectors for rewards: 0 in a restart, as by
    MO-Gymnasium."""
    kept = [np.zeros(3, np.float32)]
    make = lambda: Summed(gym.make(MO, **settings), kept)  # noqa: E731
    return SyncVectorEnv([make] * n, autoreset_mode=mode), kept


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("settings", [SHORT, FALLS], ids=["short", "falls"])
def test_rows_are_the_single_environments_over_ends_of_episodes(mode, settings):
    ours = gym.make_vec(MO, num_envs=3, autoreset_mode=mode, **settings)
    theirs, kept = many_by_gymnasium(3, mode, **settings)
    same(ours.reset(seed=4)[0], theirs.reset(seed=4)[0])
    ends = 0
    for action in actions(1, 200, 3):
        found, expected = ours.step(action), list(theirs.step(action))
        expected[1] = np.array([kept[int(place)] for place in expected[1]])
        assert found[1].dtype == np.float32
        same_rows(found, expected, 3)
        done = found[2] | found[3]
        ends += done.sum()
        if done.any() and mode == AutoresetMode.DISABLED:
            same(*(envs.reset(options={"reset_mask": done})[0][done] for envs in (ours, theirs)))
    assert ends > 2


def test_rewards_of_many_are_copies_with_a_documented_space():
    envs = gym.make_vec(MO, num_envs=4, num_threads=2)
    assert isinstance(envs.unwrapped, hoof_env.HorseLegMOVectorEnv)
    assert envs.unwrapped.reward_space == gym.make(MO).unwrapped.reward_space
    assert envs.unwrapped.reward_dim == 3
    envs.reset(seed=0)
    first = envs.step(actions(0, 4))[1]
    before = first.copy()
    second = envs.step(actions(1, 4))[1]
    same(first, before)
    assert second.shape == (4, 3)
    assert all(row in envs.unwrapped.reward_space for row in [*first, *second])
    assert not np.array_equal(first, second)


def test_own_weights_of_terms_reach_the_rewards_of_many():
    usual, double = (
        gym.make_vec(MO, 2, reward_weights={"energy": weight, "slip": weight}) for weight in (1.0, 2.0)
    )
    for envs in (usual, double):
        envs.reset(seed=0)
    for action in actions(0, 20, 2):
        (_, one, *_), (_, two, *_) = usual.step(action), double.step(action)
        np.testing.assert_allclose(two, one * [1, 1, 2], rtol=1e-5, atol=1e-7)
    assert (two[:, 2] < 0).all()


@given(st.lists(st.floats(0, 10), min_size=3, max_size=3).filter(any))
def test_scalar_weights_pay_the_weighted_sum_of_the_objectives(weight):
    info = {**TERMS, "reward_failure": -0.5}
    usual = {term.key: term.weight for term in REWARD}
    scaled = scalar_weights(weight)
    paid = sum(info[term.key] / usual[term.key] * scaled[term.name] for term in REWARD if usual[term.key])
    vector = vector_reward({**info, "reward_overspeed": 0.0})  # its weight is 0
    assert paid == pytest.approx(np.dot(weight, vector), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("settings", [{}, FALLS], ids=["leg", "falls"])
def test_an_agent_with_one_reward_sees_the_weighted_sum(settings):
    """Single, side by side, and the id with one reward under `scalar_weights`: the same number."""
    alone = hoof_env.LinearReward(gym.make(MO, **settings), WEIGHT)
    many = hoof_env.VectorLinearReward(gym.make_vec(MO, num_envs=2, **settings), WEIGHT)
    leg = gym.make("hoof_env/HorseLeg-v0", reward_weights=scalar_weights(WEIGHT), **settings)
    for env in (alone, many, leg):
        env.reset(seed=3)
    for action in actions(2, 300, 2):
        _, reward, terminated, truncated, info = alone.step(action[0])
        _, rewards, _, _, infos = many.step(action)
        _, summed, *_ = leg.step(action[0])
        assert rewards.shape == (2,)
        same(np.float64(reward), rewards[0])
        same(info["vector_reward"], infos["vector_reward"][0])
        assert reward == pytest.approx(np.dot(info["vector_reward"], WEIGHT), rel=1e-6)
        assert reward == pytest.approx(summed, rel=1e-5, abs=1e-5)
        if terminated or truncated:
            break
    assert terminated == (settings is FALLS)


def test_the_wrapper_is_made_again_from_its_spec():
    env = hoof_env.LinearReward(gym.make(MO), np.array(WEIGHT))
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    np.testing.assert_array_equal(again.get_wrapper_attr("weight"), WEIGHT)


BAD_WEIGHTS = ([1, 2], [1, -1, 1], [0, 0, 0], [1, np.nan, 1], "heavy", None, [[1, 1, 1]], {"energy": 1})


@pytest.mark.parametrize("weight", BAD_WEIGHTS, ids=str)
def test_bad_weights_are_refused(weight):
    words = r"weight: expected 3 finite numbers from 0 .*progress, peak force, energy, got "
    for make in (
        lambda: hoof_env.LinearReward(gym.make(MO), weight),
        lambda: hoof_env.VectorLinearReward(gym.make_vec(MO, 2), weight),
        lambda: scalar_weights(weight),
    ):
        with pytest.raises(ParameterError, match=words):
            make()


def test_one_number_for_a_reward_is_refused_and_so_is_a_vector_where_one_is_needed():
    with pytest.raises(ParameterError, match=r"reward for each objective.*HorseLegMO-v0.*got HorseLegEnv"):
        hoof_env.LinearReward(gym.make("hoof_env/HorseLeg-v0"), WEIGHT)
    with pytest.raises(ParameterError, match=r"reward for each objective.*got HorseLegVectorEnv"):
        hoof_env.VectorLinearReward(gym.make_vec("hoof_env/HorseLeg-v0", 2), WEIGHT)
    with pytest.raises(ParameterError, match=r"one number for a reward.*HorseLegMO-v0.*scalar_weights"):
        hoof_env.Sb3VecEnv(MO, 2)
