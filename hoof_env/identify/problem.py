"""The horse's leg as a problem of `search`: starts, costs and the judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError
from hoof_env.identify.candidate import (
    LINK9,
    SWINGS,
    Choice,
    random_choice,
    random_start,
    standard_deviations,
    to_preset,
)
from hoof_env.identify.confirm import confirm
from hoof_env.identify.objective import Objective
from hoof_env.identify.records import Standing
from hoof_env.identify.schedule import Phase
from hoof_env.identify.targets import Targets

Array = NDArray[np.float64]

PRODUCT = 0.5
"""Part of the cold starts with link 9 and swing as the full system has them; the rest have any."""

SAMPLES = 401
"""Instants a revolution with which candidates of all phases are compared."""


@lru_cache(maxsize=16)
def _objective(choice: Choice, targets: Targets, walk: str, samples: int, paper_solver: bool) -> Objective:
    return Objective(choice, targets, samples=samples, paper_solver=paper_solver, walk=walk)


@dataclass(frozen=True)
class LegProblem:
    """See `job.Problem`.

    Attributes:
        targets: what is aimed at.
        walk: "walks" or "brakes".
        start: choice and x of the start preset, or None if all starts are cold.
    """

    targets: Targets
    walk: str
    start: tuple[Choice, tuple[float, ...]] | None

    def given(self) -> tuple[dict[str, Any], Array]:
        if self.start is None:
            raise HoofEnvError("a search without a start preset has cold starts only")
        return self.start[0].to_dict(), np.array(self.start[1])

    def cold(self, rng: np.random.Generator, phase: Phase) -> tuple[dict[str, Any], Array]:
        choice = random_choice(rng) if rng.random() < PRODUCT else random_choice(rng, LINK9, SWINGS)
        cost = self.objective(choice, phase.samples, phase.paper_solver).cost
        tries = [random_start(choice, rng) for _ in range(phase.tries)]
        return choice.to_dict(), min(tries, key=cost)

    def scales(self, choice: dict[str, Any]) -> Array:
        return standard_deviations(Choice.from_dict(choice))

    def cost(self, choice: dict[str, Any], phase: Phase) -> Callable[[Array], float]:
        return self.objective(Choice.from_dict(choice), phase.samples, phase.paper_solver).cost

    def standing(self, choice: dict[str, Any], x: Array, paper_solver: bool) -> Standing:
        return standing(self.objective(Choice.from_dict(choice), SAMPLES, paper_solver), x)

    def rank(self, choice: dict[str, Any], x: Array) -> tuple[float, float | None]:
        legs = Choice.from_dict(choice)
        exact = self.objective(legs, SAMPLES, False).cost(x)
        return exact, self.objective(legs, SAMPLES, True).cost(x) if legs.simulable else None

    def confirm(self, choice: dict[str, Any], x: Array) -> bool:
        try:
            preset = to_preset(x, Choice.from_dict(choice), "a candidate of a search", "candidate")
            return confirm(preset, self.targets, self.walk).holds
        except HoofEnvError:  # a dead point between two samples, a gait beyond its limits
            return False

    def objective(self, choice: Choice, samples: int, paper_solver: bool) -> Objective:
        """The objective of a choice, kept for the next call."""
        return _objective(choice, self.targets, self.walk, samples, paper_solver)


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
