"""What every Gymnasium environment owes its users, over all ids and set-ups."""

from __future__ import annotations

import copy
import pickle
import warnings

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, HORSES, IDS, actions, effective, roll, same
from gymnasium.utils.env_checker import check_env

SETUPS = [
    *((env_id, {}) for env_id in IDS),
    ("hoof_env/HorseLeg-v0", FALLS),
    ("hoof_env/HorseLeg-v0", {"drive": "motor"}),
    ("hoof_env/HorseLeg-v0", {"trunk": "fixed"}),
    ("hoof_env/HorseLegFixed-v0", {"gait": "walk"}),
    ("hoof_env/HorseLegFixed-v0", {"gait": "run", "solver": "paper", "episode_seconds": 0.1}),
]


@pytest.fixture(params=SETUPS, ids=lambda s: f"{s[0]}-{s[1]}")
def setup(request):
    return request.param


def test_checkers_find_nothing(setup):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(setup[0], **setup[1]).unwrapped)
        from stable_baselines3.common.env_checker import check_env as sb3_check_env

        sb3_check_env(gym.make(setup[0], **setup[1]))


def test_other_seed_other_start():
    starts = [gym.make("hoof_env/HorseLeg-v0").reset(seed=seed)[0] for seed in range(4)]
    assert len({start.tobytes() for start in starts}) == 4


def test_observations_stay_in_the_box_and_none_is_constant(setup):
    env = gym.make(setup[0], **setup[1])
    seen, is_slow = [env.reset(seed=3)[0]], setup[1].get("solver") == "paper"
    for action in actions(5, 40 if is_slow else 1000, env_id=setup[0]):
        observation, _, terminated, truncated, _ = env.step(action)
        seen += [observation, *([env.reset()[0]] if terminated or truncated else [])]
    observations = np.array(seen)
    assert np.isfinite(observations).all()
    assert np.abs(observations).max() <= 1.0
    names = zip(env.unwrapped.observation_names, observations.T, strict=True)
    if setup[1].get("solver") != "paper":  # its short episodes end before the first contact
        assert [name for name, column in names if np.ptp(column) == 0] == []


def test_every_call_returns_fresh_data():
    env = gym.make("hoof_env/HorseLeg-v0")
    given = [*env.reset(seed=1), env.unwrapped.record()]
    given += [*env.step(np.ones(4, np.float32)), env.unwrapped.record()]
    kept = copy.deepcopy(given)
    env.step(-np.ones(4, np.float32))
    same(given, kept)


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("settings", [{}, FALLS], ids=["", "falls"])
def test_types_and_infos_of_a_step(env_id, settings):
    """Plain Python numbers, and NumPy's in the infos, which libraries stack."""
    env = gym.make(env_id, episode_seconds=2.0, **effective(settings, env_id))
    _, started = env.reset(seed=0)
    costs = len(env.unwrapped.costs) + 1 if env.unwrapped.costs else 0
    done = False
    while not done:
        _, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert (type(reward), type(terminated), type(truncated)) == (float, bool, bool)
        assert reward == sum(value for key, value in info.items() if key.startswith("reward_"))
        done = terminated or truncated
        ended = {"episode_summary", "end", "is_success"} if done else set()
        assert len(info) <= 10 + len(env.unwrapped.task.terms) + costs + len(ended)
        assert set(started) <= set(info)
        assert set(info) - set(started) == ended
    assert all(type(value) is float for value in info["episode_summary"].values())
    # libraries pad what other steps lack: a number with 0, but words with None
    assert [type(value) for value in info["end"].values()] == [bool]
    assert (info["end"] == {"time limit": True}) == truncated


@pytest.mark.parametrize("env_id", IDS)
def test_the_observation_does_not_change_the_reward(env_id):
    whole, few = gym.make(env_id), gym.make(env_id, observation=["hoof"])
    starts = [env.reset(seed=3)[0] for env in (whole, few)]
    assert starts[0].size > starts[1].size == (20 if env_id in HORSES else 8)
    for one, two in zip(roll(whole, 500), roll(few, 500), strict=True):
        same(one[1:], two[1:])


