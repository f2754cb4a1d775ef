"""The horse's leg as something to search: starts, objectives and the judge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.confirm import confirm
from research.identify.leg import SCALES, Choice, Vector, random_choice, random_start, to_preset
from research.identify.objective import Objective, with_toe
from research.identify.schedule import Phase
from research.identify.targets import Targets

EXPONENT = 1.375
"""n of Eq. 14 unless told otherwise: with it a leg meets every published number, see docs/decisions.md."""

TOE_DOWN, TOE_SPEED = 0.35, -3.0
"""When [s] and how fast [log m/s] the search puts down a walking toe that stays in the air."""

TOE_TIMES, TOE_SPEEDS = (0.27, 0.42), (-4.5, -2.0)
"""Where they lie in cold starts: between the walk's published first contact and its mid-stance."""

TOE_SCALES = with_toe(SCALES, 0.1, 0.3)
"""The scales of a search by touch-down."""

SAMPLES = 401
"""Instants a revolution with which candidates of all phases are compared."""

PENALTY = 2.0
"""What a shortage of one counts for [bars]."""


@dataclass(frozen=True)
class LegProblem:
    """What is searched. All phases search by touch-down, in coordinates y; see `Objective`.

    Attributes:
        targets: what is aimed at.
        walk: "walks" or "brakes".
        start: choice and x of the start preset, or None if all starts are cold.
        beta: of the paper's solver, a key of `objective.BETAS`. exponent: of the legs of cold starts.
    """

    targets: Targets
    walk: str
    start: tuple[Choice, tuple[float, ...]] | None
    beta: str = "probable"
    exponent: float = EXPONENT

    def objective(self, choice: Choice, samples: int, both: bool, by_toe: bool = False) -> Objective:
        """The objective of a choice with the exact solver alone or both, kept for the next call."""
        return _objective(self, choice, samples, both, by_toe)

    def begin(self, rng: np.random.Generator, phase: Phase) -> tuple[Choice, Vector]:
        """A start near the start preset, or of a phase that starts cold anywhere."""
        if phase.start == "cold":
            choice = random_choice(rng, self.exponent)
            legs = [random_start(rng) for _ in range(phase.tries)]
            times, speeds = rng.uniform(*TOE_TIMES, phase.tries), rng.uniform(*TOE_SPEEDS, phase.tries)
            tries = [with_toe(*toe) for toe in zip(legs, times, speeds, strict=True)]
        elif self.start is None:
            raise HoofEnvError("a search without a start preset has cold starts only")
        else:
            choice, x = self.start
            y, spread = self.inward(choice, np.array(x), phase.samples), float(rng.choice(phase.spreads))
            if not spread:
                return choice, y
            scales = spread * TOE_SCALES
            tries = [y + scales * rng.standard_normal(y.size) for _ in range(phase.tries)]
        return choice, min(tries, key=self.objective(choice, phase.samples, phase.paper_solver, True).cost)

    def inward(self, choice: Choice, x: Vector, samples: int) -> Vector:
        """The same candidate in the coordinates of a search."""
        try:
            return self.objective(choice, samples, False).to_touch_down(x)
        except HoofEnvError:  # the toe stays in the air
            return with_toe(x, TOE_DOWN, TOE_SPEED)

    def outward(self, choice: Choice, y: Vector, samples: int) -> Vector:
        """Inverse of `inward`."""
        x = self.objective(choice, samples, False).from_touch_down(y)
        return np.where(np.isfinite(x), x, 0.0)

    def merit(self, choice: Choice, x: Vector, both: bool) -> float:
        """What compares candidates of different phases [bars], with the exact solver alone or both."""
        return self.objective(choice, SAMPLES, both).rate(x).merit(PENALTY)

    def confirm(self, choice: Choice, x: Vector) -> bool:
        """Whether the full system finds every bar met and every claim true."""
        try:
            preset = to_preset(x, choice, "a candidate of a search")
            return confirm(preset, self.targets, self.walk, self.beta).holds
        except HoofEnvError:  # a dead point between two samples, a gait beyond its limits
            return False


@lru_cache(maxsize=16)
def _objective(problem: LegProblem, choice: Choice, samples: int, both: bool, by_toe: bool) -> Objective:
    return Objective(
        choice, problem.targets, samples=samples, paper_solver=both, walk=problem.walk, by_toe=by_toe,
        beta=problem.beta,
    )  # fmt: skip
