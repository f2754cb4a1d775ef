"""Every door plays a policy in one way: with its memory, its statistics and the mode of its distribution."""

import ast
import re
import sys
from pathlib import Path
from types import ModuleType

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from agents import dataset, gait_figures, horse_figures, leg_forces
from agents.blindness import prove
from hoof_env import records
from hoof_env.envs.policies import make_policy
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.evaluation.episodes import make_rows, play, play_rows, score_vector
from hoof_env.evaluation.scores import evaluate
from hoof_env.film import render_episode
from hoof_env.policies.actor import Actor

ID = "hoof_env/HorseLeg-v0"
SHORT = {"episode_seconds": 0.2}
STEPS = 10


class Counting:
    """Policy with a memory, the number of its actions in an episode, which acts at random unless its mode is
    asked for."""

    def __init__(self, width=4):
        self.calls = []
        self.width = width

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        rows = np.shape(observation)[:-1]
        count = np.zeros(rows or (1,), int) if state is None else state
        count = np.where(episode_start, 0, count)
        self.calls.append((count.copy(), np.array(episode_start), deterministic))
        actions = np.tile(0.05 * (count.reshape(rows)[..., None] % 7), self.width).astype(np.float32)
        if not deterministic:
            actions = np.full_like(actions, np.nan)
        return actions, count + 1


def counts(policy):
    """What a policy remembered at each action."""
    assert all(deterministic for *_, deterministic in policy.calls)
    return [count.tolist() for count, *_ in policy.calls]


@pytest.fixture
def env():
    with gym.make(ID, **SHORT) as env:
        yield env


@pytest.fixture
def named(monkeypatch):
    """A policy and the name by which commands find it."""
    policy = Counting()
    module = ModuleType("policy_with_memory")
    module.mine = policy
    monkeypatch.setitem(sys.modules, "policy_with_memory", module)
    return policy, "policy_with_memory:mine"


EPISODE = [[step] for step in range(STEPS)]


def test_episodes_one_by_one(env):
    policy = Counting()
    play(env, policy, [0, 1])
    assert counts(policy) == 2 * EPISODE
    assert [bool(start) for _, start, _ in policy.calls] == 2 * [True, *[False] * (STEPS - 1)]


def test_rows_of_a_batch():
    policy = Counting()
    play_rows(make_rows(ID, 3, **SHORT), policy, [0, 1, 2])
    assert counts(policy) == [[step] * 3 for step in range(STEPS)]


def test_batches(env):
    batch, alone = Counting(), Counting()
    assert score_vector(batch, ID, [4, 5], **SHORT) == play(env, alone, [4, 5])


@pytest.mark.parametrize("published", [False, True])
def test_the_command_that_evaluates(named, published, monkeypatch):
    policy, name = named
    monkeypatch.setattr("hoof_env.evaluation.scores.FINAL_SEEDS", range(2))
    evaluate([name], ID, SHORT, episodes=None if published else 2, published=published)
    assert counts(policy) == ([[step] * 2 for step in range(STEPS)] if published else 2 * EPISODE)


def test_records(env, named, tmp_path):
    policy = Counting()
    records.record_episode(env, policy)
    assert counts(policy) == EPISODE
    policy, name = named
    records.export_episode(tmp_path / "run.csv", name, ID, ["episode_seconds=0.2"])
    assert counts(policy) == EPISODE


