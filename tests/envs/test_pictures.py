"""What a picture costs, when, and how large it is."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, actions, same

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.episodes.recording import KEPT_SECONDS

LEG = "hoof_env/HorseLeg-v0"


@pytest.fixture
def runs(monkeypatch):
    """How often substeps are run again."""
    counted, run = [], TrunkEngine.run

    def counting(self, *arguments, **named):
        counted.append(arguments)
        return run(self, *arguments, **named)

    monkeypatch.setattr(TrunkEngine, "run", counting)
    return counted


@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_a_step_runs_its_substeps_again_only_where_a_picture_is_asked_for(env_id, runs):
    """It did at every step, which took 74 to 250 times as long as the step. The picture is the same."""
    late, always = (gym.make(env_id, render_mode="rgb_array") for _ in range(2))
    for env in (late, always):
        env.reset(seed=1)
    taken = actions(0, 30, env_id=env_id) / 4
    for action in taken:
        late.step(action)
    assert not runs
    first = always.render()
    for action in taken:
        always.step(action)
        last = always.render()
    assert len(runs) == 31
    assert (first != last).any()
    same(late.render(), last)
    assert len(runs) == 62


def test_pictures_of_many_environments_wait_as_well(runs):
    envs = gym.make_vec(LEG, 3, render_mode="rgb_array", episode_seconds=0.2)
    envs.reset(seed=0)
    for action in actions(0, 27, 3):
        envs.step(action)
    assert not runs
    assert len(envs.render()) == 3


def test_what_waits_is_bounded_and_begins_with_the_episode(runs):
    env = gym.make(LEG, render_mode="rgb_array", episode_seconds=30.0)
    env.reset(seed=0)
    for _ in range(400):
        env.step(np.zeros(4, np.float32))
    env.render()
    assert len(runs) <= KEPT_SECONDS / 0.02 + 2
    env.reset(seed=0)
    runs.clear()
    same(env.render(), fresh().render())
    assert len(runs) == 2


def fresh():
    env = gym.make(LEG, render_mode="rgb_array", episode_seconds=30.0)
    env.reset(seed=0)
    return env


@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_has_pictures_and_records_of_its_own(again):
    env = fresh()
    for action in actions(0, 5):
        env.step(action)
    twin = again(env)
    same(twin.unwrapped.record(), env.unwrapped.record())
    for action in actions(1, 5):
        env.step(action), twin.step(action)
    env.step(actions(2))
    env.unwrapped.set_state(twin.unwrapped.get_state())
    same(twin.render()[:, :300], twin.render()[:, :300])
    kept = twin.unwrapped.record()
    twin.step(actions(3)), env.step(actions(3))
    same(twin.unwrapped.record(), env.unwrapped.record())
    assert (kept["time"] < twin.unwrapped.record()["time"]).all()


@pytest.mark.parametrize("env_id", [LEG, HORSE, "hoof_env/HorseLegMO-v0"])
def test_the_size_of_a_picture(env_id):
    made = {"render_mode": "rgb_array", "width": 640, "height": np.int64(360)}
    env = gym.make(env_id, **made)
    env.reset(seed=0)
    assert env.render().shape == (360, 640, 3)
    assert env.spec.kwargs["height"] == 360
    if env_id != "hoof_env/HorseLegMO-v0":
        envs = gym.make_vec(env_id, 2, rendered=1, **made)
        envs.reset(seed=0)
        assert [frame.shape for frame in envs.render()] == [(360, 640, 3)] * 2
