"""Wrapper of which a step returns the cost apart, as suites of constrained reinforcement learning do."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs

from hoof_env.errors import ParameterError


class SeparateCost(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Wrapper of which a step returns six values: observation, reward, cost, terminated, truncated, info.

    That is the order of Safety-Gymnasium. The cost is `info["cost"]` of an environment with limits; with
    several limits it is their sum.

    >>> import gymnasium as gym, hoof_env
    >>> env = hoof_env.SeparateCost(gym.make("hoof_env/HorseLeg-v0", cost={"peak": 1500.0}))
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, cost, terminated, truncated, info = env.step(env.action_space.sample())
    >>> float(cost)
    0.0

    Args:
        env: environment of this package, wrapped or not, made with `cost` or with costs of its task.

    Raises:
        ParameterError: the environment has no costs.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        if not getattr(env.unwrapped, "costs", ()):
            raise ParameterError(
                "env: expected an environment with limits, as gymnasium.make('hoof_env/HorseLeg-v0',"
                f" cost={{'peak': 1500.0}}), got {type(env.unwrapped).__name__} without cost"
            )
        RecordConstructorArgs.__init__(self)
        gym.Wrapper.__init__(self, env)

    def step(self, action: Any) -> Any:
        """Take a control step; return six values."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, float(info["cost"]), terminated, truncated, info
