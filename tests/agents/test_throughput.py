"""The bar of speed: an environment that does nothing is one, and the bars follow the numbers."""

import gymnasium as gym
import numpy as np
import pytest

from agents import throughput
from agents.baselines_plan import LEG
from agents.runs import make_vec_env
from agents.throughput import Args, make_idle, measure, table


def test_the_idle_environment_is_alike_but_for_doing_nothing():
    native = make_vec_env(LEG, 3)
    idle = make_idle(3, native.observation_space, native.action_space)
    for a, b in zip((native.reset(), *native.step(np.zeros((3, 4)))),
                    (idle.reset(), *idle.step(np.zeros((3, 4)))), strict=True):  # fmt: skip
        assert np.shape(a) == np.shape(b)
        assert getattr(a, "dtype", None) == getattr(b, "dtype", None)
    assert isinstance(idle.action_space, gym.spaces.Box)


@pytest.mark.parametrize(("rate", "share", "words"), [(1.0, 0.01, "met"), (1e9, 100.0, "not met")])
def test_bars_follow_the_numbers(rate, share, words, monkeypatch):
    monkeypatch.setattr(throughput, "RATE_BAR", rate)
    monkeypatch.setattr(throughput, "SHARE_BAR", share)
    found = measure(Args(rounds=1, rollouts=1))
    assert [said.partition(":")[0] for said in found["bars"].values()] == [words] * 2
    assert found["shares"][0] == pytest.approx(found["wall"]["native"][0] / found["wall"]["idle"][0])
    assert all(bar in table(found) for bar in found["bars"])
