"""Horse whose actions add offsets to the gaits that `agents.gait_change` found, in place of the reference
gaits."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from agents.gait_map import MIXTURE, Map, gaits_of
from agents.horse_gaits import speed_of
from agents.kept import EVIDENCE
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.errors import ParameterError, brief
from hoof_env.tasks.horse import Horse
from hoof_env.tasks.leg_starts import Start
from hoof_env.tasks.settings import Settings

Floats = NDArray[np.float64]

FOUND = EVIDENCE / "gait_change" / "searches.json"
SEED = 0  # of the searches: the one that has all speeds


@cache
def searched(kind: str) -> tuple[Floats, Floats]:
    """Return the speeds [m/s] of the searched gaits of a kind, shape (m,), and these, (m, 16): those that
    spare the mixture, whether they count or not."""
    rows = [
        row
        for row in Map(FOUND).rows
        if row["kind"] == kind and row["seed"] == SEED and row["objective"] == MIXTURE
    ]
    rows.sort(key=lambda row: float(row["froude"]))
    return np.array([speed_of(row["froude"]) for row in rows]), gaits_of(rows)


class SearchedHorse(Horse):
    """Horse of size 1 around the searched gaits of a kind, each at the speeds next to its own.

    At another speed than that of its search the cranks of a gait turn as much faster or slower, so that its
    stride stays. An episode begins in the gait of its command and keeps it.

    Attributes:
        kind: kind of the gaits.
    """

    kind: ClassVar[str]

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        if self.size != 1.0:
            raise ParameterError(f"size: expected 1 for a horse around searched gaits, got {self.size:g}")
        if self.gait is not None:
            raise ParameterError(
                f"gait: expected None for a horse around searched gaits, got {brief(settings.gait)}"
            )

    def reference(self, targets: Floats, given: Any = None) -> Floats:
        """Return the numbers of the gaits from which actions make offsets at commanded speeds [m/s], shape
        (n, 16): `given`, else the searched ones."""
        if given is not None:
            return super().reference(targets, given)
        speeds, gaits = searched(self.kind)
        at = np.asarray(targets, float)
        k = np.abs(np.log(at[:, None] / speeds)).argmin(1)
        chosen: Floats = gaits[k].copy()
        chosen[:, 0] *= at / speeds[k]
        return chosen

    def complete_start(
        self, start: Start, targets: Floats, options: Mapping[str, Any], engine: TrunkEngine
    ) -> None:
        """Complete starts as `Horse` does for gaits without a stored motion of the trunk."""
        gaits = self.reference(targets, options.get("gait"))
        super().complete_start(start, targets, {**options, "gait": gaits}, engine)


class WalkingHorse(SearchedHorse):
    """Horse around searched walks."""

    kind = "walk"


class TrottingHorse(SearchedHorse):
    """Horse around searched trots."""

    kind = "trot"
