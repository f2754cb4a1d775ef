"""Infos: the same keys at a reset and at a step, and numbers that say what they promise."""

from __future__ import annotations

import copy
import json
import pickle

import gymnasium as gym
import numpy as np
import pytest
import yaml
from family import FALLS, IDS, actions, same, together
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from hoof_env.episodes.infos import NamedArray, measured_names, name_columns, row_of
from hoof_env.episodes.summaries import SUMMARY
from hoof_env.errors import ParameterError
from hoof_env.evaluation.episodes import play
from hoof_env.gait import PARAMETERS
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.reward import TERMS as TABLE

LEG = "hoof_env/HorseLeg-v0"
START = OneLeg.start_names
TERMS = tuple(term.key for term in TABLE)
DRAWN = {"randomize": {"friction": (0.2, 0.8), "trunk_mass": 70.0}}


@pytest.mark.parametrize("settings", [{}, DRAWN], ids=["plain", "randomized"])
@pytest.mark.parametrize("env_id", IDS)
def test_reset_and_step_have_the_same_keys_of_numpys_numbers(env_id, settings):
    env = gym.make(env_id, **settings)
    env = gym.make(env_id, episode_seconds=3 * env.unwrapped.dt, **settings)
    _, first = env.reset(seed=0)
    infos = [first, *(env.step(taken)[4] for taken in actions(0, 2, env_id=env_id))]
    start, terms = env.unwrapped.body.start_names, env.unwrapped.terms
    more = {"parameters"} if settings else set()
    if env.unwrapped.settings.target_speed is not None:
        more.add("target_speed")
    if env.unwrapped.costs:
        more |= {"cost", *env.unwrapped.costs}
    for info in infos:
        assert set(info) == {*start, "gait", "measured", "unweighted", *terms, *more}
        for key, value in info.items():
            assert isinstance(value, np.float64 | np.ndarray), key
            assert value.dtype == np.float64
        for key in (*start, "gait", *(["parameters"] if settings else [])):
            same(info[key], first[key])
    assert {*env.step(actions(0, env_id=env_id))[4]} - {*first} == {
        "episode_summary",
        "end",
        "is_success",
    }


@pytest.mark.parametrize("env_id", IDS)
def test_what_an_ended_episode_says_can_be_written_as_yaml_and_json(env_id):
    """As loggers do with an info, which know Python's numbers only."""
    env = gym.make(env_id, episode_seconds=0.06)
    env.reset(seed=0)
    *_, info = [env.step(taken)[4] for taken in actions(0, 3, env_id=env_id)]
    summary = info["episode_summary"]
    for told in (summary, info["end"], info["is_success"], env.unwrapped.episode_summary()):
        same(yaml.safe_load(yaml.safe_dump(told)), told)
        assert json.loads(json.dumps(told)) == told
    costs = env.unwrapped.costs
    assert set(summary) == {*SUMMARY, *costs, *(["cost"] if costs else [])}


@pytest.mark.parametrize("target", [1.0, 3.0])
def test_a_target_speed_counts_as_commanded(target):
    """Success of the run, which goes at 2.2 m/s, and falls for no target."""
    env = gym.make(LEG, target_speed=target, episode_seconds=4.0)
    (episode,) = play(env, "run", [0])
    assert 1.8 < episode["speed_m_s"] < 2.6
    assert episode["failed"] == 0
    assert episode["success"] == (target == 1.0)
    assert "`target_speed`" in SUMMARY["success"][1]


@pytest.mark.parametrize("kind", [SyncVectorEnv, AsyncVectorEnv])
def test_gymnasiums_vector_environments_stack_them(kind):
    settings = {"episode_seconds": 0.06, **DRAWN}
    theirs, ours = kind([lambda: gym.make(LEG, **settings)] * 2), gym.make_vec(LEG, num_envs=2, **settings)
    theirs.reset(seed=0), ours.reset(seed=0)
    for taken in actions(0, 6, 2):
        one, two = theirs.step(taken)[4], ours.step(taken)[4]
        for key in ("gait", "measured", "unweighted", "parameters", *START, *TERMS):
            assert one[f"_{key}"].all()
            same(one[key], two[key])
    theirs.close()


