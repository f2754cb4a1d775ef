"""What the parts of a search tell each other: the problem, a job, its progress and its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from research.identify.minimax import Rate
from research.identify.schedule import Phase

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Standing:
    """How far a candidate is from its goal.

    Attributes:
        within, of: rows within their bar, and rows that have one.
        worst, error: the row that is furthest out, and its error in bars.
        short: the sum of the plausibility shortages, 0 if there is none.
        met: every row is within its bar and nothing falls short.
    """

    within: int
    of: int
    worst: str
    error: float
    short: float

    @property
    def met(self) -> bool:
        return self.within == self.of and self.short <= 0

    @property
    def excess(self) -> float:
        """The largest error, and what falls short on top [bars]."""
        return abs(self.error) + 2.0 * self.short


class Problem(Protocol):
    """What is searched. It must pickle; a choice is a JSON object of what cannot vary continuously."""

    def given(self, rng: np.random.Generator, phase: Phase) -> tuple[dict[str, Any], Array]:
        """Choice and a phase's coordinates of a start near the start preset."""

    def cold(self, rng: np.random.Generator, phase: Phase) -> tuple[dict[str, Any], Array]:
        """Choice and a phase's coordinates of a start anywhere."""

    def scales(self, choice: dict[str, Any], phase: Phase) -> Array:
        """The size of a step in each of a phase's coordinates."""

    def inward(self, choice: dict[str, Any], x: Array, phase: Phase) -> Array:
        """The same candidate in the coordinates that a phase searches in."""

    def outward(self, choice: dict[str, Any], y: Array, phase: Phase) -> Array:
        """Inverse of `inward`."""

    def cost(self, choice: dict[str, Any], phase: Phase) -> Callable[[Array], float]:
        """The function to minimise in a phase, of its coordinates."""

    def rate(self, choice: dict[str, Any], phase: Phase) -> Rate:
        """The rating to improve in a phase, of its coordinates."""

    def standing(self, choice: dict[str, Any], x: Array, paper_solver: bool) -> Standing:
        """How far a candidate is from its goal, with the exact solver alone or with both."""

    def rank(self, choice: dict[str, Any], x: Array) -> tuple[float, float | None]:
        """Merit that compares between phases: with the exact solver, and with both (None: no such leg)."""

    def confirm(self, choice: dict[str, Any], x: Array) -> bool:
        """Whether the full system finds every bar met and every claim true."""


@dataclass(frozen=True)
class Parent:
    """A result that a later job may start from; `root` is the job of the independent start behind it."""

    root: str
    choice: dict[str, Any]
    x: list[float]


@dataclass(frozen=True)
class Job:
    """A job: its place in the search, the search's seed, what it may spend and what it may start from."""

    round: int
    index: int
    phase: Phase
    seed: int
    evaluations: int
    parents: tuple[Parent, ...] = ()

    @property
    def id(self) -> str:
        return f"{self.round:03d}-{self.index:02d}"


@dataclass(frozen=True)
class Result:
    """What a job found; see `Job`, `Parent` and `Standing`.

    Attributes:
        root: id of the independent start that it goes back to.
        sigma, population: drawn for this job.
        evaluations, seconds: spent. stop: why it ended.
        cost: of the job's own objective.
        exact, standing: merit [bars] and more with the exact solver alone. full, both: with both, None where
            the full system lacks the choice.
        confirmed: the full system finds every bar met and every claim true.
    """

    id: str
    phase: str
    start: str
    root: str
    choice: dict[str, Any]
    sigma: float
    population: int
    evaluations: int
    seconds: float
    stop: str
    x: list[float]
    cost: float
    exact: float
    full: float | None
    standing: Standing
    both: Standing | None
    confirmed: bool

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Result:
        """Inverse of `to_dict`; KeyError or TypeError for anything else."""
        both = data["both"]
        parts = {"standing": Standing(**data["standing"]), "both": both and Standing(**both)}
        return cls(**{**data, **parts})

    @property
    def parent(self) -> Parent:
        return Parent(self.root, self.choice, self.x)


@dataclass(frozen=True)
class Progress:
    """A running job: evaluations so far, lowest cost or merit, and the standing of what has it."""

    id: str
    evaluations: int
    cost: float
    standing: Standing
