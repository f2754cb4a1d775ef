"""`hoof_env/HorseLegMO-v0`: the same leg with a reward of three numbers, in MO-Gymnasium's form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hoof_env.envs.arguments import Keywords
from hoof_env.envs.horse_leg import HorseLegEnv

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

    ## Description

    `hoof_env/HorseLeg-v0` with a vector for a reward, in the form of MO-Gymnasium. Make it with
    `mo_gymnasium.make`, or with `gymnasium.make(..., disable_env_checker=True)`: the checker wants a number.

    Many at once, rewards of shape (num_envs, 3), come from MO-Gymnasium:
    `mo_gymnasium.wrappers.vector.MOSyncVectorEnv([lambda: mo_gymnasium.make("hoof_env/HorseLegMO-v0")] * 4)`.
    `gymnasium.make_vec` refuses by default, for Gymnasium's own keep one number for a reward.

    ## Action space

    As in `hoof_env/HorseLeg-v0`.

    ## Observation space

    As in `hoof_env/HorseLeg-v0`.

    ## Rewards

    `reward_space` is `Box((3,), float32)`. The three add up to the reward of `hoof_env/HorseLeg-v0`, and
    `reward_weights` scales them in the same way.

    | Num | Objective | Terms | Unit by default |
    |---|---|---|---|
    | 0 | progress | `reward_progress` + `reward_support` | m |
    | 1 | peak force | `reward_peak` | 0.3 per kN |
    | 2 | energy | `reward_energy` + `reward_action` | 0.1 per kJ, 0.03 per squared change |

    Each also bears a third of `reward_failure`. The terms themselves stay in `info`.

    ## Starting state, episode end, arguments

    As in `hoof_env/HorseLeg-v0`.

    ## Version history

    * v0: first version.
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