def test_measurements_agree_with_the_record():
    env = gym.make(LEG).unwrapped
    env.reset(seed=3)
    env.record()
    loaded = 0
    for taken in actions(1, 60):
        measured, record = env.step(taken)[4]["measured"], env.record()
        last, trace = {name: values[-1].item() for name, values in record.items()}, together([record])
        for name in set(last) & set(measured_names()):
            assert measured[name] == last[name], name
        assert measured["highest_grf"] == pytest.approx(trace["grf"].max(), rel=1e-12)
        assert measured["normal_impulse"] == pytest.approx(env.sim_dt * trace["normal"].sum(), rel=1e-9)
        assert measured["loaded_time"] == pytest.approx(env.sim_dt * (trace["normal"] > 0).sum(), abs=1e-12)
        assert measured["result"] == 0
        loaded += measured["highest_grf"] > 100
    assert loaded > 5


def test_nothing_is_measured_of_a_step_that_did_not_happen():
    for n in (1, 9):
        env = gym.make_vec(LEG, num_envs=n, autoreset_mode="DISABLED", episode_seconds=60.0).unwrapped
        single = gym.make(LEG, episode_seconds=60.0).unwrapped
        env.reset(seed=0, options={"gait": "run"}), single.reset(seed=0, options={"gait": "run"})
        for leg in (env, single):  # a rate that no step survives
            state = leg.get_state()
            state["engine"]["limbs"][0, 6, 0] = 1e300
            leg.set_state(state)
            leg.engine._memory.stride_sums[:] = 1.0  # of some step before
        infos, info = env.step(np.zeros((n, 4), np.float32))[4], single.step(np.zeros(4, np.float32))[4]
        same(np.asarray(infos["measured"][0]), np.asarray(info["measured"]))
        assert info["measured"]["result"] == 1
        assert info["measured"]["highest_grf"] == info["measured"]["normal_impulse"] == 0.0
        assert np.isfinite(info["measured"]).all()


def test_results_of_arithmetic_with_named_numbers_have_no_names():
    gait = gym.make(LEG).reset(seed=0)[1]["gait"]
    assert gait
    assert not (gait > 100.0).any()
    assert not np.isnan(gait).any()
    assert type(gait.max()) is type(gait.sum()) is np.float64
    assert gait.get("crank_speed") == gait["crank_speed"] == gait[0]
    assert gait.get("speed") is None
    with pytest.raises(ValueError, match="more than one element is ambiguous"):
        bool(gait > 3.0)
    many = gym.make_vec(LEG, num_envs=3)
    started = many.reset(seed=0)[1]["gait"]
    assert started == many.step(actions(0, 3))[4]["gait"]
    assert started != many.reset(seed=1)[1]["gait"]


def test_infos_are_nobody_elses():
    env = gym.make(LEG, **DRAWN)
    infos = [env.reset(seed=0)[1], *(env.step(taken)[4] for taken in actions(0, 5))]
    kept = copy.deepcopy(infos)
    for k in (0, 2):
        for key in ("gait", "measured", "unweighted", "parameters"):
            infos[k][key][:] = -1.0
        env.step(actions(0))
        same(env.step(actions(0))[4]["gait"], kept[1]["gait"])
    same(infos[1:2] + infos[3:], kept[1:2] + kept[3:])


