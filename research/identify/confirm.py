"""The judge of a search: the full system, every row and every claim, with both solvers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hoof_env.paper.reproduce import reproduce
from hoof_env.paper.rows import EXACT, PROBABLE, counted, severity
from hoof_env.paper.shapes import HOOF_ON_GROUND
from research.identify.objective import MISSED_ROW

COUNTED = {"exact": EXACT, "paper": PROBABLE}
"""Solvers that count, by short names: the paper's with Baumgarte's beta as it is probably meant."""


@dataclass(frozen=True)
class Confirmation:
    """What the full system says of a preset; rows and claims as `hoof_env.paper.reproduce` has them."""

    rows: list[dict[str, Any]]
    claims: list[dict[str, Any]]
    errors: dict[str, float]  # by `COUNTED`, the largest of a row, without the ill-conditioned [bars]
    outside: list[tuple[str, str]]  # (id, solver) of rows outside their bars, of the solvers that count
    untrue: list[tuple[str, str]]  # likewise of the claims that do not hold

    @property
    def holds(self) -> bool:
        return not self.outside and not self.untrue

    def __str__(self) -> str:
        counts = (f"{solver}: {counted(self.rows, self.claims, solver)}" for solver in COUNTED.values())
        missing = ", ".join(f"{name} ({solver})" for name, solver in self.outside + self.untrue)
        verdict = "is met" if self.holds else f"is not met, missing: {missing}"
        return "; ".join([f"the bar {verdict}", *counts])


def confirm(preset: Mapping[str, Any]) -> Confirmation:
    """Run the content of a preset file through the full system and compare it with the paper; raises
    `HoofEnvError` where the leg does not turn or its simulation stops."""
    content: Any = dict(preset)
    run = reproduce(preset=content)
    rows = [row for row in run.rows if row["solver"] in COUNTED.values()]
    outside = [(row["id"], row["solver"]) for row in rows if row["within_bar"] is False]
    untrue = [
        (claim["id"], claim["solver"])
        for claim in run.shapes
        if claim["solver"] in COUNTED.values() and not claim["readings"].get(HOOF_ON_GROUND, claim["holds"])
    ]
    errors = {}
    for name, solver in COUNTED.items():
        judged = [row for row in rows if row["solver"] == solver and not row["spared"]]
        errors[name] = min(max(severity(row, run.published) for row in judged), MISSED_ROW)
    return Confirmation(run.rows, run.shapes, errors, outside, untrue)
