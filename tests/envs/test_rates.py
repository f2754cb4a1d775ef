"""Actions of one leg are rates of the gait's parameters: zero keeps a gait, `action_for` goes to another."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from family import LEGS, actions, same, substeps
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.envs.open_loop import open_loop
from hoof_env.errors import ParameterError
from hoof_env.gait import PARAMETERS, FilterSettings, GaitParameters, load_gait
from hoof_env.tasks.observation import HIGH, LOW, MIDDLE

LEG, *ONE_GAIT = (f"hoof_env/HorseLeg{name}-v0" for name in ("", "Fixed", "Hop", "Balance", "BalanceSpeed"))
FIXED = ONE_GAIT[0]
ZERO = np.zeros(4, np.float32)


def gaits_of(env):
    """Gait parameters at present, shape (num_envs, 4)."""
    state = env.unwrapped.engine.state
    return np.stack([state[name][0] for name in PARAMETERS], -1)


def rates_of(env):
    state = env.unwrapped.engine.state
    return np.stack([state[f"{name}_rate"][0] for name in PARAMETERS], -1)


@pytest.mark.parametrize("settings", [{}, {"drive": "motor"}], ids=["", "motor"])
@pytest.mark.parametrize("env_id", LEGS)
def test_a_zero_action_keeps_the_gait_to_the_bit(env_id, settings):
    env = gym.make_vec(env_id, num_envs=9, autoreset_mode="DISABLED", **settings)
    env.reset(seed=0)
    before = gaits_of(env)
    assert len(np.unique(before[:, 1])) > 1 or env_id in ONE_GAIT  # not all in one gait
    for _ in range(40):
        env.step(np.zeros((9, 4), np.float32))
        same(gaits_of(env), before)
        assert not rates_of(env).any()


def test_so_it_does_in_the_papers_solver():
    env = gym.make(FIXED, solver="paper")
    env.reset(seed=0, options={"gait": "run"})
    before = gaits_of(env)
    same(before[0], load_gait("run").to_array())
    for _ in range(5):
        env.step(ZERO)
        same(gaits_of(env), before)


def test_a_change_fades_under_zero_actions():
    """To a hundredth in half a second, and without a sign of oscillation."""
    env = gym.make(LEG)
    env.reset(seed=0, options={"gait": "run"})
    for action in actions(0, 10):
        env.step(action)
    before = rates_of(env)
    assert np.abs(before).max() > 0.1
    for _ in range(25):
        env.step(ZERO)
        assert (rates_of(env) * before > -1e-12).all()
    assert np.abs(rates_of(env)).max() < 0.01 * np.abs(before).max()


def test_zeros_from_the_run_are_the_papers_run():
    """Figures of the paper's run on the fixed trunk, by the exact solver."""
    env = gym.make(FIXED)
    env.reset(seed=0, options={"gait": "run"})
    normal = substeps(env)["normal"]
    assert round(normal.max()) == 5697
    assert round(normal.mean()) == 809


def change_in(env, parameter, sign, steps, settle=6):
    """Rate at which a parameter changes under a steady action once the filter is under way, and how
    much the others do."""
    begin = MIDDLE.copy()
    begin[parameter] = (LOW if sign > 0 else HIGH)[parameter]  # with the whole range to go
    env.reset(seed=0, options={"gait": GaitParameters.from_array(begin)})
    action = ZERO.copy()
    action[parameter] = sign
    for _ in range(settle):
        env.step(action)
    before = gaits_of(env)[0]
    for _ in range(steps):
        env.step(action)
    change = (gaits_of(env)[0] - before) / (steps * env.unwrapped.dt)
    return change[parameter], np.delete(change, parameter)


@pytest.mark.parametrize("sign", [1.0, -1.0, 0.5])
@pytest.mark.parametrize("parameter", range(4), ids=PARAMETERS)
@pytest.mark.parametrize(
    "rates", [{}, {"crank_rate": 2.0, "swing_rate": 2.5}, {"crank_rate": 10.0, "dt": 0.01}], ids=str
)
def test_a_steady_action_changes_the_gait_at_the_rate_of_its_setting(rates, parameter, sign):
    env = gym.make(LEG, trunk="fixed", **rates)
    s = env.unwrapped.settings
    settle = round(0.5 / s.dt)
    rate, others = change_in(env, parameter, sign, 4, settle)
    assert rate == pytest.approx(sign * (s.swing_rate if parameter else s.crank_rate), rel=0.015)
    assert not others.any()


@pytest.mark.parametrize("parameter", range(4), ids=PARAMETERS)
def test_rates_as_fast_as_the_filters_hardly_lag_behind_them(parameter):
    """There a filter is at its bound for a part of each step, and cannot make up for it."""
    bounds = FilterSettings()
    env = gym.make(LEG, trunk="fixed", crank_rate=bounds.crank_rate, swing_rate=bounds.swing_rate)
    bound = bounds.swing_rate if parameter else bounds.crank_rate
    rate, _ = change_in(env, parameter, 1.0, 3, 8)
    assert 0.88 * bound < rate < bound


