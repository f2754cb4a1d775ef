"""What a search tries, in which order and at what expense: data, no code that searches."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

PAPER_WEIGHT = 12
"""How many evaluations one with the paper's solver counts for: it takes that much longer."""

BUDGET = 10_000_000
"""Evaluations of a search unless told otherwise; one takes some 0.1 ms."""


@dataclass(frozen=True)
class Phase:
    """One or more rounds of equal jobs, each from a start of its own.

    Attributes:
        name: in reports.
        start: "given" (around the start preset), "cold" (anywhere) or "best" (from results so far: job i
            from the i-th best of the independent starts).
        jobs, rounds: jobs a round, and rounds.
        evaluations: at most, a job; a descent that has begun is finished.
        sigmas: one is drawn for a job of CMA-ES, or for each hop between descents; in scales.
        method: "cma" (CMA-ES on the cost of all errors) or "minimax" (descents of the largest error, each
            from beside the best so far, see `minimax`).
        population: of CMA-ES.
        spreads: "given" only, one is drawn: the start's distance from the preset, in scales.
        tries: how many random legs the best of which is the start; "given" and "cold" only.
        elite: "best" only: how many independent starts are kept.
        below: "best" only: results of other phases that are further out with the exact solver [bars] are
            not refined; without any left the phase is skipped.
        samples: instants a revolution.
        paper_solver: the objective contains the paper's solver too.
        ends_at_bar: a job ends as soon as all rows are clear within their bars and nothing falls short.
    """

    name: str
    start: str
    jobs: int
    evaluations: int
    sigmas: tuple[float, ...]
    method: str = "cma"
    population: int = 20
    rounds: int = 1
    spreads: tuple[float, ...] = (0.0, 0.15, 0.3, 0.5)
    tries: int = 300
    elite: int = 6
    below: float = float("inf")
    samples: int = 101
    paper_solver: bool = False
    ends_at_bar: bool = False

    @property
    def weight(self) -> int:
        """What an evaluation counts for."""
        return PAPER_WEIGHT if self.paper_solver else 1


Schedule = tuple[Phase, ...]
"""Phases, run again and again until the bar is reached or the budget spent."""

_HOPS = (0.003, 0.01, 0.03, 0.1)
_DESCENTS = Phase("descend", "best", 8, 4_000, _HOPS, method="minimax", elite=8, samples=401)
_START = replace(_DESCENTS, name="start", start="given", jobs=1, evaluations=6_000, spreads=(0.0,))
_AROUND = Phase("around", "given", 24, 4_000, (0.1,))
_COLD = Phase("cold", "cold", 24, 4_000, (0.2,), tries=1500)
_REFINE = (
    Phase("settle", "best", 8, 8_000, (0.05,), elite=8),
    _DESCENTS,
    replace(_DESCENTS, name="polish", jobs=4, elite=2, rounds=3, evaluations=16_000, ends_at_bar=True),
    replace(
        _DESCENTS,
        name="both solvers",
        jobs=4,
        elite=2,
        rounds=2,
        evaluations=8_000,
        sigmas=(0.002, 0.005, 0.01, 0.02, 0.04),
        below=1.5,
        paper_solver=True,
        ends_at_bar=True,
    ),
)

FROM_PRESET: Schedule = (_AROUND, *_REFINE)
COLD: Schedule = (_COLD, *_REFINE)
BEYOND: Schedule = (_START, replace(_AROUND, spreads=(0.15, 0.3, 0.5)), *_REFINE)
"""For a search that keeps going, whose start may lie within the bars already."""


def rounds(schedule: Schedule) -> Iterator[tuple[int, Phase]]:
    """Endless: (number of the round, its phase)."""
    phases = itertools.chain.from_iterable(itertools.repeat(phase, phase.rounds) for phase in schedule)
    yield from enumerate(itertools.cycle(phases))
