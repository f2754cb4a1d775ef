"""Noise and bias of observations: the largest errors of each group, and the key of an episode's errors. The
kernel draws the errors themselves (`observation_kernel.add_noise`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.episodes.rows import Rows
from hoof_env.tasks.disturbances import check_noise
from hoof_env.tasks.settings import ResolvedSettings


@dataclass(frozen=True)
class Noise:
    """Errors of what is observed.

    Attributes:
        noise: largest errors that change with every control step, by group of the observation.
        bias: largest errors that stay for an episode, by group.
    """

    noise: Mapping[str, float]
    bias: Mapping[str, float]

    @classmethod
    def of(cls, s: ResolvedSettings, groups: Sequence[str]) -> Noise:
        """Return the errors of settings, of groups that are observed.

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