@given(seed=st.integers(0, 1000), held=st.integers(1, 60))
@settings(max_examples=20, deadline=None)
def test_no_action_leaves_the_limits(seed, held):
    """Even where it is held for longer than it takes from end to end."""
    env = gym.make_vec(LEG, num_envs=9, trunk="fixed", autoreset_mode="DISABLED")
    env.reset(seed=seed)
    for action in np.sign(actions(seed, 3, 9)):
        for _ in range(held):
            env.step(action)
            gaits = gaits_of(env)
            assert (gaits >= LOW - 1e-9).all()
            assert (gaits <= HIGH + 1e-9).all()


@pytest.mark.parametrize("given", ["run", "walk", load_gait("run"), LOW, HIGH], ids=str)
@pytest.mark.parametrize("env_id", [LEG, FIXED])
def test_action_for_goes_to_a_gait_and_stays_there(env_id, given):
    """As fast as is allowed: what is furthest off sets the pace."""
    env = gym.make(env_id, episode_seconds=10.0).unwrapped
    env.reset(seed=0, options={"gait": "carrying_walk"})
    values = load_gait(given).to_array() if isinstance(given, str) else given
    target = values if isinstance(values, np.ndarray) else values.to_array()
    s = env.settings
    rates = np.array([s.crank_rate, *[s.swing_rate] * 3])
    needed = np.abs(target - gaits_of(env)[0]) / rates
    assert needed.max() > 0.1
    arrived = np.full(4, np.inf)
    for step in range(round((needed.max() + 1.0) / s.dt)):
        action = env.action_for(given)
        assert (action.shape, action.dtype) == ((4,), np.float32)
        assert np.abs(action).max() <= 1.0
        env.step(action)
        here = gaits_of(env)[0]
        assert (here >= LOW - 1e-9).all()
        assert (here <= HIGH + 1e-9).all()
        assert (np.abs(rates_of(env)[0]) <= 1.2 * rates).all()
        near = np.abs(here - target) <= 0.02 * (HIGH - LOW)
        arrived = np.where(near, np.minimum(arrived, (step + 1) * s.dt), np.inf)
    np.testing.assert_allclose(gaits_of(env)[0], target, atol=2e-6)
    same(env.action_for(given), ZERO)
    assert (arrived < needed + 0.2).all()


def test_of_many_each_goes_from_where_it_is():
    """To one gait for all or to one for each, as each alone does."""
    many = gym.make_vec(LEG, num_envs=3, trunk="fixed", autoreset_mode="DISABLED").unwrapped
    singles = [gym.make(LEG, trunk="fixed").unwrapped for _ in range(3)]
    many.reset(seed=4)
    for k, one in enumerate(singles):
        one.reset(seed=4 + k)
    targets = np.random.default_rng(0).uniform(LOW, HIGH, (3, 4))
    for gait in ["run"] * 5 + [targets] * 150:
        taken = many.action_for(gait)
        assert (taken.shape, taken.dtype) == ((3, 4), np.float32)
        for k, one in enumerate(singles):
            alone = one.action_for(gait if isinstance(gait, str) else gait[k])
            same(taken[k], alone)
            one.step(alone)
        many.step(taken)
    np.testing.assert_allclose(gaits_of(many), targets, atol=1e-4)


def test_a_gait_beyond_what_can_be_commanded_is_refused_by_its_parameter():
    """It used to be clipped without a word: another gait was played."""
    one, beyond = gym.make(LEG), load_gait("run").to_array()
    one.reset(seed=0)
    beyond[0] = HIGH[0] + 1.0
    with pytest.raises(ParameterError, match=r"gait: expected crank_speed from 0 to 12.5664.*got 13.5664"):
        one.unwrapped.action_for(beyond)
    with pytest.raises(ParameterError, match=r"constant: expected swing_cos from -0.9 to 0.9.*got -2"):
        open_loop({"constant": [5.0, 0.4, 0.0, -2.0]}, one)


def test_actions_say_what_they_are():
    env = gym.make(LEG).unwrapped
    assert env.action_names == tuple(f"rate_of_{name}" for name in PARAMETERS)
    assert env.action_form == "rates"
    assert gym.make_vec(LEG, num_envs=2).unwrapped.action_form == "rates"
    assert gym.make("hoof_env/Horse-v0").unwrapped.action_form == "offsets of 0.4 and 0.04 rad"


TRUE_RATE = "true rate of the crank"


def test_a_prescribed_crank_turns_at_the_filters_speed_and_is_observed_once():
    env = gym.make(LEG).unwrapped
    env.reset(seed=0)
    assert TRUE_RATE not in env.observation_names
    for action in actions(0, 50):
        env.step(action)
        assert env.engine.state["crank_angle_rate"].item() == env.engine.state["crank_speed"].item()


def test_the_crank_of_a_motor_is_observed_beside_what_it_is_asked_for():
    env = gym.make(LEG, drive="motor").unwrapped
    seen, _ = env.reset(seed=0, options={"gait": "run"})
    place, asked = (env.observation_names.index(name) for name in (TRUE_RATE, "crank speed"))
    assert place == 2
    env.record()
    apart = []
    for _ in range(100):
        seen, *_ = env.step(ZERO)
        now = env.record()["crank_angle_rate"].ravel()[-1]
        assert env.raw_observation()[TRUE_RATE] == now
        assert seen[place] == pytest.approx(
            np.clip((now - MIDDLE[0]) / (HIGH[0] - MIDDLE[0]), -1, 1), abs=1e-6
        )
        apart.append(abs(seen[place] - seen[asked]))
    assert max(apart) > 0.01