@pytest.mark.parametrize("n", [0, 3])
def test_a_state_says_what_the_episode_started_with(n):
    def make():
        env = gym.make_vec(LEG, num_envs=n, **DRAWN) if n else gym.make(LEG, **DRAWN)
        return env.unwrapped

    env, other, taken = make(), make(), actions(0, *([n] if n else []))
    env.reset(seed=0, options={"gait": "walk"})
    state = pickle.loads(pickle.dumps(env.get_state()))
    other.set_state(state)
    info = env.step(taken)[4]
    same(info, other.step(taken)[4])
    del state["start_values"]  # as in states of older versions
    other.set_state(state)
    old = other.step(taken)[4]
    assert np.isnan(old["crank_angle"]).all()
    assert np.isnan(old["gait"]).all()
    same(np.asarray(old["measured"]), np.asarray(info["measured"]))
    for wrong in ("fast", np.zeros((2, 2))):
        with pytest.raises(ParameterError, match=r"state\['start_values'\]: expected numbers, shape \(10, "):
            other.set_state(state | {"start_values": wrong})


def test_named_rows():
    row = name_columns([1.0, 2.0, 3.0, 4.0], PARAMETERS)
    many = name_columns(np.arange(8.0).reshape(2, 4), PARAMETERS)
    assert (row["swing_cos"], row[3], type(row["swing_cos"])) == (4.0, 4.0, np.float64)
    same(many["swing_offset"], np.array([1.0, 5.0]))
    assert row == dict(row) == {"crank_speed": 1, "swing_offset": 2, "swing_sin": 3, "swing_cos": 4}
    assert row != {**row, "swing_cos": 0}
    assert row != name_columns([1.0, 2.0, 3.0, 5.0], PARAMETERS)
    assert ((row == np.array([1, 0, 3, 4])) == [True, False, True, True]).all()
    assert ((row != np.array([1, 0, 3, 4])) == [False, True, False, False]).all()
    assert list(row.values()) == [*row]
    assert "swing_sin" in row
    assert "fast" not in row
    assert bool(row)
    for twin in (copy.copy(row), copy.deepcopy(row), row.copy(), pickle.loads(pickle.dumps(row))):
        assert isinstance(twin, NamedArray)
        assert twin == row
        assert not np.shares_memory(twin, row)
    with pytest.raises(KeyError, match="fast"):
        row["fast"]
    changed = row.copy()
    changed["swing_sin"] = 9.0
    changed[0] = 8.0
    assert (changed["swing_sin"], changed[0], row["swing_sin"] == 9.0) == (9.0, 8.0, False)
    with pytest.raises(KeyError, match="fast"):
        changed["fast"] = 1.0
    gait = name_columns([5.0, 0.5, -0.1, 0.1], PARAMETERS)
    assert gym.make(LEG).reset(seed=0, options={"gait": gait})[1]["gait"] == gait


def test_the_row_of_an_environment():
    env, single = gym.make_vec(LEG, num_envs=4, **DRAWN, **FALLS), gym.make(LEG, **DRAWN, **FALLS)
    _, infos = env.reset(seed=0)
    _, info = single.reset(seed=2)
    same(row_of(infos, 2), info)
    _, infos = env.reset(options={"reset_mask": np.array([True, False, True, False])})
    assert row_of(infos, 1) == {}


def test_named_numbers_print_their_names_with_their_values():
    row = name_columns([6.5, -0.25, np.nan], ("crank_speed", "swing_sin", "normal_force"))
    expected = "NamedArray(crank_speed=6.5, swing_sin=-0.25, normal_force=nan)"
    assert repr(row) == str(row) == f"{row}" == expected
    two = name_columns([[1.0, 2.0], [3.0, 4.0]], ("x", "y"))
    assert repr(two) == "NamedArray(\n  x=[1., 3.],\n  y=[2., 4.]\n)"
    assert repr(two["x"]) == repr(np.array([1.0, 3.0]))
    assert repr(two.reshape(4)) == repr(np.array([1.0, 2.0, 3.0, 4.0]))  # no longer a row of names
    assert repr(name_columns([], ())) == "NamedArray()"
    many = name_columns(np.zeros((5000, 2)), ("x", "y"))
    assert len(repr(many)) < 500
    env = gym.make(LEG)
    shown = repr(env.reset(seed=0)[1]["measured"])
    assert all(f"{name}=" in shown for name in measured_names())
