"""All ids stand on the ground of their preset; and the paper's set-up with the paper's solver."""

import copy
import json
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from family import LEGS, running_peak_charge, together

from hoof_env.envs.policies import make_policy
from hoof_env.episodes.summaries import summary_of
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.gait import PARAMETERS
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.leg.presets import preset_names, read_preset
from hoof_env.records import record_episode
from hoof_env.tasks.settings import Settings

FIXED, LEG = "hoof_env/HorseLegFixed-v0", "hoof_env/HorseLeg-v0"
HOPS = tuple(f"hoof_env/HorseLeg{name}-v0" for name in ("Hop", "Balance", "BalanceSpeed"))


@pytest.fixture
def soft(tmp_path):
    """A preset on another ground."""
    data = {**read_preset(preset_names()[0]), "ground": {"exponent": 1.375, "stiffness": 3e4}}
    path = tmp_path / "soft.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    return str(path)


def ground(name, **settings):
    return gym.make(name, **settings).unwrapped.engine.ground


@pytest.mark.parametrize("solver", ["exact", "paper"])
def test_the_ground_is_the_presets_unless_it_is_given(soft, solver):
    own, given = ground(FIXED, preset=soft, solver=solver), ground(FIXED, preset=soft, exponent=1.25)
    assert (own.stiffness, own.exponent) == (3e4, 1.375)
    assert (given.stiffness, given.exponent) == (3e4, 1.25)


def test_by_default_it_is_what_the_default_preset_says():
    assert ground(FIXED) == load_ground(reference_mass=Settings.trunk_mass)
    for env_id in LEGS:
        if env_id in HOPS:  # its ground is as hard as a horse's, for a hoof that stands on it
            continue
        found = ground(env_id)
        assert (found.stiffness, found.exponent) == (load_ground().stiffness, load_ground().exponent)


def test_the_force_comes_from_the_presets_ground(soft):
    """K sum(d^n) on elastic ground, from the trace alone."""
    env = gym.make(FIXED, preset=soft, gait="run", episode_seconds=0.5)
    env.reset(seed=0)
    env.unwrapped.record()
    done, highest = False, 0.0
    while not done:
        *_, done, _ = env.step(np.zeros(4, np.float32))
        trace = together([env.unwrapped.record()])
        highest = max(highest, trace["normal"].max())
        depths = np.maximum([trace["toe_penetration"], trace["heel_penetration"]], 0)
        np.testing.assert_allclose(trace["normal"], 3e4 * (depths**1.375).sum(axis=0), rtol=1e-12)
    assert highest > 0


def test_the_training_environment_stands_on_the_presets_too(soft):
    own, given = ground(LEG, preset=soft), ground(LEG, preset=soft, stiffness=1e4)
    assert (own.stiffness, own.exponent) == (3e4, 1.375)
    assert (given.stiffness, given.exponent) == (1e4, 1.375)
    both = ground(LEG, preset=soft, stiffness=1e4, exponent=1.25)
    assert replace(both, stiffness=3e4, exponent=1.375) == own


@pytest.mark.parametrize("env_id", [LEG, FIXED])
def test_a_preset_without_a_ground_needs_one(soft, tmp_path, env_id):
    """Its gaits are for some ground, and nobody says which; {} stands for the defaults of `Ground`."""
    content = {name: part for name, part in read_preset(soft).items() if name != "ground"}
    path = tmp_path / "bare.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    for given in ({}, {"stiffness": 1e4}, {"exponent": 1.5}):
        for preset, error in ((content, ParameterError), (str(path), DataFileError)):
            with pytest.raises(error, match=r"expected an entry 'ground' .*stiffness .*exponent"):
                gym.make(env_id, preset=preset, **given)
    given = ground(env_id, preset=content, stiffness=1e4, exponent=1.25)
    assert (given.stiffness, given.exponent) == (1e4, 1.25)
    default = ground(env_id, preset={**content, "ground": {}})
    assert (default.stiffness, default.exponent) == (Ground.stiffness, Ground.exponent)


def test_a_bad_ground_of_a_file_is_named(soft, tmp_path):
    path = tmp_path / "bad.json"
    path.write_text(json.dumps({**read_preset(soft), "ground": {"n": 1.4}}), encoding="utf-8")
    with pytest.raises(DataFileError, match=r"bad\.json.*'n'"):
        gym.make(FIXED, preset=str(path))


@pytest.mark.parametrize("arguments", [{}, {"gait": "run"}])
def test_the_policy_run_is_the_papers_run(arguments):
    """Also where episodes start in the walk: the reset takes the policy's gait. The paper prints a peak of
    5719 N; in its walk, or in a run that a box of actions cuts off, it is another number."""
    env = gym.make(FIXED, **arguments)
    record = record_episode(env, make_policy("run", env))
    normal = record["toe_normal"] + record["heel_normal"]
    assert normal.max() == pytest.approx(5719, rel=0.01)
    run = env.unwrapped.gaits["run"]
    for name in PARAMETERS:
        np.testing.assert_allclose(record[f"command_{name}"], getattr(run, name), atol=1e-6)


