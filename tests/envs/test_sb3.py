"""The adapter for Stable-Baselines3 against its own `DummyVecEnv` over single environments."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, HORSES, IDS, actions, same
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("stable_baselines3")
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from hoof_env import Sb3VecEnv
from hoof_env.envs.sb3 import RowInfo
from hoof_env.errors import ParameterError


def both(env_id, n, **settings):
    return Sb3VecEnv(env_id, n, **settings), DummyVecEnv([lambda: gym.make(env_id, **settings)] * n)


SHORT = {"episode_seconds": 0.3}


DRAWN = {**SHORT, "randomize": {"friction": (0.2, 0.8)}}


@pytest.mark.parametrize(
    ("env_id", "settings"), [*((env_id, SHORT) for env_id in IDS), (IDS[0], FALLS), (IDS[0], DRAWN)]
)
def test_it_says_what_theirs_says(env_id, settings):
    ours, theirs = both(env_id, 8, **settings)
    assert (ours.observation_space, ours.action_space) == (theirs.observation_space, theirs.action_space)
    ours.seed(3), theirs.seed(3)
    same(ours.reset(), theirs.reset())
    same(ours.reset_infos, theirs.reset_infos)
    ends = []
    for k, taken in enumerate(actions(0, 200, 8, env_id=env_id)):
        one, two = ours.step(taken), theirs.step(taken)
        for a, b in zip(one[:3], two[:3], strict=True):
            same(a, b)
        same(np.array(list(ours.terms.values())).sum(0).astype(np.float32), one[1])
        ends += [one[3][env]["TimeLimit.truncated"] for env in np.flatnonzero(one[2])]
        for info, there, done in zip(one[3], two[3], one[2], strict=True):
            assert {*info} | {"TimeLimit.truncated"} == {*there}
            if done or k % 20 == 0:
                for name in there.keys() - (set() if done else {"TimeLimit.truncated"}):
                    same(info[name], there[name])
        same(ours.reset_infos, theirs.reset_infos)
        if k == 60:  # only seeds and options given since the last reset count
            ours.seed(9), theirs.seed(9)
            ours.set_options({"gait": "walk"}), theirs.set_options({"gait": "walk"})
        if k in (60, 80):
            same(ours.reset(), theirs.reset())
    assert len(ends) > (2 if settings is FALLS else 50)
    assert not any(ends) if settings is FALLS else all(ends) or env_id in HORSES


CHANGES = {
    "pop": lambda info, key: info.pop(key, None),
    "pop without a default": lambda info, key: info.pop(key),
    "delete": lambda info, key: info.__delitem__(key),
    "remove the last": lambda info, key: info.popitem(),
    "set a default": lambda info, key: info.setdefault(key, 7.0),
    "write": lambda info, key: info.__setitem__(key, 8.0),
    "merge": lambda info, key: info.__ior__({key: 9.0}) and None,
    "clear": lambda info, key: info.clear(),
}
"""Changes of a dictionary."""


@settings(max_examples=200)
@given(
    st.lists(st.tuples(st.sampled_from([*CHANGES]), st.sampled_from(["progress", "gait", "end", "level"]))),
    st.booleans(),
)
def test_infos_change_like_dictionaries(changes, has_ended):
    """Entries of the arrays and of the end of an episode, in any order of changes."""
    arrays = {"progress": np.arange(3.0), "gait": np.arange(3.0, 6.0), "_gait": np.ones(3, bool)}
    end = {"end": {"fall": True}} if has_ended else {}
    info, expected = RowInfo(arrays, 1, end), {"progress": 1.0, "gait": 4.0, **end}
    for name, key in changes:
        results = []
        for one in (info, expected):
            try:
                results.append(CHANGES[name](one, key))
            except KeyError as error:
                results.append(type(error))
        assert results[0] == results[1], name
        assert [*info.items()] == [*expected.items()]
        assert ("gait" in info, len(info)) == ("gait" in expected, len(expected))
    assert (arrays["progress"] == np.arange(3.0)).all()


def test_what_single_environments_are_asked_is_as_of_a_dummy_vec_env():
    """Options one each, an attribute of some, methods of Gymnasium."""
    ours, theirs = Sb3VecEnv(IDS[0], 3), DummyVecEnv([lambda: gym.make(IDS[0])] * 3)
    for envs in (ours, theirs):
        envs.seed(5)
        envs.set_options([{"gait": "run"}, {"gait": "walk"}, {"gait": "run"}])
    same(ours.reset(), theirs.reset())
    same(ours.reset_infos, theirs.reset_infos)
    same(ours.measured, np.array([info["measured"] for info in theirs.reset_infos]))
    same(ours.reset(), theirs.reset())
    for envs in (ours, theirs):
        envs.set_attr("level", 1, indices=[0, 2])
        assert envs.get_attr("level", [2]) == [1]
        with pytest.raises(AttributeError, match="level"):
            envs.get_attr("level")
        envs.set_attr("level", 2, indices=1)
        assert envs.get_attr("level") == [1, 2, 1]
        assert envs.env_method("get_wrapper_attr", "dt", indices=[0]) == [0.02]
        assert envs.env_method("has_wrapper_attr", "level") == [True] * 3
        assert envs.env_method("has_wrapper_attr", "nothing") == [False] * 3
    before = ours.envs.get_state()
    ours.set_options([{"gait": "run"}, {"gait": "trot"}, {}])
    with pytest.raises(ParameterError, match=r"gait.*got 'trot'"):
        ours.reset()
    same(ours.envs.get_state(), before)
    # arrays, whose comparison is an array
    ours.set_options([{"gait": np.array([1.0, 2.0])}] + [{"gait": np.array([3.0, 4.0])} for _ in range(2)])
    with pytest.raises(ParameterError, match=r"gait.*got array\(\[1"):
        ours.reset()


def test_methods_of_a_vec_env():
    env = Sb3VecEnv(IDS[0], 3)
    assert env.get_attr("render_mode") == [None] * 3
    assert env.get_attr("num_envs", indices=1) == [3]
    assert env.env_is_wrapped(VecMonitor) == [False] * 3
    env.set_attr("mark", 5)
    assert env.get_attr("mark") == [5] * 3
    env.reset()
    assert env.env_method("get_state")[0]["id"] == IDS[0]
    assert env.get_attr("weight") == env.envs.weight.tolist()
    assert [figures["seconds"] for figures in env.env_method("episode_summary", indices=[0, 2])] == [0.0] * 2
    with pytest.raises(ParameterError, match=r"env_method: expected all environments, .*one"):
        env.env_method("get_state", indices=[0, 2])
    with pytest.raises(ParameterError, match=r"trunk_mass: expected no assignment.*'parameters'"):
        env.set_attr("trunk_mass", 5.0)
    with pytest.raises(AttributeError, match="no attribute 'trunk'"):
        env.get_attr("trunk")
    env.step(actions(0, 3))
    assert env.measured["vx"].shape == (3,)
    env.close()
    env.close()


def test_pictures():
    pytest.importorskip("pygame")
    env = Sb3VecEnv(IDS[0], 2, render_mode="rgb_array")
    env.reset()
    assert [image.shape for image in env.get_images()] == [(540, 960, 3)] * 2
    assert env.render().ndim == 3


def test_monitor_evaluation_and_training():
    env = VecMonitor(Sb3VecEnv(IDS[0], 16, episode_seconds=0.5), info_keywords=("episode_summary",))
    model = PPO("MlpPolicy", VecNormalize(env), n_steps=32, batch_size=128, n_epochs=1, seed=0, device="cpu")
    model.learn(1024)
    assert len(model.ep_info_buffer) > 16
    assert {info["l"] for info in model.ep_info_buffer} == {25}
    returns, lengths = evaluate_policy(model, env, n_eval_episodes=20, return_episode_rewards=True)
    assert lengths == [25] * 20
    assert np.isfinite(returns).all()
