"""The horse's leg as a problem of `search`: starts, costs and the judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError
from research.identify.candidate import (
    LINK9,
    SWINGS,
    Choice,
    names,
    random_choice,
    random_start,
    standard_deviations,
    to_preset,
)
from research.identify.confirm import confirm
from research.identify.job import PENALTY
from research.identify.minimax import Rate
from research.identify.objective import BETAS, Objective
from research.identify.records import Standing
from research.identify.schedule import Phase
from research.identify.targets import Targets

Array = NDArray[np.float64]

EXPONENT = 1.375
"""n of Eq. 14 unless told otherwise: with it a leg meets every published number, see docs/decisions.md."""

PRODUCT = 0.5
"""Part of the cold starts with link 9 and swing as the full system has them; the rest have any."""

TOE_DOWN, TOE_SPEED = 0.35, -3.0
"""When [s] and how fast [log m/s] the search puts down a walking toe that stays in the air."""

TOE_SCALES = (0.1, 0.3)
"""How far these two range."""

TOE_TIMES, TOE_SPEEDS = (0.27, 0.42), (-4.5, -2.0)
"""Where they lie in cold starts: between the walk's published first contact and its mid-stance."""

SAMPLES = 401
"""Instants a revolution with which candidates of all phases are compared."""


@lru_cache(maxsize=16)
def _objective(
    choice: Choice, targets: Targets, walk: str, samples: int, paper_solver: bool, by_toe: bool, beta: str
) -> Objective:
    return Objective(
        choice,
        targets,
        samples=samples,
        paper_solver=paper_solver,
        walk=walk,
        by_toe=by_toe,
        beta=BETAS[beta],
    )


def _with_toe(choice: Choice, x: Array, time: float, speed: float) -> Array:
    """x with the two entries that `by_toe` replaces."""
    changed, entries = np.array(x), names(choice)
    changed[entries.index("hip_height")], changed[entries.index("walk.swing_offset")] = time, speed
    return changed


@dataclass(frozen=True)
class LegProblem:
    """See `records.Problem`.

    Attributes:
        targets: what is aimed at.
        walk: "walks" or "brakes".
        start: choice and x of the start preset, or None if all starts are cold.
        beta: of the paper's solver, a key of `BETAS`. exponent: of the legs of cold starts.
    """

    targets: Targets
    walk: str
    start: tuple[Choice, tuple[float, ...]] | None
    beta: str = "probable"
    exponent: float = EXPONENT

    def given(self, rng: np.random.Generator, phase: Phase) -> tuple[dict[str, Any], Array]:
        if self.start is None:
            raise HoofEnvError("a search without a start preset has cold starts only")
        choice, x = self.start[0].to_dict(), np.array(self.start[1])
        y, spread = self.inward(choice, x, phase), float(rng.choice(phase.spreads))
        if not spread:
            return choice, y
        scales = spread * self.scales(choice, phase)
        tries = [y + scales * rng.standard_normal(y.size) for _ in range(phase.tries)]
        return choice, min(tries, key=self.cost(choice, phase))

    def cold(self, rng: np.random.Generator, phase: Phase) -> tuple[dict[str, Any], Array]:
        link9, swings = (("F",), ("crank",)) if rng.random() < PRODUCT else (LINK9, SWINGS)
        legs = random_choice(rng, link9, swings, self.exponent)
        choice = legs.to_dict()
        tries = [random_start(legs, rng) for _ in range(phase.tries)]
        if phase.by_toe:
            times, speeds = rng.uniform(*TOE_TIMES, phase.tries), rng.uniform(*TOE_SPEEDS, phase.tries)
            tries = [_with_toe(legs, *toe) for toe in zip(tries, times, speeds, strict=True)]
        return choice, min(tries, key=self.cost(choice, phase))

    def scales(self, choice: dict[str, Any], phase: Phase) -> Array:
        legs = Choice.from_dict(choice)
        scales = standard_deviations(legs)
        return _with_toe(legs, scales, *TOE_SCALES) if phase.by_toe else scales

    def inward(self, choice: dict[str, Any], x: Array, phase: Phase) -> Array:
        if not phase.by_toe:
            return x
        legs = Choice.from_dict(choice)
        try:
            return self.objective(legs, phase.samples, False).to_touch_down(x)
        except HoofEnvError:  # the toe stays in the air
            return _with_toe(legs, x, TOE_DOWN, TOE_SPEED)

    def outward(self, choice: dict[str, Any], y: Array, phase: Phase) -> Array:
        if not phase.by_toe:
            return y
        x = self.objective(Choice.from_dict(choice), phase.samples, False).from_touch_down(y)
        return np.where(np.isfinite(x), x, 0.0)

    def cost(self, choice: dict[str, Any], phase: Phase) -> Callable[[Array], float]:
        legs = Choice.from_dict(choice)
        objective = self.objective(legs, phase.samples, phase.paper_solver, by_toe=phase.by_toe)
        return objective.cost

    def rate(self, choice: dict[str, Any], phase: Phase) -> Rate:
        legs = Choice.from_dict(choice)
        return self.objective(legs, phase.samples, phase.paper_solver, by_toe=phase.by_toe).rate

    def standing(self, choice: dict[str, Any], x: Array, paper_solver: bool) -> Standing:
        return standing(self.objective(Choice.from_dict(choice), SAMPLES, paper_solver), x)

    def rank(self, choice: dict[str, Any], x: Array) -> tuple[float, float | None]:
        legs = Choice.from_dict(choice)
        exact = self.objective(legs, SAMPLES, False).rate(x).merit(PENALTY)
        return exact, self.objective(legs, SAMPLES, True).rate(x).merit(PENALTY) if legs.simulable else None

    def confirm(self, choice: dict[str, Any], x: Array) -> bool:
        try:
            preset = to_preset(x, Choice.from_dict(choice), "a candidate of a search", "candidate")
            return confirm(preset, self.targets, self.walk, self.beta).holds
        except HoofEnvError:  # a dead point between two samples, a gait beyond its limits
            return False

    def objective(
        self, choice: Choice, samples: int, paper_solver: bool, *, by_toe: bool = False
    ) -> Objective:
        """The objective of a choice, kept for the next call."""
        return _objective(choice, self.targets, self.walk, samples, paper_solver, by_toe, self.beta)


def standing(objective: Objective, x: Array) -> Standing:
    """How far a candidate is from its goal."""
    report = objective.report(x)
    return Standing(
        report["within"],
        report["of"],
        report["worst"],
        report["worst_error"],
        float(sum(report["plausibility"].values())),
    )
