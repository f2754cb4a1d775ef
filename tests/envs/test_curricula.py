"""Settings that rows change apart, and schedules by steps: as if single environments had them, and over
states."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, actions, same

from hoof_env import Sb3VecEnv
from hoof_env.errors import FixedSettingError, ParameterError, UnknownArgumentError
from hoof_env.tasks.schedules import Ramp
from hoof_env.tasks.settings import to_json

LEG, SPEED = (f"hoof_env/HorseLeg{name}-v0" for name in ("", "Speed"))
SHORT = {"episode_seconds": 0.2}
"""Ten control steps."""

LEVELS = [
    {"friction": 0.2},
    {"randomize": {"trunk_mass": (40.0, 60.0)}, "strength": 2.0, "schedule": None},
    {"target_speed": [0.5, 1.5], "target_seconds": [0.1, 0.2]},
    {"reward_weights": {"peak": 3.0}, "noise": {"trunk": 0.1}},
    {"schedule": {"strength": [0.0, 1.0, 15]}, "strength": 1.0, "pushes": None},
    {"terrain": {"kind": "hills", "seed": 5, "stiffness": [0.5, 2.0]}},
]


def follow(envs, singles, taken, over, at=None):
    """Step all; single environments start again where rows do. `at` is called before each step."""
    for step, action in enumerate(taken):
        if at:
            at(step)
        rows = envs.step(action)
        for k, one in enumerate(singles):
            if over[k]:
                observation, info = one.reset()
                reward, ended = 0.0, (False, False)
            else:
                observation, reward, *ended, info = one.step(action[k])
            same(rows[0][k], observation)
            same(rows[4]["measured"][k], info["measured"])
            assert (rows[1][k], rows[2][k], rows[3][k]) == (reward, *ended), (step, k)
            over[k] = any(ended)


@pytest.mark.parametrize("n", [3, 9])
def test_each_row_has_the_bits_of_one_that_was_given_its_changes(n):
    """Levels are drawn for rows at random, over copies, pickles and states."""
    generator = np.random.default_rng(n)
    envs = gym.make_vec(LEG, n, **SHORT, noise={"gait": 0.05}, push_impulse=5.0).unwrapped
    singles = [gym.make(LEG, **SHORT, noise={"gait": 0.05}, push_impulse=5.0).unwrapped for _ in range(n)]
    same(envs.reset(seed=4)[0], np.array([one.reset(seed=4 + k)[0] for k, one in enumerate(singles)]))
    over = np.zeros(n, bool)

    def at(step):
        if step % 4 == 1:
            rows = np.flatnonzero(generator.random(n) < 0.4)
            level = LEVELS[generator.integers(len(LEVELS))]
            level = {k: v for k, v in level.items() if k != "pushes"}
            envs.change_settings(envs=rows, **level)
            for k in rows:
                singles[k].change_settings(**level)

    for part in range(3):
        follow(envs, singles, actions(part, 25, n), over, at)
        assert envs.batch.row_plans.are_mixed
        settings = envs.call("settings")
        for one, asked in zip(singles, settings, strict=True):
            assert to_json(one.batch.row_plans.pending_of(0).asked) == to_json(asked)
        state = envs.get_state()
        if part == 0:
            envs = copy.deepcopy(envs)
        elif part == 1:
            envs = pickle.loads(pickle.dumps(envs))
        fresh = gym.make_vec(LEG, n, **SHORT, noise={"gait": 0.05}, push_impulse=5.0).unwrapped
        same(fresh.set_state(pickle.loads(pickle.dumps(state))), envs._observed())
        envs = fresh if part == 1 else envs


def test_levels_that_act_at_starts_cost_no_further_run_of_a_kernel():
    """Strength, parameters and ranges of speeds are of the rows; weights are constants of a kernel."""
    envs = gym.make_vec(SPEED, 4, **SHORT).unwrapped
    envs.reset(seed=0)
    each = {"strength": 0.5}, {"randomize": {"trunk_mass": (45.0, 55.0)}}, {"target_speed": [1.0, 2.0]}
    for row, level in enumerate(each):
        envs.change_settings(envs=[row], **level)
    envs.reset()
    assert len(envs.batch.row_plans.plans) == 4
    assert envs.batch.row_plans.are_mixed
    assert not envs.batch.row_plans.differ
    envs.change_settings(envs=[0], reward_weights={"peak": 1.0})
    envs.reset()
    assert envs.batch.row_plans.differ
    envs.change_settings(strength=1.0, reward_weights=None, randomize=None, target_speed=[1.0, 3.5])
    envs.reset()
    assert len(envs.batch.row_plans.plans) == 1


def test_rows_that_ask_for_what_others_have_share_it():
    envs = gym.make_vec(LEG, 6, **SHORT).unwrapped
    envs.reset(seed=0)
    for row in range(6):
        envs.change_settings(envs=[row], strength=0.5)
    envs.reset()
    assert len(envs.batch.row_plans.plans) == 1


def test_a_callback_of_stable_baselines_promotes_rows():
    """By `env_method` with indices; `get_attr` tells the level of each."""
    envs = Sb3VecEnv(SPEED, num_envs=4, **SHORT)
    envs.seed(0)
    envs.reset()
    envs.env_method("change_settings", indices=[1, 3], target_speed=[3.0, 3.25])
    for _ in range(12):
        envs.step(np.zeros((4, 4), np.float32))
    fast = [info["target_speed"] >= 3.0 for info in envs.reset_infos]
    assert all(fast[1::2])
    assert [one.target_speed for one in envs.get_attr("settings", [0, 1])] == [(1.0, 3.5), [3.0, 3.25]]
    envs.env_method("change_settings", envs=[2], strength=0.5)
    assert [one.strength for one in envs.get_attr("settings")] == [1.0, 1.0, 0.5, 1.0]
    with pytest.raises(ParameterError, match=r"envs: expected none together with indices \[1\], got \[2\]"):
        envs.env_method("change_settings", indices=[1], envs=[2], strength=0.5)


@pytest.mark.parametrize("name", ["terrain", "weights", "resolved_settings"])
def test_what_follows_from_settings_is_each_rows_own(name):
    """As of a single environment that was made with the row's settings, from its next start on."""
    level = {"terrain": {"kind": "hills", "seed": 5}, "reward_weights": {"peak": 3.0}}
    envs = gym.make_vec(LEG, 3, **SHORT).unwrapped
    envs.reset(seed=0)
    before = getattr(gym.make(LEG, **SHORT).unwrapped, name)
    after = getattr(gym.make(LEG, **SHORT, **level).unwrapped, name)
    assert before != after
    envs.change_settings(envs=[1], **level)
    assert envs.get_attr(name) == (before,) * 3
    envs.reset(options={"reset_mask": np.array([True, True, False])})
    assert envs.call(name) == (before, after, before)


