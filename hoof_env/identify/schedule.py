"""What a search tries, in which order and at what expense: data, no code that searches."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

PAPER_WEIGHT = 12
"""How many evaluations one with the paper's solver counts for: it takes that much longer."""


BUDGET = 20_000_000
"""Evaluations of a search unless told otherwise; one takes some 0.1 ms."""


@dataclass(frozen=True)
class Phase:
    """One or more rounds of equal jobs, each a CMA-ES run from a start of its own.

    Attributes:
        name: in reports.
        start: "given" (around the start preset), "cold" (anywhere) or "best" (around results so far).
        jobs, rounds: jobs a round, and rounds.
        evaluations: at most, a job.
        sigmas, populations: one of each is drawn for a job; sigma in units of the problem's scales.
        spreads: "given" only, one is drawn: the start's distance from the preset, in sigmas.
        tries: "cold" only, how many random legs the best of which is the start.
        elite, favour: "best" only: the best with this probability, else one of the best `elite` results.
        below: "best" only: results of other phases that cost more with the exact solver are not refined;
            without any left the phase is skipped.
        give_up: pairs (evaluations, cost): a job that costs more after so many evaluations ends.
        samples: instants a revolution.
        by_toe: search the time of the walking toe's touch-down instead of the ground level, see `Objective`.
        loss: what is minimised, a method of `Objective`.
        paper_solver: the objective contains the paper's solver too.
        ends_at_bar: a job ends as soon as all rows are clear within their bars and nothing falls short.
    """

    name: str
    start: str
    jobs: int
    evaluations: int
    sigmas: tuple[float, ...]
    populations: tuple[int, ...] = (20, 40, 60)
    rounds: int = 1
    spreads: tuple[float, ...] = (0.0, 0.5, 1.0)
    tries: int = 3000
    elite: int = 6
    favour: float = 0.4
    below: float = float("inf")
    give_up: tuple[tuple[int, float], ...] = ()
    samples: int = 201
    by_toe: bool = False
    loss: str = "cost"
    paper_solver: bool = False
    ends_at_bar: bool = False

    @property
    def weight(self) -> int:
        """What an evaluation counts for."""
        return PAPER_WEIGHT if self.paper_solver else 1


Schedule = tuple[Phase, ...]
"""Phases, run again and again until the bar is reached or the budget spent."""

_REFINE = Phase(
    "refine",
    "best",
    jobs=6,
    rounds=3,
    evaluations=60_000,
    sigmas=(0.002, 0.005, 0.01, 0.02, 0.04),
    populations=(14, 20, 30),
    elite=8,
    give_up=((20_000, 40.0),),
    by_toe=True,
)
_BOTH = Phase(
    "both solvers",
    "best",
    jobs=4,
    evaluations=30_000,
    sigmas=(0.002, 0.005, 0.01, 0.02),
    populations=(14, 20),
    below=6.0,
    paper_solver=True,
    ends_at_bar=True,
    by_toe=True,
)

FROM_PRESET: Schedule = (
    Phase(
        "around",
        "given",
        jobs=6,
        evaluations=120_000,
        sigmas=(0.02, 0.04, 0.08, 0.15),
        populations=(14, 20, 30),
        give_up=((20_000, 120.0), (60_000, 40.0)),
        by_toe=True,
    ),
    _REFINE,
    _BOTH,
)
COLD: Schedule = (
    Phase(
        "cold",
        "cold",
        jobs=8,
        evaluations=300_000,
        sigmas=(0.25,),
        give_up=((15_000, 400.0), (40_000, 120.0), (80_000, 60.0), (200_000, 25.0)),
    ),
    _REFINE,
    _BOTH,
)


def rounds(schedule: Schedule) -> Iterator[tuple[int, Phase]]:
    """Endless: (number of the round, its phase)."""
    phases = itertools.chain.from_iterable(itertools.repeat(phase, phase.rounds) for phase in schedule)
    yield from enumerate(itertools.cycle(phases))
