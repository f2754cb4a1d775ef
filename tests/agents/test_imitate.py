"""A network begins a training as a gait, and a training that goes on is left as it is."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ActorCriticPolicy

from agents import imitate
from hoof_env.envs.open_loop import gait_file
from hoof_env.evaluation.episodes import make_rows

HOP = "hoof_env/HorseLegHop-v0"


@pytest.fixture
def policy():
    torch.manual_seed(0)
    box = spaces.Box(-1.0, 1.0, (3,), np.float32)
    return ActorCriticPolicy(box, spaces.Box(-1.0, 1.0, (2,), np.float32), lambda progress: 1e-3)


def test_a_policy_is_fitted_to_actions(policy):
    x = np.random.default_rng(0).uniform(-1, 1, (16384, 3)).astype(np.float32)
    y = np.stack([x[:, 0] * x[:, 1], np.tanh(x[:, 2])], 1)
    assert imitate.fit(policy, x, y, seed=0) < 0.05 * y.var()
    actions, _ = policy.predict(x[:8], deterministic=True)
    np.testing.assert_allclose(actions, y[:8], atol=0.2)


def test_what_is_imitated_is_the_gait_with_stray_states_between():
    envs = make_rows(HOP, 4)
    seen, done = imitate.played(gait_file(HOP, "phase"), envs, seed=0)
    assert seen.shape == (4 * 500, *envs.single_observation_space.shape)
    assert done.shape == (4 * 500, 4)
    assert np.abs(done).max() <= 1.0
    again, _ = imitate.played(gait_file(HOP, "phase"), envs, seed=0)
    np.testing.assert_array_equal(seen, again)


def test_a_training_that_goes_on_is_left_as_it_is(monkeypatch):
    fitted = []
    monkeypatch.setattr(imitate, "played", lambda *args: ((), ()))
    monkeypatch.setattr(imitate, "fit", lambda *args: fitted.append(args))
    for steps in (0, 2048):
        callback = imitate.Imitation(None, None, seed=0)
        callback.model = SimpleNamespace(num_timesteps=steps, policy=None)
        callback._on_training_start()
        assert len(fitted) == 1