def test_films(named, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    policy, name = named
    render_episode(tmp_path / "run.gif", name, ID, ["episode_seconds=0.2"], fps=10, size=(480, 270))
    assert counts(policy) == EPISODE


def test_the_live_page():
    pytest.importorskip("bokeh")
    from hoof_env.view.simulation import Simulation

    policy = Counting()
    simulation = Simulation(ID, SHORT, policy)
    for _ in range(2):
        simulation.reset()
        while simulation.step() is not None:
            pass
    assert counts(policy) == 2 * EPISODE


def test_figures_of_one_leg(env):
    policy = Counting()
    leg_forces.episode_of(env, policy, 0)
    assert counts(policy) == EPISODE


def test_figures_of_a_horse(monkeypatch):
    envs = make_rows("hoof_env/Horse-v0", 2, **SHORT)
    policy = Counting(16)
    horse_figures.play(envs, policy, [0, 1], {})
    assert counts(policy) == [[step] * 2 for step in range(STEPS)]
    monkeypatch.setattr(gait_figures, "SECONDS", 0.1)
    monkeypatch.setattr(gait_figures, "SETTLED", 0.04)
    policy = Counting(16)
    gait_figures.watch(envs, policy, 2.0)
    assert counts(policy) == [[step] * 2 for step in range(STEPS // 2)]


def test_proofs_of_blindness():
    policy = Counting()
    proof = prove(policy, ID, [0, 1], SHORT)
    # Played in the real world, and then in the other one
    assert counts(policy) == 2 * [[step] * 2 for step in range(STEPS)]
    assert proof.difference == proof.actions == 0


def test_data_sets(monkeypatch, tmp_path):
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    args = dataset.Args(("mine",), env_kwargs=("episode_seconds=0.2",))
    policy = Counting()
    monkeypatch.setattr(dataset, "find_policy", lambda *_: policy)
    with gym.make(ID, **SHORT) as env:
        dataset._collect(minari, env, args, 2, "legs/test-v0")
    assert counts(policy) == 2 * EPISODE


def act(observations):
    return np.full((len(observations), 4), 0.25)


@pytest.mark.parametrize(
    "policy", [act, "run", hoof_env.GaitParameters(6.28, 0.7, -0.2, -0.3), (6.28, 0.7, -0.2, -0.3)]
)
def test_every_door_takes_what_load_policy_takes(policy, env):
    pytest.importorskip("bokeh")
    from hoof_env.view.simulation import Simulation

    record = records.record_episode(env, policy, 3)
    simulation = Simulation(ID, SHORT, policy, seed=3)
    simulation.reset()
    while (chunk := simulation.step()) is not None:
        last = chunk
    assert last.columns["time"][-1] == record["time"][-1]
    assert last.columns["force_y"][-1] == record["force_y"][-1]
    (one,) = play(env, policy, [3])
    (row,) = score_vector(policy, ID, [3], **SHORT)
    assert one == row


def test_a_model_plays_its_mode_under_its_own_normalisation():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    many = VecNormalize(DummyVecEnv([lambda: gym.make(ID, **SHORT)]))
    model = PPO("MlpPolicy", many, n_steps=64, device="cpu", seed=0)
    model.learn(64)
    with gym.make(ID, **SHORT) as env:
        observation, _ = env.reset(seed=0)
        wanted, _ = model.predict(many.normalize_obs(observation), deterministic=True)
        np.testing.assert_array_equal(Actor(model, env).act(observation), wanted)
        # The network itself is callable, and would return drawn actions, values and likelihoods.
        wanted, _ = model.policy.predict(observation, deterministic=True)
        np.testing.assert_array_equal(Actor(model.policy, env).act(observation), wanted)
    with gym.make("Pendulum-v1") as other, pytest.raises(DataFileError, match="PPO: trained for observ"):
        hoof_env.load_policy(model, other)


def test_a_policy_that_returns_actions_alone_is_reported(env):
    policy = type("Alone", (), {"predict": lambda *_, **__: np.zeros(4)})()
    with pytest.raises(ParameterError, match=r"Alone: expected .* actions and a state.* got array"):
        play(env, policy, [0])


ASKS = {
    "hoof_env/policies/actor.py": "plays",
    "hoof_env/policies/saved.py": "hands on what a model of Stable-Baselines3 returns",
    "hoof_env/policies/onnx_file.py": "tries a new file with drawn observations",
    "agents/export.py": "compares two policies over drawn observations",
    "agents/gait_rig.py": "plays many horses side by side by a policy without memory",
    "agents/levels.py": "hands on what a policy returns, some of it replaced by random actions",
    "agents/ship.py": "hands on what a policy returns, with noise",
    "benchmarks/jax_gaits.py": "plays the first steps of an episode by many gaits side by side",
}
"""Files that ask a policy for actions, and what for."""


def test_nothing_else_asks_a_policy_for_actions():
    root = Path(__file__).parents[2]
    asks = set()
    for room in ("hoof_env", "agents", "benchmarks", "examples"):
        for path in (root / room).rglob("*.py"):
            calls = [
                node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Call)
            ]
            if any(isinstance(call.func, ast.Attribute) and call.func.attr == "predict" for call in calls):
                asks.add(path.relative_to(root).as_posix())
    assert asks == set(ASKS)


@pytest.mark.parametrize(
    "predict", [lambda self, seen: (np.zeros(4), None), lambda self, seen, state=None: (np.zeros(4), None)]
)
def test_a_predict_of_other_arguments_is_reported(predict, env):
    policy = type("Bare", (), {"predict": predict})()
    with pytest.raises(ParameterError, match=r"Bare: expected predict\(.*episode_start.* got predict\(seen"):
        play(env, policy, [0])


def test_a_memory_of_any_kind_is_carried(env):
    """Tuples, as in recurrent policies, and dictionaries."""

    class Summing:
        def predict(self, seen, state=None, episode_start=None, deterministic=True):
            (count,) = state["counts"] if state else (np.zeros(1),)
            count = np.where(episode_start, 0.0, count) + 1
            return np.full(4, 0.02 * count.item(), np.float32), {"counts": (count,)}

    class Clock:
        def predict(self, seen, state=None, episode_start=None, deterministic=True):
            self.step = 1 if episode_start else self.step + 1
            return np.full(4, 0.02 * self.step, np.float32), None

    assert play(env, Summing(), [0, 1]) == play(env, Clock(), [0, 1])


@pytest.mark.parametrize("policy", [3, object(), Counting])
def test_objects_that_cannot_act_are_refused_everywhere(policy, env):
    for door in (play, lambda env, policy, _: records.record_episode(env, policy)):
        with pytest.raises(ParameterError, match=r"^policy"):
            door(env, policy, [0])
    with pytest.raises(ParameterError, match=r"^policy"):
        score_vector(policy, ID, [0], **SHORT)


HORSE = "hoof_env/Horse-v0"
GAIT = "kinematic-walk"
HORSE_DOORS = {
    "evaluate": lambda **kwargs: evaluate([GAIT], HORSE, {"episode_seconds": 0.1, **kwargs}, episodes=1),
    "record": lambda **kwargs: records.record_episode(gym.make(HORSE, **kwargs), GAIT, seconds=0.1),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("door", HORSE_DOORS)
def test_a_warning_says_that_a_command_is_lost_only_where_one_was_given(door):
    """A gait has its own commanded speed, and replaces none that its caller did not choose."""
    speed = make_policy(GAIT, gym.make(HORSE)).start["target_speed"]
    for kwargs in ({}, {"size": 0.5}, {"target_speed": speed}):
        HORSE_DOORS[door](**kwargs)
    for given in (2.0, (1.2, 1.9)):
        said = f"own commanded speed {speed:.2f} m/s, in place of target_speed={given}"
        with pytest.warns(UserWarning, match=re.escape(said)):
            HORSE_DOORS[door](target_speed=given)


@pytest.mark.filterwarnings("error")
def test_a_command_of_reset_options_is_not_lost():
    with gym.make(HORSE, target_speed=2.0) as env:
        played = records.record_episode(env, GAIT, seconds=0.1, options={"target_speed": 1.7})
    assert len(played)


def test_published_episodes_are_not_played_with_another_command():
    with pytest.raises(ParameterError, match="kinematic-walk: expected one for the task's commands"):
        evaluate([GAIT], HORSE, published=True)
