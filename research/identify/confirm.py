"""The judge of a search: the full system, every row and every claim, with both solvers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hoof_env.paper.measure import measure_stance
from hoof_env.paper.reproduce import SOLVERS, reproduce
from hoof_env.paper.rows import compare, severity
from hoof_env.paper.shapes import BRAKING, HOOF_ON_GROUND
from research.identify.measure import MISSED_ROW
from research.identify.targets import Targets

GIVEN_UP: Mapping[str, tuple[str, ...]] = {"walks": (), "brakes": ("walk.walks",)}
"""Claims that a walk gives up: a hoof that slides forward brakes and does not walk."""

READ_AS = {"walks": HOOF_ON_GROUND, "brakes": BRAKING}
"""How `walk.direction` must hold, see `hoof_env.paper.shapes`."""

JUDGED = {"printed": ("exact", "paper"), "probable": ("exact", "paper, probable beta")}
"""Solvers that count, by the reading of Baumgarte's beta; the other reading is only shown."""


@dataclass(frozen=True)
class Confirmation:
    """What the full system says of a preset.

    Attributes:
        rows, claims: as `hoof_env.paper.reproduce.Reproduction` has them, the rows compared with the targets.
        counted: the solvers that count, the exact one first.
        errors: the largest error of a row with each of these, without the ill-conditioned rows [bars].
        outside: (id, solver) of the rows outside their bars, of the solvers that count.
        untrue: likewise of the required claims that do not hold.
    """

    rows: list[dict[str, Any]]
    claims: list[dict[str, Any]]
    counted: tuple[str, ...]
    errors: tuple[float, ...]
    outside: tuple[tuple[str, str], ...]
    untrue: tuple[tuple[str, str], ...]

    @property
    def holds(self) -> bool:
        return not self.outside and not self.untrue

    def within(self, solver: str) -> tuple[int, int]:
        """Rows within their bars, and rows that have one, with a solver."""
        judged = [row["within_bar"] for row in self.rows if row["solver"] == solver]
        return judged.count(True), len(judged) - judged.count(None)

    def __str__(self) -> str:
        counts = ", ".join("{1} of {2} with solver {0!r}".format(s, *self.within(s)) for s in self.counted)
        missing = ", ".join(f"{name} ({solver})" for name, solver in self.outside + self.untrue)
        verdict = "is met" if self.holds else f"is not met, missing: {missing}"
        return f"the bar {verdict}; rows within their bars: {counts}"


def confirm(preset: Mapping[str, Any], targets: Targets, walk: str, beta: str = "probable") -> Confirmation:
    """Run a preset through the full system.

    Args:
        preset: content of a preset file. targets: what its rows are compared with.
        walk: "walks" or "brakes". beta: "printed" or "probable".

    Raises:
        HoofEnvError: the leg does not turn, or its simulation stops.
    """
    content: Any = dict(preset)
    run, counted = reproduce(preset=content), JUDGED[beta]
    published = replace(run.published, rows=targets.rows)
    rows: list[dict[str, Any]] = []
    for solver in SOLVERS:
        stances = {key[:2]: measure_stance(trace) for key, trace in run.traces.items() if key[2] == solver}
        rows += compare(published, stances, solver)
    outside = [(r["id"], r["solver"]) for r in rows if r["within_bar"] is False and r["solver"] in counted]
    untrue = [
        (claim["id"], claim["solver"])
        for claim in run.shapes
        if claim["solver"] in counted
        and claim["id"] not in GIVEN_UP[walk]
        and not claim["readings"].get(READ_AS[walk], claim["holds"])
    ]
    errors = [
        max(
            (severity(r, published) for r in rows if r["solver"] == solver and not r["spared"]),
            default=MISSED_ROW,
        )
        for solver in counted
    ]
    limited = tuple(min(error, MISSED_ROW) for error in errors)
    return Confirmation(rows, run.shapes, counted, limited, tuple(outside), tuple(untrue))
