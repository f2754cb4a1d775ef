"""Terms of the reward as measured: the same under any weights, and of an episode's last step, too."""

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, actions, same

import hoof_env
from hoof_env.dynamics.layout import TRUNK_STATE

LEG, HORSE, OWN = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0", "tests/Unweighted-v0"


def highest_so_far(step, weight):
    """Return the highest force of the episode, of the weights of all steps since the last one above it."""
    own = step.episode.own.highest
    own.force = np.maximum(own.force, step.sums.highest_grf)
    own.steps = own.steps + 1.0
    return weight * own.force + own.steps


STATE = [hoof_env.TermState("force", 0.0, "N", "so far"), hoof_env.TermState("steps", 0.0, "-", "so far")]


@pytest.fixture(scope="module", autouse=True)
def own_id():
    term = hoof_env.Term("highest", 0.25, "1/N", "the highest force", highest_so_far, state=STATE)
    hoof_env.register(OWN, terms=[term])


def all_at(env_id, weight):
    return dict.fromkeys(gym.make(env_id).unwrapped.weights, weight)


@pytest.mark.parametrize(("env_id", "settings"), [(LEG, {}), (LEG, FALLS), (OWN, FALLS), (HORSE, {})])
def test_a_term_is_measured_as_an_environment_with_a_weight_of_1_rewards_it(env_id, settings):
    """The weights change no motion, so that an environment of which all weights are 1 says what is right."""
    weights = [all_at(env_id, weight) for weight in (1.0, 0.0)]
    ones, zeros = (gym.make(env_id, reward_weights=each, **settings) for each in weights)
    usual = gym.make(env_id, **settings)
    envs = (ones, zeros, usual)
    starts = [env.reset(seed=4)[1]["unweighted"] for env in envs]
    assert all(start.names == (*weights[0],) and not start.any() for start in starts)
    measured = set()
    for taken in actions(1, 500 if settings else 120, env_id=env_id):
        (*_, info), (_, nothing, *_, other), (*_, over, cut, third) = (env.step(taken) for env in envs)
        for name in weights[0]:
            assert info["unweighted"][name] == info[f"reward_{name}"]
            assert other["unweighted"][name] == third["unweighted"][name] == info["unweighted"][name]
            measured |= {name} if info["unweighted"][name] else set()
        assert env_id == OWN or nothing == 0.0
        if over or cut:
            break
    assert {"peak", "slip"} <= measured
    assert bool(over) == bool(settings)
    assert not settings or "failure" in measured


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
def test_each_row_has_the_terms_of_its_environment(mode):
    settings = {"episode_seconds": 0.3, "reward_weights": {"peak": 0.0}}
    envs = gym.make_vec(OWN, num_envs=3, autoreset_mode=mode, **settings)
    alone = [gym.make(OWN, **settings) for _ in range(3)]
    _, infos = envs.reset(seed=5)
    assert infos["unweighted"].shape == (3, len(envs.unwrapped.weights))
    for seed, env in enumerate(alone, 5):
        env.reset(seed=seed)
    over, ends = [False] * 3, 0
    for taken in actions(2, 40, 3):
        infos = envs.step(taken)[4]
        for row, env in enumerate(alone):
            if over[row]:  # NEXT_STEP
                _, info = env.reset()
                over[row] = False
            else:
                *_, cut, info = env.step(taken[row])
                if cut:
                    there = infos["final_info"] if mode == "SAME_STEP" else infos
                    same(there["unweighted"][row], np.asarray(info["unweighted"]))
                    same(there["measured"][row], np.asarray(info["measured"]))
                    assert info["unweighted"].any()
                    ends += 1
                over[row] = cut and mode == "NEXT_STEP"
                if cut and mode == "SAME_STEP":
                    _, info = env.reset()
            same(infos["unweighted"][row], np.asarray(info["unweighted"]))
    assert ends >= 6


def test_the_last_step_stays_with_its_episode_for_stable_baselines():
    settings = {"episode_seconds": 0.3, "reward_weights": {"peak": 0.0, "loading": 0.0}}
    envs, alone = hoof_env.Sb3VecEnv(LEG, num_envs=2, **settings), gym.make(LEG, **settings)
    envs.seed(1)
    envs.reset()
    alone.reset(seed=1)
    ended = 0
    for taken in actions(3, 40, 2):
        _, _, dones, infos = envs.step(taken)
        *_, info = alone.step(taken[0])
        same(np.asarray(infos[0]["unweighted"]), np.asarray(info["unweighted"]))
        for k in range(2):
            same(envs.measured[k], np.asarray(infos[k]["measured"]))
        same(envs.measured[0], np.asarray(info["measured"]))
        assert {name: values[0] for name, values in envs.terms.items()} == {
            name: info[name] for name in envs.terms
        }
        if dones[0]:
            ended += 1
            assert envs.measured["normal_impulse"][0] == info["measured"]["normal_impulse"]
            alone.reset()
    assert ended == 2


def test_copies_and_rows_under_other_settings_keep_their_own():
    envs = gym.make_vec(OWN, num_envs=2).unwrapped
    envs.reset(seed=0)
    envs.change_settings(envs=[1], reward_weights={"progress": 7.0})
    envs.reset(seed=0)
    usual, changed = gym.make(OWN), gym.make(OWN, reward_weights={"progress": 7.0})
    usual.reset(seed=0), changed.reset(seed=1)
    for taken in actions(0, 30, 2):
        infos = envs.step(taken)[4]
        for row, env in enumerate((usual, changed)):
            info = env.step(taken[row])[4]
            same(infos["unweighted"][row], np.asarray(info["unweighted"]))
            assert infos["reward_progress"][row] == info["reward_progress"]


def test_a_term_of_ones_own_measures_nothing_where_the_simulation_failed():
    """As it pays nothing: what it read is of the point of failure."""
    env = gym.make(OWN, reward_weights={"highest": 0.0}).unwrapped
    env.reset(seed=0)
    assert env.step(np.zeros(4, np.float32))[4]["unweighted"]["highest"] > 0.0
    state = env.get_state()
    state["engine"]["trunk"][TRUNK_STATE.index("momentum_x")] = 1e308
    env.set_state(state)
    _, _, terminated, _, info = env.step(np.zeros(4, np.float32))
    assert terminated
    assert info["unweighted"]["highest"] == info["reward_highest"] == 0.0
