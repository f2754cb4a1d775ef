"""The reward: one small function per term, one set of weights, one sum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, check_number


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the reward terms; `docs/environment.md` gives their reasons and what the defaults lead to.

    Attributes:
        progress: per metre forward [1/m].
        peak: per kilonewton of every stance's peak ground reaction force [1/kN].
        energy: per kilojoule of positive work of the two drives [1/kJ]; braking power is not recovered.
        action: per control step and unit of mean squared action change [-].
        failure: per second of a whole episode, charged once when the episode ends by failure [1/s]: more than
            the worst policy found loses by going on.
    """

    progress: float = 1.0
    peak: float = 0.3
    energy: float = 0.1
    action: float = 0.03
    failure: float = 30.0

    def __post_init__(self) -> None:
        for item in fields(self):
            check_number(f"reward_weights[{item.name!r}]", getattr(self, item.name), low=0, high=1e6)

    @classmethod
    def of(cls, changes: Mapping[str, float] | None) -> RewardWeights:
        """The defaults with some weights changed."""
        if changes is None:
            return cls()
        names = [item.name for item in fields(cls)]
        if not isinstance(changes, Mapping) or not set(changes) <= set(names):
            raise ParameterError(
                f"reward_weights: expected a mapping with some of {', '.join(names)}, got {changes!r}"
            )
        return replace(cls(), **changes)


def progress(weights: RewardWeights, account: Any) -> float:
    """Forward progress in this step."""
    return weights.progress * float(account["progress"])


def peak(weights: RewardWeights, account: Any) -> float:
    """Penalty on the increase of the stance's running peak force in this step."""
    return -weights.peak * float(account["peak_increase"]) / 1000


def energy(weights: RewardWeights, account: Any) -> float:
    """Cost of the positive work of both drives in this step."""
    return -weights.energy * float(account["work"]) / 1000


def action_change(
    weights: RewardWeights, action: NDArray[np.float32], previous: NDArray[np.float32]
) -> float:
    """Cost of changing the action."""
    change = action - previous
    return -weights.action * float(change @ change) / change.size


def failure(weights: RewardWeights, failed: bool, episode_seconds: float) -> float:
    """Charge for ending the episode by failure."""
    return -weights.failure * episode_seconds if failed else 0.0
