"""Settings that change from the next reset on: as if made with them, alone, in a batch and under SB3."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, actions, same

from hoof_env import Sb3VecEnv
from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.errors import ParameterError

LEG, SPEED, TERRAIN = (f"hoof_env/HorseLeg{name}-v0" for name in ("", "Speed", "Terrain"))

CHANGES = [
    (LEG, {"target_speed": [0.5, 1.5], "target_seconds": [0.1, 0.2]}),
    (LEG, {"reward_weights": {"peak": 3.0, "energy": 0.7}}),
    (LEG, {"randomize": {"friction": (0.2, 0.8), "trunk_mass": (40.0, 60.0)}}),
    (LEG, {"terrain": {"kind": "hills", "seed": 5, "stiffness": [0.5, 2.0]}}),
    (TERRAIN, {"terrain": {"kind": "hills", "seed": 9, "rise": 0.1}}),
    (SPEED, {"target_speed": [1.0, 1.2], "reward_weights": {"overspeed": 2.0}}),
    (HORSE, {"terrain": {"kind": "slope", "angle": 0.05}, "target_speed": [1.5, 2.0]}),
]
SHORT = {"episode_seconds": 0.2}
"""Ten control steps."""


def played(env, taken):
    """What steps of an environment give, which starts again by itself; with the reset of the next step."""
    found, over = [], False
    for action in taken:
        if over:
            found.append(env.reset())
            over = False
            continue
        found.append(env.step(action))
        over = found[-1][2] or found[-1][3]
    return found


@pytest.mark.parametrize(("env_id", "changes"), CHANGES, ids=str)
def test_the_next_episode_equals_an_environment_made_with_the_settings(env_id, changes):
    """To the bit, infos included; the episode before goes on as if nothing had been asked."""
    env, old, made = (gym.make(env_id, **SHORT, **given) for given in ({}, {}, changes))
    taken = actions(1, 25, env_id=env_id)
    for one in (env, old):
        one.reset(seed=3)
    same(played(env, taken[:4]), played(old, taken[:4]))
    env.unwrapped.change_settings(**changes)
    same(played(env, taken[4:10]), played(old, taken[4:10]))
    same(env.reset(seed=8), made.reset(seed=8))
    assert env.unwrapped.settings == made.unwrapped.settings
    same(played(env, taken), played(made, taken))
    one, other = env.unwrapped.get_state(), made.unwrapped.get_state()
    assert one["settings"] == other["settings"]
    same(env.unwrapped.set_state(other), made.unwrapped.set_state(one))
    same(played(env, taken), played(made, taken))


@pytest.mark.parametrize("n", [3, 17])
@pytest.mark.parametrize(("env_id", "changes"), CHANGES, ids=str)
def test_a_row_takes_them_when_it_starts_again_and_has_the_bits_of_one(env_id, changes, n):
    """Rows end at different times: so long they are under different settings, more than two at once."""
    envs = gym.make_vec(env_id, num_envs=n, **SHORT).unwrapped
    singles = [gym.make(env_id, **SHORT).unwrapped for _ in range(n)]
    same(envs.reset(seed=4)[0], np.array([one.reset(seed=4 + k)[0] for k, one in enumerate(singles)]))
    taken, over = actions(2, 40, n, env_id=env_id), np.zeros(n, bool)
    original = gym.make(env_id).unwrapped.settings
    back = {name: getattr(original, name) for name in changes}
    for step, action in enumerate(taken):
        if step == 3:  # rows end apart
            mask = np.arange(n) % 3 == 1
            envs.reset(options={"reset_mask": mask})
            for k in np.flatnonzero(mask):
                singles[k].reset()
        for at, asked in ((5, changes), (14, back)):
            if step == at:
                envs.change_settings(**asked)
                for one in singles:
                    one.change_settings(**asked)
        if step == 22:
            envs = copy.deepcopy(envs)
        rows = envs.step(action)
        for k, one in enumerate(singles):
            if over[k]:
                observation, reward, ended = one.reset()[0], 0.0, (False, False)
            else:
                observation, reward, *ended, info = one.step(action[k])
                same(rows[4]["measured"][k], info["measured"])
            same(rows[0][k], observation)
            assert (rows[1][k], rows[2][k], rows[3][k]) == (reward, *ended), (step, k)
            over[k] = any(ended)


def test_a_refused_reset_keeps_the_episode():
    """Also its settings: options are checked for those that come."""
    env = gym.make(LEG, **SHORT).unwrapped
    env.reset(seed=0)
    env.change_settings(target_speed=None)
    with pytest.raises(ParameterError, match=r"target_speed.*expected none .*speed is commanded"):
        env.reset(options={"target_speed": 1.0})
    assert env.settings.target_speed == (2.5, 2.5)
    assert "target_speed" in env.step(np.zeros(4, np.float32))[4]
    assert "target_speed" not in env.reset()[1]


def test_a_state_has_the_settings_of_each_row():
    """Those that come, too: an environment that was made with the first ones goes on alike."""
    envs = gym.make_vec(LEG, 4, **SHORT).unwrapped
    envs.reset(seed=0)
    envs.change_settings(reward_weights={"peak": 1.0})
    envs.reset(options={"reset_mask": np.array([True, False, False, False])})
    state = pickle.loads(pickle.dumps(envs.get_state()))
    other = gym.make_vec(LEG, 4, **SHORT).unwrapped
    same(other.set_state(state), envs._observed())
    for action in actions(1, 25, 4):
        same(other.step(action)[:4], envs.step(action)[:4])
    assert not other.batch.row_plans.are_mixed
    broken = {**state, "rows": {**state["rows"], "which": [0, 0, 0, 9]}}
    with pytest.raises(ParameterError, match=r"state\['rows'\]: expected settings .*environment"):
        other.set_state(broken)


def test_sb3_asks_all_at_once():
    """As a callback does by `training_env.env_method`."""
    envs = Sb3VecEnv(SPEED, num_envs=4, **SHORT)
    envs.seed(0)
    envs.reset()
    envs.env_method("change_settings", target_speed=[1.0, 1.25])
    for _ in range(12):
        envs.step(np.zeros((4, 4), np.float32))
    assert all(1.0 <= info["target_speed"] <= 1.25 for info in envs.reset_infos)
    assert envs.get_attr("settings")[0].target_speed == [1.0, 1.25]
    assert all(1.0 <= one["commanded speed"] <= 1.25 for one in envs.env_method("raw_observation"))


def test_what_the_caller_keeps_is_no_setting():
    """A mapping that is edited in place changes nothing until it is given again."""
    weights = {"peak": 1.0}
    env = HorseLegEnv(task="speed", reward_weights=weights)
    weights["peak"] = 9.0
    env.change_settings(target_speed=1.0)
    env.reset(seed=0)
    assert env.settings.reward_weights["peak"] == 1.0
    env.change_settings(reward_weights=weights)
    weights["peak"] = 3.0
    env.change_settings(target_speed=2.0)
    env.reset(seed=0)
    assert env.settings.reward_weights["peak"] == 9.0


def test_an_interrupted_call_leaves_the_newest_settings_and_the_other_rows(monkeypatch):
    envs = gym.make_vec("hoof_env/HorseLegSpeed-v0", num_envs=4, autoreset_mode="DISABLED").unwrapped
    envs.reset(seed=0)
    envs.change_settings(target_speed=2.0)
    envs.reset(seed=[None, 5, None, None], options={"reset_mask": np.array([False, True, False, False])})
    batch = envs.batch
    assert batch.row_plans.are_mixed
    newest, before = batch.row_plans.plans[-1], batch.rows.rewards.copy()

    def interrupted(rows):
        batch.rows.rewards += 1.0
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch.under_each(np.arange(4), interrupted)
    assert batch.plan is newest
    assert (batch.rows.rewards[[1]] == before[[1]]).all()
