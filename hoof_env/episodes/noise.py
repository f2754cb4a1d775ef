"""Noise and bias of observations: the largest errors of each group, and the key of an episode's errors. The
kernel draws the errors themselves (`observation_kernel.add_noise`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.episodes.rows import Rows
from hoof_env.errors import ParameterError, brief, check_number
from hoof_env.tasks.settings import ResolvedSettings

MAX_NOISE = 10.0
"""Largest error of a number that is observed, of which the scale has mapped the usual range to [-1, 1]."""


def check_noise(name: str, given: Any, groups: Sequence[str]) -> dict[str, float]:
    """Return the largest errors of groups of the observation, by group.

    Args:
        name: name of the setting, for messages.
        given: the setting; None for no errors.
        groups: groups that are observed.

    Raises:
        ParameterError: not a mapping, a group that is not observed, or an error out of range.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not set(given) <= set(groups):
        raise ParameterError(
            f"{name}: expected a mapping with some of the groups that are observed, {', '.join(groups)}; got"
            f" {brief(given)}"
        )
    return {
        group: check_number(f"{name}[{group!r}]", value, low=0, high=MAX_NOISE)
        for group, value in given.items()
    }


@dataclass(frozen=True)
class Noise:
    """Errors of observations.

    Attributes:
        noise: largest errors that change with every control step, by group of the observation.
        bias: largest errors that stay for an episode, by group.
    """

    noise: Mapping[str, float]
    bias: Mapping[str, float]

    @classmethod
    def of(cls, s: ResolvedSettings, groups: Sequence[str]) -> Noise:
        """Return the errors from settings, for groups that are observed.

        Raises:
            ParameterError: a setting is out of range, or of a group that is not observed.
        """
        return cls(check_noise("noise", s.noise, groups), check_noise("bias", s.bias, groups))

    def fill(self, record: Any, groups: Mapping[int, str]) -> None:
        """Fill in its part of the task's record.

        Args:
            record: record of the task.
            groups: group of the observed entry in each slot.
        """
        for slot, group in groups.items():
            record["noise"][slot] = self.noise.get(group, 0.0)
            record["bias"][slot] = self.bias.get(group, 0.0)
        record["is_noisy"] = bool(record["noise"].any() or record["bias"].any())

    def begin(
        self,
        rows: Rows,
        which: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Draw the keys of the errors of episodes that start in some rows."""
        is_drawn = bool(self.noise or self.bias)
        keys = [generator.random() for generator in generators] if is_drawn else 0.0
        rows.named.noise_key[which] = keys