def test_the_papers_solver_counts_strides_as_the_kernels_do():
    """Its sums of the record are the engine's at the same step, as far as its leg drifts."""
    measured, distance = {}, {}
    for solver in ("paper", "exact"):
        settings = {"integrator": "rk4"} if solver == "paper" else {}
        env = gym.make(FIXED, solver=solver, gait="run", sim_dt=1e-3, **settings)
        env.reset(seed=0, options={"crank_angle": 1.0})
        records, paid = [env.unwrapped.record()], 0.0
        for _ in range(50):
            paid += env.step(np.zeros(4, np.float32))[4]["reward_peak"]
            records.append(env.unwrapped.record())
        trace, summary = together(records[1:]), summary_of(env.unwrapped.batch, 0)
        slid = sum(trace[f"{point}_normal"] * trace[f"{point}_slide"] for point in ("toe", "heel"))
        down = trace["normal"] > 0
        assert summary["distance_m"] == pytest.approx(-1e-3 * np.sum(slid[down] / trace["normal"][down]))
        assert summary["duty_factor"] == pytest.approx(down.mean())
        work = 1e-3 * np.sum(np.maximum(trace["crank_power"], 0) + np.maximum(trace["hip_power"], 0))
        assert summary["positive_work_j"] == pytest.approx(work)
        assert summary["highest_grf_n"] == pytest.approx(trace["grf"].max())
        assert paid == pytest.approx(-0.3e-3 * running_peak_charge(trace["grf"]))
        measured[solver], distance[solver] = summary, summary["distance_m"]
    for name in ("stances", "stance_peak_sum_n", "loading_rate_n_s", "mean_normal_n", "duty_factor"):
        assert measured["paper"][name] == pytest.approx(measured["exact"][name], rel=0.02), name


@pytest.mark.parametrize("settings", [{"baumgarte_beta": 1500.0}, {"baumgarte_alpha": 1e6}, {"sim_dt": 0.01}])
def test_a_linkage_that_diverges_ends_the_episode_and_pays_nothing(settings):
    env = gym.make(FIXED, solver="paper", gait="run", **settings).unwrapped
    env.reset(seed=0)
    env.record()
    done = False
    while not done:
        before, time = summary_of(env.batch, 0), env.engine.legs[0].state.body.time
        observation, reward, done, truncated, info = env.step(np.zeros(4, np.float32))
        assert not truncated
        assert np.isfinite(observation).all()
        assert done or abs(reward) < 10
    assert "last good" in str(info["end"])
    rest = env.settings.episode_seconds - before["seconds"]
    assert reward == info["reward_failure"] == pytest.approx(-env.weights["failure"] * rest)
    assert info["episode_summary"] == {**before, "failed": 1.0}
    assert env.record()["time"].ravel() == pytest.approx([time])  # where it is


def test_a_bad_state_of_the_papers_solver_is_refused_and_changes_nothing():
    env = gym.make(FIXED, solver="paper").unwrapped
    env.reset(seed=0)
    then = env.get_state()
    env.step(env.action_space.sample())
    here = pickle.dumps(env.get_state())
    engine = then["engine"]
    infinite = copy.deepcopy(engine)
    infinite["legs"][0]["q"][3] = np.inf
    short = {**engine, "legs": [{**engine["legs"][0], "qd": np.zeros(41)}]}
    without = {name: values for name, values in engine.items() if name != "accounts"}
    for bad in (None, 5, {}, without, {**engine, "legs": []}, infinite, short):
        with pytest.raises(ParameterError, match="state: expected what get_state returns for 1 legs"):
            env.set_state({**then, "engine": bad})
        assert pickle.dumps(env.get_state()) == here


def test_rows_of_the_papers_solver_have_their_own_settings():
    """Where kernels differ between rows each leg is advanced once a step, on its own ground."""
    settings = {"solver": "paper", "gait": "run", "episode_seconds": 1.0}
    envs = gym.make_vec(FIXED, 2, **settings).unwrapped
    envs.reset(seed=0)
    changes = {"restitution": 0.2, "reward_weights": {"peak": 3.0}}
    envs.change_settings(envs=[1], **changes)
    observations, _ = envs.reset(seed=0)
    alone = [gym.make(FIXED, **settings, **given).unwrapped for given in ({}, changes)]
    for seed, env in enumerate(alone):
        assert (observations[seed] == env.reset(seed=seed)[0]).all()
    actions = np.full((2, 4), 0.5, np.float32)
    highest = np.zeros(2)
    for _ in range(40):
        observations, rewards, *_ = envs.step(actions)
        for row, env in enumerate(alone):
            observation, reward, *_ = env.step(actions[row])
            assert (observations[row] == observation).all()
            assert rewards[row] == reward
            highest[row] = max(highest[row], env.record()["toe_normal"].max())
    assert 0.0 < highest[0] != highest[1] > 0.0


def test_a_refused_state_leaves_the_papers_solver_where_it_was():
    env = gym.make(FIXED, solver="paper", gait="run").unwrapped
    env.reset(seed=0)
    for _ in range(3):
        env.step(np.zeros(4, np.float32))
    twin, state = copy.deepcopy(env), env.get_state()
    other = copy.deepcopy(state)
    other["engine"]["last"]["crank_speed"] = np.nan  # found only by what is observed then
    with pytest.raises(ParameterError, match=r"state: expected numbers of a motion .* is nan"):
        env.set_state(other)
    for _ in range(5):
        one, same_one = env.step(np.ones(4, np.float32)), twin.step(np.ones(4, np.float32))
        assert (one[0] == same_one[0]).all()
        assert one[1] == same_one[1]
