"""Levels of data for offline learning: what a normalised score is, and policies that reach one."""

import numpy as np
import pytest

from agents.levels import SCORES, Levels, Partly, Scale
from agents.runs import make_env
from hoof_env.envs.policies import Scripted
from hoof_env.errors import ParameterError
from hoof_env.evaluation.episodes import play

FIXED = "hoof_env/HorseLegFixed-v0"


def test_a_score_is_0_for_random_and_100_for_shipped():
    scale = Scale(random=-2.0, shipped=6.0)
    assert [scale.score(value) for value in (-2.0, 2.0, 6.0, 8.0)] == [0.0, 50.0, 100.0, 125.0]


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_a_share_of_the_actions_is_random(share):
    policy = Partly(Scripted(lambda observation, time: np.full(4, 0.5), 0.02), share)
    taken = np.array([policy.predict(np.zeros((50, 3)))[0] for _ in range(40)])
    assert taken.dtype == np.float32
    assert taken.shape == (40, 50, 4)
    replaced = (taken != 0.5).all(axis=-1)
    assert ((taken == 0.5).all(axis=-1) | replaced).all()  # whole actions
    assert replaced.mean() == pytest.approx(share, abs=0.05)
    if share:
        assert np.abs(taken[replaced].mean()) < 0.05
        assert 0.9 < np.abs(taken[replaced]).max() <= 1.0


def test_levels_reach_their_scores():
    with make_env(FIXED) as env:
        levels = Levels(env, FIXED, {})
        policies = levels.policies("mixed")
        assert [*policies] == [*SCORES]
        for name, policy in policies.items():
            returns = [episode["return"] for episode in play(env, policy, range(60))]
            assert levels.scale.score(float(np.mean(returns))) == pytest.approx(SCORES[name], abs=12)
        assert [*levels.policies("simple")] == ["simple"]


def test_an_environment_without_room_for_levels_is_refused():
    """Where neither earns anything."""
    weights = dict.fromkeys(("progress", "peak", "energy", "slip", "failure", "support", "loading"), 0.0)
    kwargs = {"reward_weights": weights}
    refused = pytest.raises(ParameterError, match="shipped agent returns more than random")
    with make_env(FIXED, **kwargs) as env, pytest.warns(UserWarning, match="trained with"), refused:
        Levels(env, FIXED, kwargs)
