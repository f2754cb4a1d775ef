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
        jobs, rounds: jobs a round, and rounds.
        evaluations: at most, a job; a descent that has begun is finished.
        sigmas: one is drawn for a job of CMA-ES, or for each hop between descents; in scales.
        method: "cma" (CMA-ES on the cost of all errors) or "minimax" (descents of the largest error, each
            from beside the best so far, see `minimax`).
        elite: how many independent starts are refined, job i from the best result of the i-th best of them;
            0: a job is an independent start, from a leg around the preset.
        below: results of other phases that are further out with the exact solver [bars] are not refined;
            without any left the phase is skipped.
        samples: instants a revolution.
        paper_solver: the objective contains the paper's solver too.
        ends_at_bar: a job ends as soon as all rows are clear within their bars and nothing falls short.
    """

    name: str
    jobs: int
    evaluations: int
    sigmas: tuple[float, ...]
    method: str = "cma"
    rounds: int = 1
    elite: int = 0
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

_DESCEND = Phase("descend", 8, 4_000, (0.003, 0.01, 0.03, 0.1), method="minimax", elite=8, samples=401)
_POLISH = replace(
    _DESCEND, name="polish", jobs=4, elite=2, rounds=3, evaluations=16_000, ends_at_bar=True
)  # fmt: skip
_BOTH = replace(
    _POLISH, name="both solvers", rounds=2, evaluations=8_000, sigmas=(0.002, 0.005, 0.01, 0.02, 0.04),
    below=1.5, paper_solver=True,
)  # fmt: skip

SCHEDULE: Schedule = (
    Phase("around", 24, 4_000, (0.1,)),
    Phase("settle", 8, 8_000, (0.05,), elite=8),
    _DESCEND,
    _POLISH,
    _BOTH,
)


def rounds(schedule: Schedule) -> Iterator[tuple[int, Phase]]:
    """Endless: (number of the round, its phase)."""
    phases = itertools.chain.from_iterable(itertools.repeat(phase, phase.rounds) for phase in schedule)
    yield from enumerate(itertools.cycle(phases))
