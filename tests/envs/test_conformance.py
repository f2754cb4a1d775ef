"""What every Gymnasium environment owes its users, over all ids and set-ups."""

from __future__ import annotations

import copy
import pickle
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as sb3_check_env

import hoof_env

SETUPS = [
    ("hoof_env/HorseLeg-v0", {}),
    ("hoof_env/HorseLeg-v0", {"trunk": "rail"}),
    ("hoof_env/HorseLeg-v0", {"trunk": "fixed"}),
    ("hoof_env/HorseLegFixed-v0", {"gait": "walk"}),
    ("hoof_env/HorseLegFixed-v0", {"gait": "run", "solver": "paper", "episode_seconds": 0.1}),
]


@pytest.fixture(params=SETUPS, ids=lambda s: f"{s[0]}-{s[1]}")
def setup(request):
    return request.param


def run(env, seed, steps=60, policy_seed=5):
    """Observations, rewards, flags and traces of random actions."""
    generator = np.random.default_rng(policy_seed)
    history = [env.reset(seed=seed)[0]]
    for _ in range(steps):
        obs, reward, terminated, truncated, _ = env.step(generator.uniform(-1, 1, 4).astype(np.float32))
        history += [obs, reward, terminated, truncated, env.unwrapped.trace]
        if terminated or truncated:
            history.append(env.reset()[0])
    return history


def test_checkers_find_nothing(setup):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(setup[0], **setup[1]).unwrapped)
        sb3_check_env(gym.make(setup[0], **setup[1]))


def test_same_seed_same_trajectory_to_the_bit(setup):
    one, two = (run(gym.make(setup[0], **setup[1]), seed=0) for _ in range(2))
    for a, b in zip(one, two, strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_other_seed_other_start():
    starts = [gym.make("hoof_env/HorseLeg-v0").reset(seed=seed)[0] for seed in range(4)]
    assert len({start.tobytes() for start in starts}) == 4


def test_observations_stay_in_the_box_and_none_is_constant(setup):
    env = gym.make(setup[0], **setup[1])
    history = [
        item for item in run(env, 3, 1000) if isinstance(item, np.ndarray) and item.dtype == np.float32
    ]
    observations = np.array(history)
    assert np.isfinite(observations).all()
    assert np.abs(observations).max() <= 1.0
    constant = [
        name
        for name, column in zip(env.unwrapped.observation_names, observations.T, strict=True)
        if np.ptp(column) == 0
    ]
    if setup[1].get("solver") != "paper":  # its short episodes end before the first contact
        assert constant == []


def test_every_call_returns_fresh_data():
    env = gym.make("hoof_env/HorseLeg-v0")
    first, _ = env.reset(seed=1)
    kept = first.copy()
    second, *_ = env.step(np.ones(4, np.float32))
    trace, kept_trace = env.unwrapped.trace, env.unwrapped.trace.tobytes()
    env.step(-np.ones(4, np.float32))
    np.testing.assert_array_equal(first, kept)
    assert trace.tobytes() == kept_trace
    assert not np.shares_memory(first, second)


def test_time_limit_truncates_in_seconds():
    env = gym.make("hoof_env/HorseLeg-v0", episode_seconds=0.5, dt=0.05)
    env.reset(seed=0)
    flags = [env.step(np.zeros(4, np.float32))[2:4] for _ in range(10)]
    assert flags == [(False, False)] * 9 + [(False, True)]


def test_ids_work_in_a_fresh_process_by_module_prefix():
    assert gym.make("hoof_env:hoof_env/HorseLeg-v0").spec.id == "hoof_env/HorseLeg-v0"
    assert set(hoof_env._ENTRY_POINTS) <= set(gym.registry)


def test_spec_is_json_serialisable():
    env = gym.make("hoof_env/HorseLeg-v0", trunk="rail", reward_weights={"peak": 0.5})
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.weights.peak == 0.5
    assert again.unwrapped.engine.trunk.kind == "rail"


def test_deep_copy_goes_on_identically():
    env = gym.make("hoof_env/HorseLeg-v0").unwrapped
    env.reset(seed=2)
    for _ in range(30):
        env.step(np.full(4, 0.3, np.float32))
    twin = copy.deepcopy(env)
    for _ in range(30):
        one, two = env.step(np.full(4, -0.3, np.float32)), twin.step(np.full(4, -0.3, np.float32))
        np.testing.assert_array_equal(one[0], two[0])
        assert one[1] == two[1]


def test_copies_of_a_drawing_environment_draw_for_themselves():
    pytest.importorskip("pygame")
    env = gym.make("hoof_env/HorseLeg-v0", render_mode="rgb_array").unwrapped
    env.reset(seed=2)
    env.render()
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        one, two = env.engine.state.copy(), twin.engine.state
        assert one.body == two.body
        twin.step(np.zeros(4, np.float32))
        assert twin.render().shape == env.render().shape
        assert env.engine.state.body == one.body
