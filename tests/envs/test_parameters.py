"""Masses, grounds and motors of one episode: set exactly, drawn, reproduced, and gone in the next."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from family import IDS, OTHER, actions, effective, roll, same, substeps

import hoof_env
from hoof_env import RandomizeParameters
from hoof_env.constants import GRAVITY
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.tasks.settings import PER_EPISODE

LEG, SPEED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegSpeed-v0"
PARAMETERS = {name: OTHER[name] for name in PER_EPISODE}


def make(env_id=LEG, drive="motor", **settings):
    return gym.make(env_id, drive=drive, **settings).unwrapped


@pytest.mark.parametrize("name", PER_EPISODE)
def test_one_set_at_reset_is_one_made_with(name):
    """The same motion to the bit as in an environment that always has it, and another without."""
    given = {name: OTHER[name]}
    kind = {"drive": "motor" if name.startswith("motor") else "prescribed"}
    reset, made, plain = make(**kind), make(**kind, **given), make(**kind)
    start = {"gait": "run", "crank_angle": 0.3, "speed": 0.5, "height": 1.75}
    for env, options in ((reset, {**start, "parameters": given}), (made, start), (plain, start)):
        _, info = env.reset(seed=0, options=options)
        assert info.get("parameters") == options.get("parameters")
    one, two, three = (roll(env, 150) for env in (reset, made, plain))
    for a, b in zip(one, two, strict=True):
        same(a, b)
    assert any((a[0] != b[0]).any() for a, b in zip(one, three, strict=True))
    assert reset.weight == made.weight


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("seed", [None, 7])
def test_what_was_set_for_one_episode_is_not_for_the_next(env_id, seed):
    env, fresh = make(env_id, "motor"), make(env_id, "motor")
    for one in (env, fresh):
        one.reset(seed=3)
    env.reset(seed=3, options={"parameters": effective(PARAMETERS, env_id, drive="motor")})
    roll(env, 20)
    weight = fresh.weight
    heavier = PARAMETERS["trunk_mass"] - fresh.settings.trunk_mass
    assert env.weight == pytest.approx(weight + heavier * GRAVITY)
    for one in (env, fresh):
        one.np_random = np.random.default_rng(1)
        one.reset(seed=seed)
    assert env.weight == weight
    for a, b in zip(roll(env, 100), roll(fresh, 100), strict=True):
        same(a, b)


def test_a_heavy_trunk_weighs_and_falls_as_it_should():
    """At rest the ground carries the share of the weight less what the sagging spring takes."""
    for mass in (50.0, 80.0, 150.0):
        env = gym.make(LEG, episode_seconds=6.0).unwrapped
        env.reset(seed=0, options={"gait": "run", "speed": 0.0, "parameters": {"trunk_mass": mass}})
        weight = (mass + env.geometry.mass) * GRAVITY
        assert env.weight == pytest.approx(weight)
        trace = substeps(env, replace(env.gaits["run"], crank_speed=0.0))
        assert abs(trace["vy"][-1]) < 1e-3
        spring = env.settings.trunk_stiffness * (env.geometry.hip_height - trace["y"][-1])
        assert trace["normal"][-1] == pytest.approx(0.8 * weight - spring, abs=5.0)


def test_ranges_are_drawn_from_the_environments_own_generator():
    ranges = {"trunk_mass": [60.0, 120.0], "friction": (0.2, 0.8), "trunk_drag": 5.0}
    keyword, wrapped, option = (
        gym.make(LEG, randomize=ranges),
        RandomizeParameters(gym.make(LEG), ranges),
        gym.make(LEG),
    )
    seen = []
    for k, seed in enumerate([4, None, None, 4]):
        (one, info), two, three = (
            keyword.reset(seed=seed),
            wrapped.reset(seed=seed),
            option.reset(seed=seed, options={"parameters": ranges}),
        )
        same((one, info), two)
        same((one, info), three)
        drawn = info["parameters"]
        assert drawn.keys() == ranges.keys()
        assert 60.0 <= drawn["trunk_mass"] <= 120.0
        assert 0.2 <= drawn["friction"] <= 0.8
        assert drawn["trunk_drag"] == 5.0
        assert keyword.unwrapped.weight == pytest.approx(
            (drawn["trunk_mass"] + keyword.unwrapped.geometry.mass) * GRAVITY
        )
        seen.append(drawn)
        for action in actions(k, 20):
            same(keyword.step(action)[:4], wrapped.step(action)[:4])
    assert seen[0] == seen[3]
    assert len({drawn["friction"] for drawn in seen}) == 3


def test_drawn_masses_fill_their_range():
    env = gym.make_vec(LEG, num_envs=500, randomize={"trunk_mass": (60.0, 120.0)})
    _, infos = env.reset(seed=0)
    masses = infos["parameters"]["trunk_mass"]
    assert 60 <= masses.min() < 61
    assert 119 < masses.max() <= 120
    assert masses.mean() == pytest.approx(90.0, abs=3.0)


def test_options_have_the_last_word():
    keyword = gym.make(LEG, randomize={"friction": (0.2, 0.3), "trunk_drag": 7.0})
    env = RandomizeParameters(keyword, {"friction": 0.5, "stiffness": 3e4})
    _, info = env.reset(seed=0, options={"gait": "run", "parameters": {"stiffness": 1e4}})
    assert info["parameters"] == {"friction": 0.5, "trunk_drag": 7.0, "stiffness": 1e4}
    assert info["gait"] == {
        name: pytest.approx(value) for name, value in vars(env.unwrapped.gaits["run"]).items()
    }


def test_the_wrapper_is_off_in_evaluation():
    env, plain = RandomizeParameters(gym.make(LEG), {"trunk_mass": (200.0, 300.0)}), gym.make(LEG)
    assert env.reset(seed=0)[1]["parameters"]["trunk_mass"] >= 200.0
    env.enabled = False
    same(env.reset(seed=0), plain.reset(seed=0))
    for a, b in zip(roll(env, 50), roll(plain, 50), strict=True):
        same(a, b)
    assert env.unwrapped.weight == plain.unwrapped.weight


def test_the_wrapper_is_in_the_spec():
    env = RandomizeParameters(gym.make(LEG), {"friction": (0.2, 0.8)})
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    same(again.reset(seed=0), env.reset(seed=0))
    assert "friction" in again.reset()[1]["parameters"]


STIFF = {"motor_gain": (100.0, 2000.0)}


def test_substeps_suit_all_that_can_be_drawn():
    """A range by keyword gets shorter substeps; one at reset comes too late for that and is warned of."""
    plain, varied, hard = make(), make(randomize=STIFF), make(motor_gain=2000.0)
    assert plain.engine.substeps < varied.engine.substeps == hard.engine.substeps
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        varied.reset(seed=0)
        plain.reset(seed=0, options={"parameters": {"motor_gain": 50.0}})
    with pytest.warns(StepWarning, match="speed gain of a motor.*substeps=5 of"):
        plain.reset(seed=0, options={"parameters": STIFF})


def test_numbers_of_a_sweep_and_paths_are_plain_in_settings_and_in_the_saved_spec(tmp_path):
    """They were taken, and then the specification could not be saved."""
    preset = tmp_path / "leg.json"
    gaits = {gait: hoof_env.load_gait(gait, "identified") for gait in ("walk", "run")}
    hoof_env.load_geometry("identified").save(str(preset), gaits=gaits, ground={})
    given = {
        "trunk_mass": np.int64(60), "friction": np.float32(0.5), "episode_seconds": np.int32(4),
        "trunk_share": np.longdouble(0.25),
        "preset": preset, "target_speed": np.array([1.0, 2.0]), "restitution": np.float64(0.25),
        "observation": np.array(["crank", "gait"]), "reward_weights": {"peak": np.float64(2.0)},
        "randomize": {"trunk_drag": (np.float32(1.0), np.int8(3))},
    }  # fmt: skip
    for make, more in ((gym.make, {}), (gym.make_vec, {"num_envs": 2, "autoreset_mode": "SAME_STEP"})):
        env = make(LEG, **given, **more)
        plain = {**env.unwrapped.spec.kwargs}
        json.dumps(plain)
        assert plain["preset"] == str(preset)
        assert plain["randomize"] == {"trunk_drag": (1.0, 3)}
        assert env.unwrapped.settings.friction == 0.5
        assert type(env.unwrapped.settings.trunk_mass) is int
    again = gym.make(gym.envs.registration.EnvSpec.from_json(gym.make(LEG, **given).spec.to_json()))
    assert again.unwrapped.settings.target_speed == [1.0, 2.0]


def test_a_speed_is_commanded_at_a_reset_and_told_in_infos():
    """For the whole episode, also where it would change; the next one draws again."""
    env, envs = gym.make(SPEED, target_seconds=(0.1, 0.2)), gym.make_vec(SPEED, 3, target_seconds=(0.1, 0.2))
    other = gym.make(SPEED, target_seconds=(0.1, 0.2))
    for one in (env, envs):
        _, info = one.reset(seed=0, options={"target_speed": 2.0})
        assert np.all(info["target_speed"] == 2.0)
        for _ in range(30):
            info = one.step(np.zeros(one.action_space.shape, np.float32))[4]
            assert np.all(info["target_speed"] == 2.0)
    assert env.unwrapped.raw_observation()["commanded speed"] == 2.0
    other.reset(seed=0)
    same(env.reset()[0], other.reset()[0])  # the same numbers were drawn
    told = set()
    for _ in range(40):
        info = env.step(np.zeros(4, np.float32))[4]
        assert info["target_speed"] == env.unwrapped.raw_observation()["commanded speed"]
        told.add(float(info["target_speed"]))
    assert len(told) > 3
