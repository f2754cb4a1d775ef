"""What one may ask of each environment of a vector, as of Gymnasium's own over single environments."""

from __future__ import annotations

import copy

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, IDS, MODES, actions, both, same, scaled

LEG = "hoof_env/HorseLeg-v0"
EVERYTHING = {
    "observation": ["crank", "gait", "trunk", "hoof", "target", "ground"],
    "target_speed": (0.5, 3.0),
    "terrain": {"kind": "hills"},
    "randomize": {"trunk_mass": (60.0, 90.0)},
    "episode_seconds": 0.3,
}


@pytest.mark.parametrize("env_id", IDS)
def test_each_says_of_itself_what_a_single_environment_says(env_id):
    ours, theirs = both(env_id, 4)
    ours.reset(seed=0), theirs.reset(seed=0)
    spaces = [f"observation_{what}" for what in ("names", "units", "space")]
    for name in ("dt", "sim_dt", *spaces, "action_space"):
        assert ours.get_attr(name) == theirs.get_attr(name), name
    assert [ours.weight[env] for env in range(4)] == list(theirs.get_attr("weight"))
    assert ours.episode_summary()["distance_m"].shape == (4,)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_the_record_of_a_row(mode):
    ours, theirs = both(LEG, 9, mode, episode_seconds=0.3, randomize={"friction": (0.2, 0.8)})
    ours.reset(seed=0), theirs.reset(seed=0)
    same(ours.record(5), theirs.call("record")[5])
    same(ours.record(2), theirs.call("record")[2])
    for k, taken in enumerate(actions(1, 40, 9)):
        done = np.any(ours.step(taken)[2:4], axis=0)
        theirs.step(taken)
        same(ours.record(5), theirs.call("record")[5])
        if mode.name == "DISABLED" and (done.any() or k in (7, 20)):
            mask = done if done.any() else np.arange(9) < 3
            for envs in (ours, theirs):
                envs.reset(options={"reset_mask": mask})
            same(ours.record(2), theirs.call("record")[2])
            same(ours.record(5), theirs.call("record")[5])  # of a row that went on
    twin = copy.deepcopy(ours)
    same(twin.record(5), ours.record(5))


def test_a_mark_on_each():
    ours, theirs = both(LEG, 4)
    for envs in (ours, theirs):
        envs.set_attr("mark", 5)
        assert envs.get_attr("mark") == (5,) * 4
        envs.set_attr("mark", [1, 2, 3, 4])
        assert envs.get_attr("mark") == envs.call("mark") == (1, 2, 3, 4)
        with pytest.raises(AttributeError, match="nothing"):
            envs.get_attr("nothing")


@pytest.mark.parametrize(
    ("env_id", "count", "settings"),
    [
        (LEG, 27, EVERYTHING),
        (LEG, 28, EVERYTHING | {"drive": "motor"}),
        (HORSE, 82, {"observation": ["trunk", "target", "crank", "gait", "rates", "hoof", "offset"]}),
    ],
)
def test_raw_observations_are_those_before_scaling(env_id, count, settings):
    envs = gym.make_vec(env_id, num_envs=9, **settings).unwrapped
    assert len(envs.observation_units) == len(envs.observation_names) == count
    seen, _ = envs.reset(seed=0)
    for taken in 0.2 * actions(2, 25, 9, env_id=env_id):
        raw = envs.raw_observation()
        assert tuple(raw) == envs.observation_names
        for k, entry in enumerate(envs.batch.plan.observed.entries):
            expected = scaled(entry.scale.text, raw[entry.name], envs)
            assert expected.shape == (9,)
            np.testing.assert_allclose(expected, seen[:, k], atol=2e-7)
            if entry.group in ("hoof", "offset") and entry.scale.text in ("none", "0 or 1"):
                same(expected.astype(np.float32), seen[:, k])
        seen = envs.step(taken)[0]
