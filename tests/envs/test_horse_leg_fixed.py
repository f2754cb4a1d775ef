"""The paper's set-up stands on the ground of its preset; the training environment keeps its own."""

import json

import gymnasium as gym
import numpy as np
import pytest

import hoof_env  # noqa: F401
from hoof_env.envs.trace_names import trace_of
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import preset_names, read_preset

FIXED, LEG = "hoof_env/HorseLegFixed-v0", "hoof_env/HorseLeg-v0"


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
    assert ground(FIXED) == load_ground()


def test_the_force_is_that_of_the_presets_ground(soft):
    """K sum(d^n) on elastic ground, from the trace alone."""
    env = gym.make(FIXED, preset=soft, gait="run", episode_seconds=0.5)
    env.reset(seed=0)
    env.unwrapped.record()
    done, highest = False, 0.0
    while not done:
        *_, done, _ = env.step(np.zeros(4, np.float32))
        trace = trace_of(env.unwrapped.record())
        highest = max(highest, trace["normal"].max())
        depths = np.maximum([trace["toe_penetration"], trace["heel_penetration"]], 0)
        np.testing.assert_allclose(trace["normal"], 3e4 * (depths**1.375).sum(axis=0), rtol=1e-12)
    assert highest > 0


def test_the_training_environment_keeps_its_own(soft):
    assert ground(LEG, preset=soft) == ground(LEG)


def test_bad_values_are_refused(soft, tmp_path):
    with pytest.raises(ParameterError, match=r"stiffness: expected .*got -1"):
        gym.make(FIXED, preset=soft, stiffness=-1)
    path = tmp_path / "bad.json"
    path.write_text(json.dumps({**read_preset(soft), "ground": {"n": 1.4}}), encoding="utf-8")
    with pytest.raises(DataFileError, match=r"bad\.json.*'n'"):
        gym.make(FIXED, preset=str(path))