@pytest.mark.parametrize(
    ("words", "kind", "changes"),
    [
        ("dt', which stays as", FixedSettingError, {"dt": 0.04}),
        ("observation_delay', which stays as", FixedSettingError, {"observation_delay": 1}),
        ("friction: expected", ParameterError, {"friction": -1.0}),
        ("strength: expected", ParameterError, {"strength": 11.0}),
        (r"envs: expected indices below 3", ParameterError, {"envs": [3], "strength": 1.0}),
        ("unexpected keyword argument 'strenght'", UnknownArgumentError, {"envs": [], "strenght": 1.0}),
        (r"noise: expected a mapping with some of the groups that are observed", ParameterError,
         {"noise": {"target": 1.0}}),
    ],
)  # fmt: skip
def test_refused_changes_change_nothing(words, kind, changes):
    envs = gym.make_vec(LEG, 3, **SHORT).unwrapped
    envs.reset(seed=0)
    with pytest.raises(kind, match=words):
        envs.change_settings(**{"envs": [1], **changes})
    assert len(envs.batch.row_plans.plans) == 1
    assert not envs.batch.row_plans.are_due(np.arange(3))
    assert envs.settings == gym.make(LEG, **SHORT).unwrapped.settings


# Schedules


def test_a_ramp_stays_within_its_bounds_and_reaches_them():
    generator = np.random.default_rng(0)
    for _ in range(200):
        first, last = (tuple(np.sort(generator.uniform(-5, 5, 2))) for _ in range(2))
        ramp = Ramp(first, last, int(generator.integers(1, 100)), True)
        low, high = ramp.range_at(np.arange(200))
        assert (low[0], high[0]) == first
        assert (low[-1], high[-1]) == last
        assert (low <= high).all()
        assert min(low) >= ramp.bounds[0]
        assert max(high) <= ramp.bounds[1]
        assert (np.sign(np.diff(low)) * np.sign(last[0] - first[0]) >= 0).all()
        # A number goes from itself to itself, whatever is rounded; nothing is before the first step.
        number = first[0], first[0]
        assert {*np.ravel(Ramp(number, number, 997, False).range_at(np.arange(1000)))} == {first[0]}
        assert (*ramp.range_at(-7),) == first


SCHEDULE = {
    "strength": [0.0, 2.0, 40], "friction": [0.8, [0.2, 0.4], 30], "target_speed": [1.0, [2.0, 3.0], 35],
}  # fmt: skip


