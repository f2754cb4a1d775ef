"""The condition of each published row in words and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hoof_env.paper.published import Published, PublishedRow
from hoof_env.paper.report import format_number
from hoof_env.paper.study.conditions import LEVEL_LINE, LEVEL_WINDOW, PART
from hoof_env.paper.study.section import listed, table

SOLVERS = (
    ("paper", "step", "step, printed β"),
    ("paper, probable beta", "step", "step, probable β"),
    ("paper", "beta", "β, printed"),
    ("paper, probable beta", "beta", "β, probable"),
    ("paper", "ground", "hip, printed β"),
    ("paper, probable beta", "ground", "hip, probable β"),
    ("exact", "ground", "hip, exact"),
)


def conditions_text(published: Published, conditions: Mapping[str, Mapping[str, Any]]) -> str:
    """Text and table of what `conditions` found."""
    window, lines = f"±{1e3 * LEVEL_WINDOW:g} mm", []
    worst: dict[str, float] = {}
    crooked = []
    for row in published.rows:
        entry = conditions[row.id]
        line = [f"`{row.id}`"]
        for solver, parameter, _ in SOLVERS:
            answer = entry[solver][parameter]
            line.append(number(answer["relative"], "+.3g"))
            worst[row.id] = max(worst.get(row.id, 0.0), bars_spanned(row, answer) or 0.0)
        answer = entry["exact"]["ground"]
        digits, unit = ("+.4f" if row.unit in ("s", "-") else "+.2f"), row.unit.replace("-", "")
        extremes = f"{format_number(answer['low'], row.unit)} to {format_number(answer['high'], row.unit)}"
        lines.append([*line, f"{number(answer['slope'], digits)} {unit}".strip(), extremes])
        span = bars_spanned(row, answer)
        if (
            span
            and span > 1
            and abs(answer["high"] - answer["low"]) > 2 * 2e3 * LEVEL_WINDOW * abs(answer["slope"])
        ):
            crooked.append(f"`{row.id}`")
    ranked = sorted(worst, key=lambda row: -worst[row])[:3]
    forces = [row for row in published.rows if row.unit == "N"]
    noisy = max(forces, key=lambda row: _noise(conditions[row.id]))
    scatter = listed(
        f"{number(conditions[noisy.id][solver]['step']['scatter'], '.2g')} {noisy.unit} ({name} β)"
        for solver, name in (("paper", "printed"), ("paper, probable beta", "probable"))
    )
    text = (
        "Condition of each row: relative change of the row per relative change of the time step, of β and "
        "of the hip's height above the ground (which falls as the ground rises). Slopes are those of a "
        f"line through values within ±{100 * PART:g} % of step and β and ±{1e3 * LEVEL_LINE:g} mm of "
        "ground; the last two columns give the exact solver's change for 1 mm that the ground rises, and "
        f"its extremes within {window}. Angles and times have an arbitrary zero, so their relative figures "
        "say little. Most bars, in the widest of these windows, are spanned by "
        f"{listed(f'`{row}` ({worst[row]:.0f})' for row in ranked)}. Over the step `{noisy.id}` scatters "
        f"most about its line, by {scatter} rms: the loop samples the approach speed, which jumps as "
        f"touch-down passes from one step to the next. Rows whose change within {window} of ground is more "
        f"than a bar and over twice what the exact slope says: {listed(crooked)}."
    )
    head = ["row", *(label for *_, label in SOLVERS), "exact, per mm", f"exact, {window}"]
    return f"{text}\n\n{table(head, lines)}"


def _noise(entry: Mapping[str, Any]) -> float:
    """Scatter of a force over the step by the paper's solver, relative to the force [-]."""
    answers = (entry[solver] for solver in ("paper", "paper, probable beta"))
    return max(answer["step"]["scatter"] / abs(answer["value"]) for answer in answers)


def bars_spanned(row: PublishedRow, answer: Mapping[str, Any]) -> float | None:
    """How many bars a row spans in the window of an answer, None where it has no bar or no value."""
    low, high = answer["low"], answer["high"]
    if row.bar.limit is None or low is None or high is None:
        return None
    return abs(row.bar.error(high, row.value) - row.bar.error(low, row.value)) / row.bar.limit


def number(value: float | None, spec: str) -> str:
    """A number, or 'none'."""
    return "none" if value is None or not math.isfinite(value) else format(value, spec)
