"""What the checks share: what an environment does alone, a film of it, and the run of a learner."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest


def skip_unless_native(env_id):
    if gym.spec(env_id).vector_entry_point is None:
        pytest.skip("no native vector environment")


def alone(env, actions, seed):
    """Of each action: the observations before and after it, reward, terminated and truncated; an episode that
    has ended begins again."""
    observation, _ = env.reset(seed=seed)
    for action in actions:
        following, *others, _ = env.step(action)
        yield observation, following, *others
        observation = env.reset()[0] if others[1] or others[2] else following


def assert_filmed(folder):
    """The one film in a folder shows an episode of ten steps, not all of it alike; returns its frames."""
    imageio = pytest.importorskip("imageio.v3")
    (file,) = folder.glob("*.mp4")
    frames = imageio.imread(file)
    assert len(frames) in (10, 11)  # ten steps and the start; moviepy may round one away
    assert np.ptp(frames[..., 0].astype(float), axis=0).max() > 50
    return frames


def learns(model, envs, folder, parameters):
    """`learn` (256 steps) changes what `parameters` gives of a model, and leaves it finite; what `save`
    and `load` bring back acts alike and can be evaluated."""
    from stable_baselines3.common.evaluation import evaluate_policy

    before = [np.array(value) for value in parameters(model)]
    model.learn(256)
    after = [np.array(value) for value in parameters(model)]
    assert any((old != new).any() for old, new in zip(before, after, strict=True))
    assert all(np.isfinite(value).all() for value in after)
    assert len(model.ep_info_buffer) >= 10
    model.save(folder / "model")
    again = type(model).load(folder / "model", device="cpu")
    observation = envs.reset()
    np.testing.assert_array_equal(
        *(one.predict(observation, deterministic=True)[0] for one in (model, again))
    )
    mean, _ = evaluate_policy(again, envs, n_eval_episodes=2)
    assert np.isfinite(mean)


def torch_parameters(model):
    return [parameter.detach().numpy() for parameter in model.policy.parameters()]
