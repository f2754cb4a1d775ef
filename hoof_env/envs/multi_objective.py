"""Native vector environment with a reward for each objective."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.arguments import VectorArguments, takes
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.tasks.objectives import reward_space, vector_reward
from hoof_env.tasks.reward import OBJECTIVES


class HorseLegMOVectorEnv(HorseLegVectorEnv):
    """`num_envs` environments of `HorseLegMO-v0`, stepped together; rewards are float32, shape (num_envs, 3).

    Row i is bitwise identical to the single environment with that seed. Restarts and infos are as in
    `HorseLegVectorEnv`, spaces and rewards of restarts as in MO-Gymnasium's `MOSyncVectorEnv`.

    >>> import gymnasium as gym, hoof_env
    >>> envs = gym.make_vec("hoof_env/HorseLegMO-v0", num_envs=2)
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> rewards.shape, envs.unwrapped.reward_space.shape
    ((2, 3), (3,))

    Attributes:
        reward_space: space of the reward vector of one environment, shape (3,), as in MO-Gymnasium.
        reward_dim: its length.
    """

    @takes(VectorArguments)
    def __init__(self, num_envs: int = 1, **arguments: Any) -> None:
        super().__init__(num_envs, **arguments)
        self.reward_space = reward_space()
        self.reward_dim = len(OBJECTIVES)

    def _rewards(self) -> NDArray[np.float32]:
        terms = self.batch.rows.named.terms[:, : self.num_envs]
        return vector_reward(dict(zip(self.batch.terms, terms, strict=True)), self.task.terms)
