"""A trained policy of Stable-Baselines3 as one torch module, from observations to deterministic actions."""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from hoof_env.errors import ParameterError


class Statistics(NamedTuple):
    """Observations minus `mean` by `scale`, shape (k,), float64, then within `clip` of 0."""

    mean: Any
    scale: Any
    clip: float


def statistics_of(normalize: Any) -> Statistics | None:
    """What the `normalize` of a `TrainedPolicy` does; None for nothing."""
    from stable_baselines3.common.vec_env import VecNormalize

    found = getattr(normalize, "__self__", normalize)  # it may be a method of `VecNormalize`
    if found is None or (isinstance(found, VecNormalize) and not found.norm_obs):
        return None
    if isinstance(found, VecNormalize):
        seen: Any = found.obs_rms  # one, for the observation is one array
        mean, var, clip = seen.mean, seen.var, found.clip_obs
    else:
        mean, var, clip = found.mean, found.var, found.clip
    return Statistics(np.asarray(mean), np.sqrt(np.asarray(var) + found.epsilon), float(clip))


def module_of(trained: Any) -> Any:
    """The policy as a torch module from observations to deterministic actions, as `predict` computes them.

    Raises:
        ParameterError: a recurrent policy, or actions that are not vectors.
    """
    import torch

    policy = trained.model.policy
    space = trained.model.action_space
    if not isinstance(space, gym.spaces.Box) or len(space.shape) != 1 or hasattr(policy, "lstm_actor"):
        raise ParameterError(f"model: expected a memoryless policy with vectors for actions, got {space}")
    statistics = statistics_of(trained.normalize)

    class Deterministic(torch.nn.Module):
        low: Any
        high: Any
        mean: Any
        scale: Any

        def __init__(self) -> None:
            super().__init__()
            self.policy = policy
            self.register_buffer("low", torch.as_tensor(space.low))
            self.register_buffer("high", torch.as_tensor(space.high))
            if statistics is not None:  # in float64, as VecNormalize computes
                self.register_buffer("mean", torch.as_tensor(statistics.mean))
                self.register_buffer("scale", torch.as_tensor(statistics.scale))

        def forward(self, observation: Any) -> Any:
            if statistics is not None:
                far = (observation.double() - self.mean) / self.scale
                observation = far.clamp(-statistics.clip, statistics.clip).float()
            action = self.policy._predict(observation, deterministic=True)
            if policy.squash_output:  # in [-1, 1]: to the limits of the space
                return self.low + 0.5 * (action + 1.0) * (self.high - self.low)
            return torch.clamp(action, self.low, self.high)

    policy.set_training_mode(False)
    return Deterministic().eval()
