"""Positions as actions, of the study of action forms: where they lead, and how fast."""

import gymnasium as gym
import numpy as np
import pytest

from agents import action_forms
from agents.stock_plan import LEG
from hoof_env.gait import LIMITS

LOW, HIGH = np.transpose(list(LIMITS.values()))


@pytest.mark.parametrize("form", action_forms.FORMS)
def test_a_position_is_gone_to_as_fast_as_the_filters_allow(form):
    """Like `action_for` with the fastest rates, which is another code."""
    env_id, parts = action_forms.FORMS[form]
    positions = gym.make(env_id).unwrapped
    rates = gym.make(LEG, **action_forms.FASTEST).unwrapped
    assert positions.engine.substep == action_forms.SUBSTEP
    assert positions.dt == action_forms.USUAL.dt
    begin, end = np.transpose(parts)
    for seed in range(3):
        action = np.random.default_rng(seed).uniform(-1.0, 1.0, 4).astype(np.float32)
        wanted = LOW + (begin + 0.5 * (action + 1.0) * (end - begin)) * (HIGH - LOW)
        for env in (positions, rates):
            env.reset(seed=seed)
        for _ in range(60):
            positions.step(action)
            rates.step(rates.action_for(wanted))
            for name in LIMITS:
                assert positions.engine.state[name] == pytest.approx(rates.engine.state[name], abs=1e-4)
        gait = [positions.engine.state[name][0, 0] for name in LIMITS]
        np.testing.assert_allclose(gait, wanted, atol=1e-3)


def test_the_narrow_box_is_the_one_that_the_shipped_agent_uses():
    np.testing.assert_allclose(action_forms.ranges(), action_forms.NARROW, atol=1e-3)
