"""One slip of the paper's print: what stands there, what must stand there, and what the letter would do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

IMPOSSIBLE, CHANGES, UNPRINTED, HARMLESS = (
    "cannot be computed as printed",
    "would change what the paper reports",
    "would change only what the paper does not report",
    "would change nothing",
)
EFFECTS = (IMPOSSIBLE, CHANGES, UNPRINTED, HARMLESS)
"""What a slip does if it is taken by its letter, worst first."""

NOTICED = 0.005
"""Relative change of a reported number that counts as a change [-]."""


@dataclass(frozen=True)
class Slip:
    """One slip.

    Attributes:
        id: short name. where: place in the paper.
        printed, read_as: what stands there, and how this project reads it.
        why: why the print cannot be meant.
        literal: what the letter gives, with numbers from `data`.
        effect: one of `EFFECTS`, chosen from `data`.
        data: the numbers, ready for JSON.
    """

    id: str
    where: str
    printed: str
    read_as: str
    why: str
    literal: str
    effect: str
    data: dict[str, Any] = field(default_factory=dict)


def change(literal: float, read: float) -> float:
    """Relative change that the letter makes [-]."""
    return (literal - read) / read


def effect_of(*changes: float) -> str:
    """`CHANGES` if one of these relative changes of reported numbers is noticed, else `HARMLESS`."""
    return CHANGES if any(abs(value) > NOTICED for value in changes) else HARMLESS
