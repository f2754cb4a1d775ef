"""Scripted policies: many at once as one by one, clocks that restart, open-loop gaits and their files."""

import json
import warnings

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.envs.policies import POLICIES, load_open_loop, make_policy, open_loop, policy_names
from hoof_env.errors import DataFileError, ParameterError

ENV_ID = "hoof_env/HorseLeg-v0"
CLOCKED = {
    "constant": [0.1, -0.2, 0.3, 0.0], "sin": [0.5, 0.0, 0.0, 0.1], "cos": [0.0, 0.4, 0.0, 0.0],
    "frequency_hz": 1.25,
}  # fmt: skip


@pytest.fixture(scope="module")
def env():
    return gym.make(ENV_ID)


def write(path, env, **changes):
    gait = env.unwrapped.command_of(np.array(CLOCKED["constant"])).tolist()
    record = {"env_id": ENV_ID, "parameters": CLOCKED, "gait": dict(enumerate(gait)), "dt": 0.02}
    path.write_text(json.dumps(record | changes))
    return path


@pytest.mark.parametrize("name", ["run", "walk", *(name for name in POLICIES if name != "random")])
def test_many_are_commanded_as_each_alone(env, name):
    assert name in policy_names(env)
    seen = np.random.default_rng(0).uniform(-1, 1, (30, 3, 24)).astype(np.float32)
    alone = [make_policy(name, env) for _ in range(3)]
    many = make_policy(name, env)
    for step in range(30):
        actions, _ = many.predict(seen[step])
        assert actions.dtype == np.float32
        for row, policy in enumerate(alone):
            np.testing.assert_array_equal(actions[row], policy.predict(seen[step, row])[0])


def test_random_draws_for_each(env):
    actions, _ = make_policy("random", env, 1).predict(np.zeros((50, 24)))
    assert actions.shape == (50, 4)
    assert len(np.unique(actions)) == 200


def test_the_clock_of_one_restarts_and_the_others_go_on():
    policy, twin = open_loop(CLOCKED, 0.02), open_loop(CLOCKED, 0.02)
    seen = np.zeros((2, 24))
    first, _ = policy.predict(seen)
    for _ in range(9):
        policy.predict(seen)
    later, _ = policy.predict(seen, episode_start=np.array([False, True]))
    np.testing.assert_array_equal(later[1], first[1])
    for _ in range(10):
        twin.predict(seen[0])
    np.testing.assert_array_equal(later[0], twin.predict(seen[0])[0])
    assert not np.array_equal(later[0], first[0])


def test_a_clocked_gait_is_its_formula():
    policy = open_loop(CLOCKED, 0.02)
    for step in range(7):
        phase = 2 * np.pi * 1.25 * 0.02 * step
        c, a, b = (np.array(CLOCKED[name]) for name in ("constant", "sin", "cos"))
        found, _ = policy.predict(np.zeros(24))
        np.testing.assert_allclose(found, c + a * np.sin(phase) + b * np.cos(phase), atol=1e-7)


def test_a_gait_for_each_of_many():
    generator = np.random.default_rng(0)
    gaits = {name: generator.uniform(-1, 1, (3, 4)) for name in ("constant", "sin", "cos")}
    gaits["frequency_hz"] = np.array([0.5, 1.0, 2.0])
    many, seen = open_loop(gaits, 0.02), np.zeros((3, 24))
    alone = [open_loop({name: value[row] for name, value in gaits.items()}, 0.02) for row in range(3)]
    for _ in range(5):
        actions, _ = many.predict(seen)
        np.testing.assert_array_equal(actions, [policy.predict(seen[0])[0] for policy in alone])


def test_a_file_has_its_own_clock_and_the_environments_where_there_is_one(env, tmp_path):
    path = write(tmp_path / "gait.json", env, dt=0.5)
    seconds = {0.5: load_open_loop(path), 0.02: load_open_loop(path, env)}
    for dt, policy in seconds.items():
        twin = open_loop(CLOCKED, dt)
        for _ in range(3):
            np.testing.assert_array_equal(policy.predict(np.zeros(24))[0], twin.predict(np.zeros(24))[0])


@pytest.mark.parametrize(
    "changes",
    [
        {"parameters": {"constant": [0.0, 0.0, 0.0]}}, {"parameters": {**CLOCKED, "frequency_hz": None}},
        {"parameters": {"constant": [0.0] * 4, "sin": [0.0] * 4}}, {"parameters": None}, {"dt": "x"},
        {"parameters": {"constant": [0.0, 0.0, 0.0, float("nan")]}}, {"gait": [1, 2]},
    ],
)  # fmt: skip
def test_a_file_that_is_no_gait(env, tmp_path, changes):
    path = write(tmp_path / "gait.json", env, **changes)
    with pytest.raises(DataFileError, match=r"gait\.json: expected the JSON object of agents\.open_loop"):
        load_open_loop(path)


