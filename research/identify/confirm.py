"""The judge of a search: the full system, every row and every claim, with both solvers."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hoof_env.paper.measure import measure_stance
from hoof_env.paper.published import Published
from hoof_env.paper.reproduce import SOLVERS, Reproduction, reproduce
from hoof_env.paper.rows import compare
from hoof_env.paper.shapes import BRAKING, HOOF_ON_GROUND
from research.identify.targets import Targets

GIVEN_UP: Mapping[str, tuple[str, ...]] = {"walks": (), "brakes": ("walk.walks",)}
"""Claims that a walk gives up: a hoof that slides forward brakes and does not walk."""

JUDGED = {"printed": ("exact", "paper"), "probable": ("exact", "paper, probable beta")}
"""Solvers that count, by the reading of Baumgarte's beta; the other reading is only shown."""

READ_AS = {"walks": HOOF_ON_GROUND, "brakes": BRAKING}
"""How `walk.direction` must hold, see `hoof_env.paper.shapes`."""


@dataclass(frozen=True)
class Confirmation:
    """What the full system says of a preset.

    Attributes:
        reproduction: as `hoof_env.paper.reproduce` returns it, its rows compared with the targets.
        counted: the solvers that count.
        outside: (id, solver) of the rows outside their bars, of the solvers that count.
        untrue: likewise of the required claims that do not hold.
    """

    reproduction: Reproduction
    counted: tuple[str, ...]
    outside: tuple[tuple[str, str], ...]
    untrue: tuple[tuple[str, str], ...]

    @property
    def holds(self) -> bool:
        return not self.outside and not self.untrue

    def within(self, solver: str) -> tuple[int, int]:
        """Rows within their bars, and rows that have one, with a solver."""
        judged = [r["within_bar"] for r in self.reproduction.rows if r["solver"] == solver]
        return judged.count(True), len(judged) - judged.count(None)


def confirm(preset: Mapping[str, Any], targets: Targets, walk: str, beta: str = "probable") -> Confirmation:
    """Run a preset through the full system.

    Args:
        preset: content of a preset file. targets: what its rows are compared with.
        walk: "walks" or "brakes". beta: "printed" or "probable".

    Raises:
        HoofEnvError: the leg does not turn, or its simulation stops.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "identified.json"
        path.write_text(json.dumps(preset), encoding="utf-8")
        run = reproduce(preset=str(path))
    aims: Published = replace(run.published, rows=targets.rows)
    rows: list[dict[str, Any]] = []
    for solver in SOLVERS:
        stances = {key[:2]: measure_stance(trace) for key, trace in run.traces.items() if key[2] == solver}
        rows += compare(aims, stances, solver)
    counts = JUDGED[beta]
    outside = [(r["id"], r["solver"]) for r in rows if r["within_bar"] is False and r["solver"] in counts]
    untrue = [
        (claim["id"], claim["solver"])
        for claim in run.shapes
        if claim["solver"] in counts
        and claim["id"] not in GIVEN_UP[walk]
        and not claim["readings"].get(READ_AS[walk], claim["holds"])
    ]
    result = replace(run, rows=rows, published=aims, geometry=run.geometry.replace(name="identified"))
    return Confirmation(result, counts, tuple(outside), tuple(untrue))
