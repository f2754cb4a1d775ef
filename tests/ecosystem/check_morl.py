"""MORL-Baselines: its indicators on the published front, and a run of an algorithm of its own against it."""

from __future__ import annotations

import mo_gymnasium
import numpy as np
import pytest
import torch
from morl_baselines.common.evaluation import policy_evaluation_mo
from morl_baselines.common.pareto import filter_pareto_dominated
from morl_baselines.common.performance_indicators import hypervolume
from morl_baselines.common.weights import equally_spaced_weights
from morl_baselines.multi_policy.capql.capql import CAPQL

from hoof_env.evaluation import fronts
from hoof_env.tasks.objectives import REFERENCE_POINT

STEPS = 4000  # eight episodes, few for any learner


@pytest.fixture
def published():
    about = fronts.read_front()
    return about, np.array([point["returns"] for point in about["front"]])


def test_indicators(published):
    """The published front: nothing dominated by `filter_pareto_dominated`, the volume of `hypervolume`."""
    about, points = published
    assert len(filter_pareto_dominated(points)) == len(points)
    found = hypervolume(np.array(REFERENCE_POINT), list(points))
    assert found == pytest.approx(about["hypervolume"]["all"], rel=1e-9)


def test_indicators_of_random_points():
    """`hypervolume` and `filter_pareto_dominated` of random points, beside this package's."""
    generator = np.random.default_rng(0)
    for _ in range(20):
        points = generator.uniform(-1, 10, (15, 3)).round(1)
        kept = points[fronts.non_dominated(points)]
        theirs = filter_pareto_dominated(points)
        assert {tuple(row) for row in kept} == {tuple(row) for row in theirs}
        volume = hypervolume(np.zeros(3), list(points))
        assert fronts.hypervolume(points, (0, 0, 0)) == pytest.approx(volume)


def test_capql(mo_id, published):
    """CAPQL, 4,000 steps: a hypervolume between nothing and the published front's."""
    about, _ = published
    torch.set_num_threads(1)
    train, test = mo_gymnasium.make(mo_id), mo_gymnasium.make(mo_id)
    agent = CAPQL(train, seed=0, log=False, device="cpu", learning_starts=500, net_arch=[64, 64])
    train.reset(seed=0)
    agent.train(STEPS, eval_env=test, ref_point=np.array(REFERENCE_POINT), eval_freq=10 * STEPS)
    weights = equally_spaced_weights(3, n=5)
    returns = [policy_evaluation_mo(agent, test, weight, rep=1)[2] for weight in weights]
    assert np.isfinite(returns).all()
    volume = hypervolume(np.array(REFERENCE_POINT), returns)
    assert 0 < volume < about["hypervolume"]["all"]
