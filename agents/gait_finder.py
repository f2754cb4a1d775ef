"""Searches for one kinematic gait at one speed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evolution import generations, make_strategy, require
from agents.gait_box import decode, encode, first_gaits
from agents.gait_costs import FALL, costs_of, peaked
from agents.gait_rig import Rig
from agents.horse_gaits import speed_of
from agents.judges import searched_bars

Floats = NDArray[np.float64]

POPULATION = 16
STARTS = 6
"""Candidates of a generation, and episodes of each."""


class Finder:
    """Searches for one gait at one speed.

    Args:
        kind: "walk" or "trot".
        froude: Froude number of the commanded speed.
        seed: seed of the searches and their episodes.
        criterion: one of `CRITERIA`.
        starts: episodes of each candidate.
        fall: cost of a gait that always falls.
        **settings: arguments of the environment.
    """

    def __init__(
        self,
        kind: str,
        froude: float,
        seed: int,
        criterion: str = "force",
        starts: int = STARTS,
        fall: float = FALL,
        **settings: Any,
    ) -> None:
        require("agents.kinematic_gaits", "cma")
        self.kind = kind
        self.speed = speed_of(froude)
        self.bars = peaked(searched_bars(kind, froude))
        self.seed = seed
        self.criterion = criterion
        self.count = 0
        self.starts = starts
        self.fall = fall
        self.rig = Rig(POPULATION * starts, **settings)

    def costs(self, gaits: Floats) -> list[float]:
        """Return the costs of gaits, at most `POPULATION`; every call has other starts."""
        self.count += 1
        seed = 100_000 * (self.seed + 1) + self.starts * self.count
        figures = self.rig.play(gaits, self.speed, seed, self.starts)
        found: list[float] = costs_of(figures, self.bars, self.criterion, self.fall).tolist()
        return found

    def begin(self, stride: float) -> Floats:
        """Return the best first gait of a stride [hip heights], shape (16,)."""
        gaits = first_gaits(self.kind, self.speed, stride)
        best: Floats = gaits[int(np.argmin(self.costs(gaits)))]
        return best

    def improve(self, first: Floats, spread: float, count: int, tick: Any) -> Floats:
        """Return the gait to which `count` generations lead from another, shape (16,)."""
        strategy = make_strategy(encode(first[None])[0], spread, POPULATION, self.seed + 1)
        search = generations(strategy, lambda points: self.costs(decode(np.array(points))), count)
        for _, costs in search:
            tick(min(costs))
        # The mean of the distribution, not its luckiest candidate
        gait: Floats = decode(strategy.result.xfavorite[None])[0].round(5)
        return gait

    def check(self, gait: Floats) -> dict[str, Any]:
        """Return a gait and its figures over starts of their own."""
        starts = POPULATION * self.starts
        figures = self.rig.play(gait[None], self.speed, 10**7, starts)
        cost = float(costs_of(figures, self.bars, self.criterion, self.fall)[0])
        shown = {name: round(float(values[0]), 4) for name, values in figures.items()}
        return {"gait": gait.tolist(), "cost": round(cost, 4), **shown}
