"""The example of a critic that knows more: its actor cannot see what is privileged, its critic does."""

import runpy
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

EXAMPLE = Path(__file__).parents[2] / "examples" / "asymmetric_critic.py"


def test_the_actor_depends_on_what_it_sees_and_the_critic_on_all(tmp_path):
    """By gradients, before and after an update, and after a file."""
    example = runpy.run_path(str(EXAMPLE))
    model = example["learner"](num_envs=8)
    names = model.get_env().get_attr("observation_names", [0])[0]
    hidden = np.array([name.startswith("true ") for name in names])
    assert hidden.any()
    assert not hidden[: (~hidden).sum()].any()
    for _ in range(2):
        policy = model.policy
        seen = torch.rand(5, len(names), device=policy.device, requires_grad=True)
        policy.get_distribution(seen).distribution.mean.sum().backward()
        by_actor = np.abs(seen.grad.cpu().numpy()).max(0)
        assert (by_actor[hidden] == 0.0).all()
        assert (by_actor[~hidden] > 0.0).all()
        again = seen.detach().requires_grad_()
        policy.predict_values(again).sum().backward()
        assert (np.abs(again.grad.cpu().numpy()).max(0) > 0.0).all()
        model.learn(8 * 64)
    model.save(tmp_path / "policy.zip")
    again = type(model).load(tmp_path / "policy.zip", custom_objects={"policy_class": type(model.policy)})
    observation = np.random.default_rng(0).uniform(-1, 1, (3, len(names))).astype(np.float32)
    assert np.array_equal(
        model.predict(observation, deterministic=True)[0], again.predict(observation, deterministic=True)[0]
    )