@pytest.mark.parametrize("content", ["", "[]", "{}", "\x00"])
def test_a_file_that_is_something_else(tmp_path, content):
    (tmp_path / "gait.json").write_text(content)
    with pytest.raises(DataFileError, match=r"gait\.json"):
        load_open_loop(tmp_path / "gait.json")
    with pytest.raises(DataFileError, match=r"none\.json"):
        load_open_loop(tmp_path / "none.json")


def test_an_environment_whose_actions_mean_something_else(env, tmp_path):
    path = write(tmp_path / "gait.json", env)
    with pytest.raises(DataFileError, match="whose actions command gaits as those of"):
        load_open_loop(path, gym.make("hoof_env/HorseLegFixed-v0"))
    with pytest.raises(DataFileError, match="PendulumEnv"):
        load_open_loop(path, gym.make("Pendulum-v1"))


def test_a_gait_of_another_id_is_told(env, tmp_path):
    path = write(tmp_path / "gait.json", env)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for same in (env, gym.make("hoof_env/HorseLegMO-v0", disable_env_checker=True)):
            load_open_loop(path, same)
        load_open_loop(write(tmp_path / "bare.json", env, env_id=None), env)
    with pytest.warns(UserWarning, match=r"found for hoof_env/HorseLeg-v0, here hoof_env/HorseLegRail-v0"):
        load_open_loop(path, gym.make("hoof_env/HorseLegRail-v0"))


FIXED = "hoof_env/HorseLegFixed-v0"


def held(name, env, seconds=6.0):
    """Commands and heights of the lower hoof point in the last second of a policy."""
    leg, policy, commands, heights = env.unwrapped, make_policy(name, env), [], []
    observation, _ = env.reset(seed=0)
    for step in range(round(seconds / leg.dt)):
        action, _ = policy.predict(observation)
        observation, *_ = env.step(action)
        if step * leg.dt > seconds - 1:
            commands.append(leg.command_of(action))
            heights.append(min(leg.record()["toe_y"][-1].item(), leg.record()["heel_y"][-1].item()))
    return np.array(commands), np.array(heights)


@pytest.mark.parametrize("gait", ["walk", "run"])
def test_policies_hold_their_posture_where_actions_are_offsets(gait):
    """The highest place and the lowest are in reach of offsets, too, and the crank stops there."""
    env = gym.make(FIXED, gait=gait, episode_seconds=9.0)
    heights = {}
    for name in ("idle", "airborne", "drag"):
        commands, heights[name] = held(name, env)
        assert (commands[:, 0] < 0.02).all()
    swing = env.unwrapped.command_of([0, 1, 0, 0])[1]  # the highest place is at the largest offset in reach
    low, high = (heights[name].mean() for name in ("drag", "airborne"))
    assert low < heights["idle"].mean() < high
    for crank in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        start = {"crank_angle": crank, "gait": {"crank_speed": 0.0, "swing_offset": swing, "swing_sin": 0.0,
                                                "swing_cos": 0.0}}  # fmt: skip
        env.reset(options=start)
        record = env.unwrapped.record()
        assert min(record["toe_y"].item(), record["heel_y"].item()) < high + 0.01


def test_policies_that_see_the_crank_find_it_wherever_it_is():
    one, other = gym.make(ENV_ID), gym.make(ENV_ID, observation=["hoof", "crank"])
    for name in ("drag", "airborne"):
        seen = [np.zeros((9, env.observation_space.shape[0]), np.float32) for env in (one, other)]
        for rows, first in zip(seen, (0, 7), strict=True):
            angle = np.linspace(0.0, 6.0, 9)
            rows[:, first], rows[:, first + 1] = np.sin(angle), np.cos(angle)
        commands = [
            make_policy(name, env).predict(rows)[0] for env, rows in zip((one, other), seen, strict=True)
        ]
        assert len(np.unique(commands[0][:, 0])) > 1
        np.testing.assert_array_equal(*commands)
        with pytest.raises(
            ParameterError, match=r"expected 'crank' among the observed groups, got \['hoof'\]"
        ):
            make_policy(name, gym.make(ENV_ID, observation=["hoof"]))


def test_a_crank_that_no_action_stops_is_refused():
    env = gym.make(FIXED, gait="carrying_walk")
    for name in ("idle", "drag", "airborne"):
        with pytest.raises(ParameterError, match=r"stop the crank; with gait='carrying_walk'"):
            make_policy(name, env)
