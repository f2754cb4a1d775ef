"""Wrappers that add the rewards of objectives up to one number, by fixed weights."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper
from numpy.typing import ArrayLike, NDArray

from hoof_env.errors import ParameterError
from hoof_env.tasks.objectives import check_weight


class LinearReward(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Wrapper whose reward is the weighted sum of the objectives; infos keep them as "vector_reward".

    >>> import gymnasium as gym, hoof_env
    >>> env = hoof_env.LinearReward(gym.make("hoof_env/HorseLegMO-v0"), weight=[0.6, 0.2, 0.2])
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> isinstance(reward, float), info["vector_reward"].shape
    (True, (3,))

    Args:
        env: environment with a vector for a reward.
        weight: weight of each objective, from 0; by convention they sum to 1.

    Attributes:
        weight: the weights, shape (3,).

    Raises:
        ParameterError: an environment with one number for a reward, or bad weights.
    """

    def __init__(self, env: gym.Env[Any, Any], weight: ArrayLike) -> None:
        _check_objectives(env)
        self.weight = check_weight(weight)
        RecordConstructorArgs.__init__(self, weight=self.weight.tolist())
        gym.Wrapper.__init__(self, env)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take a control step; the reward is a number."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        info["vector_reward"] = reward
        return observation, float(_weighted(reward, self.weight)), terminated, truncated, info


class VectorLinearReward(VectorWrapper, RecordConstructorArgs):
    """`LinearReward` of a vector environment: rewards of shape (num_envs,).

    >>> import gymnasium as gym, hoof_env
    >>> envs = gym.make_vec("hoof_env/HorseLegMO-v0", num_envs=2)
    >>> envs = hoof_env.VectorLinearReward(envs, weight=[0.6, 0.2, 0.2])
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> rewards.shape, infos["vector_reward"].shape
    ((2,), (2, 3))

    Args:
        env: vector environment with a vector for a reward of each environment.
        weight: as of `LinearReward`.

    Raises:
        ParameterError: as by `LinearReward`.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], weight: ArrayLike) -> None:
        _check_objectives(env)
        self.weight = check_weight(weight)
        RecordConstructorArgs.__init__(self, weight=self.weight.tolist())
        VectorWrapper.__init__(self, env)

    def step(self, actions: Any) -> tuple[Any, NDArray[np.float64], Any, Any, dict[str, Any]]:
        """Take a control step of all environments; rewards have shape (num_envs,)."""
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        infos["vector_reward"] = rewards
        return observations, _weighted(rewards, self.weight), terminated, truncated, infos


def _check_objectives(env: Any) -> None:
    """Raise `ParameterError` for an environment with one number for a reward."""
    if not hasattr(getattr(env, "unwrapped", None), "reward_space"):
        raise ParameterError(
            "env: expected an environment with a reward for each objective, such as"
            f" gymnasium.make('hoof_env/HorseLegMO-v0'), got {type(getattr(env, 'unwrapped', env)).__name__}"
        )


def _weighted(rewards: Any, weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return weighted sums over the last axis; a product of matrices would give a row other bits in a batch
    than alone."""
    sums: NDArray[np.float64] = (rewards * weight).sum(axis=-1)
    return sums