@pytest.mark.parametrize("env_id", [SPEED, HORSE])
def test_a_schedule_follows_the_steps_of_each_row(env_id):
    """Rows that end at other times are elsewhere in it, and have the bits of one; a seed begins it anew."""
    settings = {**SHORT, "schedule": SCHEDULE, "noise": {"trunk": 0.05}}
    envs = gym.make_vec(env_id, 3, **settings).unwrapped
    singles = [gym.make(env_id, **settings).unwrapped for _ in range(3)]
    infos = envs.reset(seed=4)[1]
    for k, one in enumerate(singles):
        one.reset(seed=4 + k)
    assert (infos["parameters"]["friction"] == 0.8).all()
    assert (infos["target_speed"] == 1.0).all()
    over = np.zeros(3, bool)
    taken = actions(1, 60, 3, env_id=env_id)
    follow(envs, singles, taken[:5], over)
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    singles[1].reset()
    assert np.allclose(envs.batch.rows.named.strength[:3], [0.0, 2.0 * 5 / 40, 0.0])
    follow(envs, singles, taken[5:30], over)
    state = envs.get_state()
    fresh = gym.make_vec(env_id, 3, **settings).unwrapped
    fresh.set_state(state)
    follow(fresh, singles, taken[30:], over)
    assert (fresh.batch.rows.named.strength[:3] == 2.0).all()
    friction = fresh.batch.rows.start_values[-1]
    assert ((friction >= 0.2) & (friction <= 0.4)).all()
    infos = fresh.reset(seed=4)[1]
    assert (infos["parameters"]["friction"] == 0.8).all()


def test_a_refused_state_leaves_the_names_of_drawn_parameters():
    """Rows of the state draw a parameter that rows of the environment do not."""
    envs, other = (gym.make_vec(LEG, 2, **SHORT).unwrapped for _ in range(2))
    for each in (envs, other):
        each.reset(seed=0)
    other.change_settings(envs=[1], randomize={"friction": (0.3, 0.5)})
    other.reset()
    for steps in ([0.5, 0.0], [np.inf, 0.0], [np.nan, 0.0], [0.0]):
        with pytest.raises(ParameterError, match=r"state\['steps_before'\]: expected .*number"):
            envs.set_state({**other.get_state(), "steps_before": steps})
        assert "parameters" not in envs.reset()[1]


def test_options_go_before_a_schedule():
    env = gym.make(LEG, schedule=SCHEDULE)
    _, info = env.reset(options={"strength": 0.7, "parameters": {"friction": 0.5}})
    assert info["parameters"]["friction"] == 0.5
    assert env.unwrapped.batch.rows.named.strength[0] == 0.7


@pytest.mark.parametrize(
    ("name", "value", "ramp"),
    [
        ("friction", 0.3, [0.8, 0.2, 30]),
        ("strength", 2.0, [0.0, 1.0, 9]),
        ("target_speed", 1.5, [1.0, 2.0, 9]),
    ],
)
def test_a_setting_that_a_schedule_sets_is_refused(name, value, ramp):
    env = gym.make(SPEED, schedule={name: ramp}).unwrapped
    words = rf"{name}: expected none together with schedule\['{name}'\], which sets it, got .*schedule=None"
    with pytest.raises(ParameterError, match=words):
        env.change_settings(**{name: value})
    if name != "target_speed":  # without which there is no commanded speed
        with pytest.raises(ParameterError, match=words):
            gym.make(SPEED, schedule={name: ramp}, **{name: value})
    env.change_settings(**{name: value}, schedule=None)
    env.reset(seed=0)
    assert env.get_wrapper_attr("settings").schedule is None


def test_scheduled_speeds_have_a_time_for_which_they_hold():
    settings = {"schedule": {"target_speed": [[0.5, 1.0], [2.0, 3.0], 5]}, "target_seconds": (0.04, 0.04)}
    env = gym.make(LEG, **settings)
    env.reset(seed=0)
    speeds = {env.step(np.zeros(4, np.float32))[-1]["target_speed"] for _ in range(8)}
    assert len(speeds) == 5  # the first one, and a new one after each second step


def test_a_schedule_that_is_added_after_a_state_counts_all_steps():
    env, other = (gym.make(LEG, **SHORT).unwrapped for _ in range(2))
    env.reset(seed=0)
    for _ in range(7):
        env.step(np.zeros(4, np.float32))
    env.reset()
    other.reset(seed=1)
    other.set_state(env.get_state())
    for each in (env, other):
        each.change_settings(schedule={"strength": [0.0, 2.0, 40]})
        each.reset()
        assert each.batch.rows.named.strength[0] == 2.0 * 7 / 40
