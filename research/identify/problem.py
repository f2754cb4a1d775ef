"""The horse's leg as something to search: starts, objectives and the judge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.confirm import confirm
from research.identify.leg import SCALES, Choice, Vector, to_preset
from research.identify.objective import Objective, with_toe

TOE_DOWN, TOE_SPEED = 0.35, -3.0
"""When [s] and how fast [log m/s] the search puts down a walking toe that stays in the air."""

TOE_SCALES = with_toe(SCALES, 0.1, 0.3)
"""The scales of a search by touch-down."""

SPREADS, TRIES = (0.0, 0.15, 0.3, 0.5), 300
"""How far a start may lie from the preset, in scales, and of how many random legs it is the best."""

SAMPLES = 401
"""Instants a revolution with which candidates of all phases are compared."""

PENALTY = 2.0
"""What a shortage of one counts for [bars]."""


@dataclass(frozen=True)
class LegProblem:
    """What is searched: legs of one choice that meet the paper's rows. A search goes by touch-down, in
    coordinates y; see `Objective`."""

    choice: Choice

    def objective(self, samples: int, both: bool, by_toe: bool = False) -> Objective:
        """The objective with the exact solver alone or both, kept for the next call."""
        return _objective(self, samples, both, by_toe)

    def around(self, x: Vector, samples: int, rng: np.random.Generator) -> Vector:
        """A start y near x: the best of many."""
        y, spread = self.inward(x, samples), float(rng.choice(SPREADS))
        if not spread:
            return y
        tries = [y + spread * TOE_SCALES * rng.standard_normal(y.size) for _ in range(TRIES)]
        return min(tries, key=self.objective(samples, False, True).cost)

    def inward(self, x: Vector, samples: int) -> Vector:
        """The same candidate in the coordinates of a search."""
        try:
            return self.objective(samples, False).to_touch_down(x)
        except HoofEnvError:  # the toe stays in the air
            return with_toe(x, TOE_DOWN, TOE_SPEED)

    def outward(self, y: Vector, samples: int) -> Vector:
        """Inverse of `inward`."""
        x = self.objective(samples, False, True).from_touch_down(y)
        return np.where(np.isfinite(x), x, 0.0)

    def merit(self, x: Vector, both: bool) -> float:
        """What compares candidates of different phases [bars], with the exact solver alone or both."""
        return self.objective(SAMPLES, both).rate(x).merit(PENALTY)

    def confirm(self, x: Vector) -> bool:
        """Whether the full system finds every bar met and every claim true."""
        try:
            return confirm(to_preset(x, self.choice, "a candidate of a search")).holds
        except HoofEnvError:  # a dead point between two samples, a gait beyond its limits
            return False


@lru_cache(maxsize=16)
def _objective(problem: LegProblem, samples: int, both: bool, by_toe: bool) -> Objective:
    return Objective(problem.choice, samples=samples, paper_solver=both, by_toe=by_toe)
