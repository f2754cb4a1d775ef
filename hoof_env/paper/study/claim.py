"""One claim of the paper's text, and what the simulation says to it under each reading."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

CONFIRMED, READING, SOLVER, CONTRADICTED, UNTESTABLE = (
    "confirmed",
    "depends on the reading",
    "depends on reading or solver",
    "contradicted",
    "not testable",
)
STATUSES = (CONFIRMED, READING, SOLVER, CONTRADICTED, UNTESTABLE)

PUBLISHED = "print"
"""In place of a solver: the verdict follows from the printed numbers alone."""


@dataclass(frozen=True)
class Finding:
    """A verdict.

    Attributes:
        reading: how the claim is read.
        source: the solver, or `PUBLISHED`.
        holds: None where it cannot be tested.
        evidence: the numbers that decide, in words.
        asked: ids of the published rows and shapes behind this reading that the identification asks for;
            where there are any, agreement is consistency and no independent proof.
    """

    reading: str
    source: str
    holds: bool | None
    evidence: str
    asked: tuple[str, ...] = ()


@dataclass(frozen=True)
class Examined:
    """A claim and its verdicts.

    Attributes:
        id: short name. quote: the paper's words. where: place in the paper.
        figure: file name, without suffix, of the picture that shows it.
        findings: for every reading and source.
        note: what follows, chosen from the findings, or "".
    """

    id: str
    quote: str
    where: str
    figure: str
    findings: tuple[Finding, ...]
    note: str = ""
    data: dict[str, Any] = field(default_factory=dict)

    @property
    def asked(self) -> tuple[str, ...]:
        """What the identification asks for, over all readings."""
        return tuple(dict.fromkeys(name for finding in self.findings for name in finding.asked))

    @property
    def status(self) -> str:
        """One of `STATUSES`: confirmed or contradicted only if every reading and source agrees."""
        verdicts: dict[str, set[bool]] = {}
        for finding in self.findings:
            if finding.holds is not None:
                verdicts.setdefault(finding.reading, set()).add(finding.holds)
        found = set().union(*verdicts.values())
        if len(found) > 1:
            return SOLVER if any(len(by) > 1 for by in verdicts.values()) else READING
        return UNTESTABLE if not found else CONFIRMED if found == {True} else CONTRADICTED
