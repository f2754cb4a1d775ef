"""The weights of the reward; `episode.judge_step` has its terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

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
        support: per second in which the leg bears the whole weight of trunk and leg, in parts [1/s].
    """

    progress: float = 1.0
    peak: float = 0.3
    energy: float = 0.1
    action: float = 0.03
    failure: float = 30.0
    support: float = 0.0

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
