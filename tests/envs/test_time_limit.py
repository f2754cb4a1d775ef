"""How long an episode lasts: one owner, told in the spec, and what a step after the end does."""

from __future__ import annotations

import copy
import pickle
import warnings

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, IDS, same
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import TimeAwareObservation

LEG, MO = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegMO-v0"
STILL = np.zeros(4, np.float32)


def ends(env, steps):
    """After which steps an episode of so many is truncated, and the last info."""
    env.reset(seed=0)
    found = []
    for k in range(1, steps + 1):
        *_, terminated, truncated, info = env.step(STILL)
        assert not terminated
        found += [k] if truncated else []
    return found, info


@pytest.mark.parametrize("env_id", [*IDS, MO])
def test_the_spec_has_the_limit_of_the_environment(env_id):
    env = gym.make(f"hoof_env:{env_id}")
    limit = env.unwrapped.steps_per_episode
    assert env.spec.max_episode_steps == env.unwrapped.spec.max_episode_steps == limit
    assert gym.spec(env_id).max_episode_steps is None  # of no wrapper: the environment alone ends episodes
    if env_id != MO:
        assert gym.make_vec(env_id, num_envs=2).unwrapped.spec.max_episode_steps == limit


@pytest.mark.parametrize(
    ("kwargs", "limit"),
    [
        ({}, 500),
        ({"episode_seconds": 2.0}, 100),
        ({"episode_seconds": 20.0}, 1000),
        ({"episode_seconds": 0.5, "dt": 0.05}, 10),
        ({"max_episode_steps": 100}, 100),
        ({"episode_seconds": 20.0, "max_episode_steps": 30}, 30),
    ],
    ids=str,
)
def test_truncated_once_at_the_step_that_the_spec_says(kwargs, limit):
    env = gym.make(LEG, **kwargs)
    assert env.spec.max_episode_steps == limit
    found, info = ends(env, limit)
    assert found == [limit]
    own = "max_episode_steps" not in kwargs
    assert ("episode_summary" in info) == own
    assert env.unwrapped.episode_summary()["seconds"] == pytest.approx(limit * env.unwrapped.dt, abs=1e-12)


def test_time_is_observed():
    env = TimeAwareObservation(gym.make(LEG, episode_seconds=2.0), normalize_time=True)
    observation, _ = env.reset(seed=0)
    assert (observation[-1], len(observation)) == (0.0, len(env.unwrapped.observation_names) + 1)
    for _ in range(100):
        observation, *_, truncated, _ = env.step(STILL)
    assert (observation[-1], truncated) == (1.0, True)


def test_a_spec_makes_the_same_again():
    """Also as JSON; the wrapper that Gymnasium then adds truncates with the environment and takes nothing."""
    env = gym.make(LEG, episode_seconds=0.4)
    for spec in (env.spec, EnvSpec.from_json(env.spec.to_json())):
        again = gym.make(spec)
        assert again.spec == env.spec
        same(ends(again, 20), ends(env, 20))
        assert "episode_summary" in ends(again, 20)[1]
    env.unwrapped.spec = gym.spec(LEG)  # the registered one is not written to
    assert env.unwrapped.spec.max_episode_steps == 20
    assert gym.spec(LEG).max_episode_steps is None
    assert gym.make(LEG).spec.max_episode_steps == 500


@pytest.mark.parametrize(
    "kwargs", [{"episode_seconds": 0.4}, {"episode_seconds": 0.4, "max_episode_steps": 7}]
)
def test_vector_environments_of_a_spec_end_where_single_ones_do(kwargs):
    runs = []
    for mode in ("sync", "vector_entry_point"):
        env = gym.make_vec(gym.make(LEG, **kwargs).spec, num_envs=2, vectorization_mode=mode)
        env.reset(seed=0)
        runs.append([env.step(np.zeros((2, 4), np.float32))[:4] for _ in range(50)])
    limit = kwargs.get("max_episode_steps", 20)
    for one, two in zip(*runs, strict=True):
        same(one, two)
    assert [k + 1 for k, step in enumerate(runs[0]) if step[3].any()] == list(range(limit, 51, limit + 1))


@pytest.mark.parametrize("env_id", [LEG, MO])
@pytest.mark.parametrize("settings", [{"episode_seconds": 0.1}, FALLS], ids=["truncated", "terminated"])
def test_a_step_after_the_end_warns_once_and_returns_what_it_did(env_id, settings):
    env = gym.make(env_id, **settings).unwrapped
    for _ in range(2):
        env.reset(seed=0)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ended = False
            while not ended:
                *_, terminated, truncated, _ = env.step(STILL)
                ended = terminated or truncated
        state = env.get_state()
        with pytest.warns(UserWarning, match="even though this environment has already returned") as said:
            first = env.step(STILL)
        assert len(said) == 1
        assert (first[2], first[3]) == (terminated, truncated)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            env.step(STILL)
        if terminated:
            assert first[4]["reward_failure"] == -700.0
        env.set_state(state)  # of an episode that ended
        with pytest.warns(UserWarning, match="already returned"):
            same(env.step(STILL), first)


@pytest.mark.parametrize("seconds", [0.3, 0.7, 2.0, 10.0])
def test_seconds_are_reported_as_they_were_asked_for(seconds):
    found = []
    for env in (gym.make(LEG, episode_seconds=seconds), gym.make_vec(LEG, episode_seconds=seconds)):
        env.reset(seed=0)
        info = {}
        while "episode_summary" not in info:
            info = env.step(np.zeros(env.action_space.shape, np.float32))[4]
        found.append(np.ravel(info["episode_summary"]["seconds"]).item())
    assert found == [seconds, seconds]


def test_a_longer_limit_is_not_silently_shorter():
    """Gymnasium's wrapper does not tell the environment; the spec says what holds, with the remedy."""
    with pytest.warns(UserWarning, match=r"expected at most 500, .* give episode_seconds=20"):
        env = TimeAwareObservation(gym.make(LEG, max_episode_steps=1000), normalize_time=True)
    assert env.spec.max_episode_steps == 500
    env.reset(seed=0)
    for _ in range(500):
        observation, *_, truncated, _ = env.step(STILL)
    assert (observation[-1], truncated) == (1.0, True)
    with pytest.warns(UserWarning, match=r"expected at most 500, .* give episode_seconds=20"):
        many = gym.make_vec(LEG, num_envs=2, max_episode_steps=1000)
    assert many.spec.max_episode_steps == 500
    other = copy.deepcopy(env.spec)  # of another environment as soon as its times are other ones
    other.kwargs["episode_seconds"] = 30.0
    other.max_episode_steps = 1200
    assert gym.make(other).spec.max_episode_steps == 1200
    longer = gym.make(LEG, max_episode_steps=1000, episode_seconds=20.0)
    assert EnvSpec.from_json(longer.spec.to_json()).max_episode_steps == 1000
    assert pickle.loads(pickle.dumps(longer.spec)) == longer.spec
