"""Objects in consoles and notebooks say what they are."""

import gymnasium as gym
import pytest

import hoof_env  # noqa: F401 - registers the ids
from hoof_env.envs.policies import make_policy


@pytest.fixture(scope="module")
def env():
    with gym.make("hoof_env/HorseLeg-v0") as env:
        env.reset(seed=0)
        yield env.unwrapped


def test_an_environment_lists_its_observation(env):
    assert repr(env) == "<HorseLegEnv id=hoof_env/HorseLeg-v0 environments=1>"
    table = env._repr_html_()
    assert table.count("<tr>") == 1 + len(env.observation_names) + len(env.action_names)
    assert '<td style="text-align: left">rate_of_crank_speed</td>' in table


def test_measurements_are_a_table(env):
    measured = env.step(env.action_space.sample())[4]["measured"]
    table = measured._repr_html_()
    assert table.count("<tr>") == 1 + len(measured.names)
    assert f"{measured['toe_x']:.6g}" in table


def test_engine_and_policy(env):
    assert repr(env.engine).startswith("<TrunkEngine suspended, 1 leg, ")
    assert repr(make_policy("walk", env)).startswith("<Scripted name=walk start={'gait': GaitParameters(")
