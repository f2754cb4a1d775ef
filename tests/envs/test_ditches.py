"""A leg that carries itself over ditches."""

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.envs.open_loop import load_open_loop
from hoof_env.evaluation.episodes import play_rows
from hoof_env.tasks.registry import TASKS

HOP = TASKS["hop"].id
START = {"crank_angle": 3.3, "height": 2.05, "speed": 2.0, "x": 120.0}


@pytest.mark.parametrize("seed", range(3))
def test_over_ditches_of_no_depth_a_leg_hops_as_on_level_ground(seed):
    actions = np.random.default_rng(seed).uniform(-1, 1, (100, 4))
    steps = []
    for terrain in (None, {"kind": "ditches", "depth": 0.0}):
        env = gym.make(HOP, terrain=terrain)
        env.reset(seed=0, options=START)
        steps.append([env.step(action)[:3] for action in actions])
    for (seen, reward, ended), (seen_there, reward_there, ended_there) in zip(*steps, strict=True):
        np.testing.assert_allclose(seen_there, seen, atol=1e-6)
        assert reward_there == pytest.approx(reward, abs=1e-6)
        assert ended_there == ended


def test_a_gait_that_lands_softly_on_level_ground_strikes_the_sides_of_ditches():
    """It does not fall: ditches cost forces."""
    level, there = (
        play_rows(
            gym.make_vec(HOP, num_envs=64, autoreset_mode="SameStep", terrain=terrain).unwrapped,
            load_open_loop(HOP, gym.make(HOP)),
            range(64),
        )
        for terrain in (None, {"kind": "ditches"})
    )

    def mean(episodes, name):
        return np.mean([episode[name] for episode in episodes])

    assert mean(there, "failed") < 0.05
    assert mean(there, "loading_rate_n_s") > 4 * mean(level, "loading_rate_n_s")
    assert mean(there, "return") < 0 < 150 < mean(level, "return")
