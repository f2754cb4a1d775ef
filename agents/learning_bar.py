"""Returns of one episode in each row of a `VecEnv` that a training keeps for its scores."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.baselines_plan import CURVE_SEEDS

EPISODES, FIRST_SEED = len(CURVE_SEEDS), CURVE_SEEDS[0]
"""Scored episodes; training starts its own from other seeds."""


def returns(envs: Any, predict: Any, first_seed: int = FIRST_SEED) -> NDArray[np.float64]:
    """Returns of one episode in each of `envs`, from seed `first_seed` on; `predict` maps observations to
    actions."""
    envs.seed(first_seed)
    observation, total, going = envs.reset(), np.zeros(envs.num_envs), np.ones(envs.num_envs, bool)
    while going.any():
        observation, reward, done, _ = envs.step(predict(observation))
        total += reward * going
        going &= ~done
    return total
