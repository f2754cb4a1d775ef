"""`hoof_env/HorseLegMO-v0`: the same leg with a reward of three numbers, in MO-Gymnasium's form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.envs.tasks import Keywords

OBJECTIVES = ("progress", "peak force", "energy")
"""What the entries of the vector reward stand for; more is better in each."""


def vector_reward(terms: Mapping[str, Any]) -> NDArray[np.float32]:
    """The reward of each objective, shape (3,), from the terms that `info` holds.

    Energy takes the charge for changing the action, which is effort too, and progress what is paid for
    bearing weight, nothing by default. A failure is charged to all three in equal parts: under
    preference weights that sum to 1 a fall costs the same, whatever the weights, so that falling early to
    save force or energy pays under none.
    """
    progress, peak = terms["reward_progress"] + terms["reward_support"], terms["reward_peak"]
    energy = terms["reward_energy"] + terms["reward_action"]
    return np.array([progress, peak, energy], np.float32) + np.float32(terms["reward_failure"] / 3)


def refuse_many(**kwargs: Any) -> NoReturn:
    """The id's vector entry point: without one Gymnasium would make many, and the first step would break.

    Raises:
        gymnasium.error.Error: always.
    """
    raise gym.error.Error(
        "hoof_env/HorseLegMO-v0: Gymnasium's vector environments keep one number for a reward, this one gives"
        " three: use mo_gymnasium.wrappers.vector.MOSyncVectorEnv([lambda: mo_gymnasium.make(id)] * n)"
    )


class HorseLegMOEnv(HorseLegEnv):
    """A horse's leg that must carry and move its trunk, judged by three objectives.

    `hoof_env/HorseLeg-v0` with a vector for a reward, shape (3,), in the form of MO-Gymnasium; its page in
    docs/environments says how it is made and what the three are.

    Attributes:
        reward_space, reward_dim: of the reward.
    """

    def __init__(
        self, *, task: str = "leg", render_mode: str | None = None, **settings: Unpack[Keywords]
    ) -> None:
        super().__init__(task=task, render_mode=render_mode, **settings)
        self.reward_space = spaces.Box(
            np.full(3, -np.inf, np.float32), np.array([np.inf, 0.0, 0.0], np.float32), (3,), np.float32
        )
        self.reward_dim = len(OBJECTIVES)

    def step(  # type: ignore[override]  # Gymnasium's type of a reward is a number
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], bool, bool, dict[str, Any]]:
        """As in `HorseLegEnv`, with the vector reward, shape (3,)."""
        observation, _, terminated, truncated, info = super().step(action)
        return observation, vector_reward(info), terminated, truncated, info