def test_groups_are_the_same_numbers_in_the_order_that_was_asked_for():
    names = gym.make(IDS[0]).unwrapped.observation_names
    turned = gym.make(IDS[0], observation=["trunk", "hoof", "crank"]).unwrapped
    places = [names.index(name) for name in turned.observation_names]
    whole = gym.make(IDS[0])
    same(whole.reset(seed=3)[0][places], turned.reset(seed=3)[0])
    for one, two in zip(roll(whole, 200), roll(turned, 200), strict=True):
        same(one[0][places], two[0])


def test_recording_changes_nothing():
    plain, recorded = (gym.make(IDS[0]).unwrapped for _ in range(2))
    plain.reset(seed=1), recorded.reset(seed=1)
    assert recorded.record()["time"].shape == (1, 1)
    for k, action in enumerate(actions(0, 100)):
        one, two = plain.step(action), recorded.step(action)
        same(one[:4], two[:4])
        record = recorded.record()
        np.testing.assert_allclose(record["time"][:, 0], 0.02 * k + 1e-3 * np.arange(1, 21), atol=1e-9)


def test_a_state_fits_the_environment_that_a_json_spec_makes():
    """Where tuples have become lists."""
    settings = {"randomize": {"friction": (0.2, 0.8)}, "terrain": {"kind": "hills", "friction": (0.5, 1.5)}}
    env = gym.make(IDS[0], target_speed=(0.5, 2.0), reward_weights={"peak": 0.5}, **settings)
    env.reset(seed=0)
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json())).unwrapped
    assert again.weights["peak"] == 0.5
    same(again.set_state(env.unwrapped.get_state()), env.unwrapped.batch.rows.observations[0])
    again.reset()


def test_a_speed_of_nought_is_commanded():
    weights = {"peak": 0.0, "energy": 0.0, "overspeed": 1.0}
    env = gym.make(IDS[0], target_speed=0.0, trunk_drag=0.0, reward_weights=weights)
    env.reset(seed=0, options={"speed": 1.0, "crank_angle": 0.0, "height": 2.0})
    info = env.step(np.zeros(4, np.float32))[4]
    assert info["reward_overspeed"] == pytest.approx(-0.02, rel=0.1)
    assert info["reward_progress"] == 0.0


def test_the_slowest_pictures_are_one_a_second():
    pytest.importorskip("pygame")
    env = gym.make(IDS[0], dt=3.0, render_mode="rgb_array")
    assert env.metadata["render_fps"] == 1
    env.reset(seed=0)
    assert env.render().shape == (540, 960, 3)


COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize("env_id", IDS)
def test_copies_of_a_drawing_environment_draw_for_themselves(env_id, copied):
    pytest.importorskip("pygame")
    env = gym.make(env_id, render_mode="rgb_array").unwrapped
    env.reset(seed=2)
    roll(env, 10)
    before, state = env.render(), env.get_state()
    twin = COPIES[copied](env)
    assert twin.render().shape == before.shape  # where it is, for the window stayed behind
    roll(twin, 10)
    assert (twin.render() != before).any()
    same(env.render(), before)
    same(env.get_state(), state)
    env.close()
    assert twin.render().shape == before.shape


def test_a_picture_of_an_episode_shows_nothing_of_another():
    """Neither of the last one, however late it is drawn, nor of where a state was put back from."""
    pytest.importorskip("pygame")
    env, other = (gym.make(IDS[0], render_mode="rgb_array", dt=0.1).unwrapped for _ in range(2))
    env.reset(seed=0)
    roll(env, 20)
    env.render()
    for one in (env, other):
        one.reset(seed=1)
        roll(one, 60)
    state, last = env.get_state(), other.render()
    same(env.render(), last)
    env.reset(seed=2)
    roll(env, 20)
    env.render()
    env.set_state(state)
    assert (env.render() != last).any()  # the way there is not known
    third = gym.make(IDS[0], render_mode="rgb_array", dt=0.1).unwrapped
    third.set_state(state)
    same(env.render(), third.render())
