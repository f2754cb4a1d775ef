"""What every claim is held against: the four conditions with every solver, measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.identify.plausibility import demands
from hoof_env.paper.measure import Stance, measure_stance
from hoof_env.paper.published import Published
from hoof_env.paper.reproduce import SOLVERS, Reproduction
from hoof_env.paper.study.claim import Finding

Trace = NDArray[np.void]

NAMES = {"walk": "walking", "run": "running"}


@dataclass(frozen=True)
class Case:
    """The four conditions with every solver.

    Attributes:
        reproduction: as `reproduce` gave it.
        stances: by gait, condition and solver.
    """

    reproduction: Reproduction
    stances: Mapping[tuple[str, str, str], Stance]

    @classmethod
    def of(cls, reproduction: Reproduction) -> Case:
        """The case of a reproduction."""
        return cls(reproduction, {key: measure_stance(trace) for key, trace in reproduction.traces.items()})

    @property
    def published(self) -> Published:
        """What the paper prints."""
        return self.reproduction.published

    def trace(self, gait: str, solver: str, condition: str = "elastic") -> Trace:
        """One cycle."""
        return self.reproduction.traces[gait, condition, solver]

    def stance(self, gait: str, solver: str, condition: str = "elastic") -> Stance:
        """Its stance."""
        return self.stances[gait, condition, solver]

    def row(self, row_id: str, solver: str) -> dict[str, Any]:
        """A published row as one solver gives it."""
        return next(r for r in self.reproduction.rows if (r["id"], r["solver"]) == (row_id, solver))

    def judged(self, claim_id: str, reading: str) -> tuple[Finding, ...]:
        """The verdicts of `hoof_env.paper.shapes.judge`, solver by solver."""
        return tuple(
            Finding(reading, shape["solver"], shape["holds"], shape["evidence"], self.asked(claim_id))
            for shape in self.reproduction.shapes
            if shape["id"] == claim_id
        )

    def asked(self, *ids: str) -> tuple[str, ...]:
        """Those of these rows and shapes that the identification asks for: with a bar, or in a demand."""
        barred = {row.id for row in self.published.rows if row.bar.limit is not None}
        asks = demands("walks")
        shapes = {
            claim.id
            for claim in self.published.claims
            if any(f"claim {claim.id}" in demand.why or demand.name.startswith(claim.id) for demand in asks)
        }
        return tuple(name for name in ids if name in barred | shapes)


def by_solver(
    reading: str, decide: Callable[[str], tuple[bool | None, str]], asked: tuple[str, ...] = ()
) -> tuple[Finding, ...]:
    """One finding for each solver from a function of the solver."""
    return tuple(Finding(reading, solver, *decide(solver), asked) for solver in SOLVERS)
