"""Strength of the disturbances of an episode: factor of noise, bias and pushes, which schedules may move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.episodes.rows import Rows
from hoof_env.errors import check_number
from hoof_env.tasks.disturbances import MAX_STRENGTH
from hoof_env.tasks.schedules import STRENGTH, Ramp
from hoof_env.tasks.settings import ResolvedSettings


@dataclass(frozen=True)
class Strength:
    """Factor of all disturbances.

    Attributes:
        factor: the factor [-].
        ramp: its ramp over a schedule; None without one.
    """

    factor: float
    ramp: Ramp | None

    @classmethod
    def of(cls, s: ResolvedSettings, schedule: Mapping[str, Ramp]) -> Strength:
        """Return the strength from settings.

        Raises:
            ParameterError: it is out of range.
        """
        factor = check_number("strength", s.strength, low=0.0, high=MAX_STRENGTH)
        return cls(factor, schedule.get(STRENGTH))

    def begin(
        self,
        rows: Rows,
        which: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        """Set the strength of episodes that start in some rows."""
        factor = self.ramp.range_at(rows.steps_before[which])[0] if self.ramp else self.factor
        rows.named.strength[which] = options.get("strength", factor)
