"""Report of the reproduction: published and simulated numbers, claims about shape, versions and command."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from string import Template
from typing import Any

from hoof_env import __version__
from hoof_env._output import markdown_table
from hoof_env.ground.contact import HERTZ
from hoof_env.paper.figures import DRAWINGS
from hoof_env.paper.level import SHIFTS
from hoof_env.paper.measure import hoof_error, measure_stance
from hoof_env.paper.rows import (
    EULER,
    EXACT,
    PRINTED,
    PROBABLE,
    UNDETERMINED,
    Reproduction,
    betas,
    counted,
    severity,
    slowest_root,
)

WORST = 3
"""Number of rows of each solver that are named as its worst."""

PAGE = Path(__file__).with_name("report.md.in")
"""Template of the page; its numbers and tables start with $."""

# Decimal places by unit or by measure of a bar.
_DIGITS = {"s": 4, "deg": 2, "N": 1, "%": 2, "-": 3, "point": 2, "": 3}
_PACKAGES = ("gymnasium", "numpy", "llvmlite")


def markdown(reproduction: Reproduction, *, command: str, figures: bool) -> str:
    """Return the whole page in Markdown.

    Args:
        reproduction: the reproduction.
        command: command that writes the page, for its head.
        figures: True if the pictures of `paper.figures` are in the page's folder.
    """
    solvers = list(dict.fromkeys(row["solver"] for row in reproduction.rows))
    geometry = reproduction.geometry
    published = reproduction.published
    page = Template(PAGE.read_text(encoding="utf-8")).substitute(
        source=published.source,
        preset=geometry.name,
        provenance=geometry.provenance,
        stiffness=f"{reproduction.ground.stiffness:g}",
        exponent=f"{reproduction.ground.exponent:g}",
        printed_stiffness=f"{published.parameters['stiffness']:g}",
        hertz=f"{HERTZ:g}",
        step=f"{1e3 * published.parameters['time_step_s']:g}",
        printed=PRINTED,
        probable=PROBABLE,
        exact=EXACT,
        command=command,
        version=__version__,
        versions=", ".join(
            [f"Python {platform.python_version()}", *(f"{name} {version(name)}" for name in _PACKAGES)]
        ),
        summaries="\n\n".join(_summary(reproduction, solver) for solver in solvers),
        rows=_rows_table(reproduction, solvers),
        undetermined=_undetermined(reproduction),
        details=_details_table(reproduction),
        resultants=_resultants(reproduction, solvers),
        beside=_beside_table(reproduction, solvers),
        claims="\n\n".join(_shape(reproduction, claim.id, figures) for claim in published.claims),
        definitions=_definitions(reproduction, solvers[0]),
        **which_beta(reproduction),
    )
    if figures:
        shown = [f"![{name}]({name}.png)\n[{name}.svg]({name}.svg)" for name in DRAWINGS]
        page += "\n" + "\n\n".join(["## Figures", *shown]) + "\n"
    return page


def _of(entries: Iterable[Mapping[str, Any]], **wanted: str) -> list[Any]:
    """Return the entries with the wanted values."""
    return [entry for entry in entries if all(entry[key] == value for key, value in wanted.items())]


def format_number(value: float | None, unit: str, sign: str = "") -> str:
    """Return a number with the digits of its unit, "none" for None; with the sign if `sign` is "+"."""
    return "none" if value is None else f"{value:{sign}.{_DIGITS[unit]}f}"


def format_error(row: Mapping[str, Any], reproduction: Reproduction) -> str:
    """Return the error of a row with its sign and the measure of its bar."""
    measure = reproduction.published.row(row["id"]).bar.measure
    name = {"point": " points"}.get(measure, f" {measure}" if measure else "")
    return "none" if row["error"] is None else format_number(row["error"], measure, "+") + name


def _worst(reproduction: Reproduction, solver: str) -> list[dict[str, Any]]:
    """Return the rows of a solver that are farthest outside their bars, at most `WORST`."""
    rows = [row for row in _of(reproduction.rows, solver=solver) if row["within_bar"] is False]
    return sorted(rows, key=lambda row: -severity(row, reproduction.published))[:WORST]


def _summary(reproduction: Reproduction, solver: str) -> str:
    """Return a paragraph on the rows and claims of a solver."""
    worst = ", ".join(
        f"{row['id']} {format_error(row, reproduction)} (bar {row['bar']})"
        for row in _worst(reproduction, solver)
    )
    # The same sentence as on the command line.
    counts = counted(reproduction.rows, reproduction.shapes, solver)
    return f"Solver `{solver}`: {counts}. Worst: {worst or 'none outside'}."


def _rows_table(reproduction: Reproduction, solvers: list[str]) -> str:
    """Return the table of published rows with the value and the error of each solver."""
    worst = {(row["id"], solver) for solver in solvers for row in _worst(reproduction, solver)}
    lines = []
    for published in reproduction.published.rows:
        value = format_number(published.value, published.unit)
        line = [f"`{published.id}`", published.quantity, published.unit, value, published.bar_text]
        for solver in solvers:
            (row,) = _of(reproduction.rows, id=published.id, solver=solver)
            error = format_error(row, reproduction)
            # `within_bar` of a spared row is None, not False.
            if row["within_bar"] is False:
                error += " ✗"
            elif row["spared"] == UNDETERMINED:
                error += " †"
            if (row["id"], solver) in worst:
                error = f"**{error}**"
            line += [format_number(row["simulated"], row["unit"]), error]
        lines.append(line)
    head = ["row", "quantity", "unit", "published", "bar"]
    head += [text for solver in solvers for text in (f"solver {solver}", "error")]
    return markdown_table(head, lines)


def _undetermined(reproduction: Reproduction) -> str:
    """Return the section on rows that are not determinable, "" without such rows."""
    spared = list(dict.fromkeys(row["id"] for row in _of(reproduction.rows, spared=UNDETERMINED)))
    if not spared:
        return ""
    text = (
        "## Rows that are not determinable\n\n"
        f"These rows, marked †, have no verdict with any solver: {listed(f'`{name}`' for name in spared)}. "
        "The walking toe grazes the ground, and Eq. 14 divides by the speed at which it touches down, so the "
        "inelastic force of walking is a spike over the ground level. The level is fitted, and the search "
        "put it on top of the spike. A row is not determinable if a shift of the ground level of at most "
        f"{1e3 * max(SHIFTS):g} mm moves it by more than its bar."
    )
    if not reproduction.levels:
        return text + "\n\n"
    first = reproduction.levels[0]
    places = [k for k, shift in enumerate(first["shifts_um"]) if shift < 0]
    middle = len(places)
    head = ["row", *(f"{shift:+d} µm" for shift in first["shifts_um"])]
    head.insert(1 + middle, "fitted level")
    lines = []
    for name in spared:
        (entry,) = _of(reproduction.levels, id=name)
        (row,) = _of(reproduction.rows, id=name, solver=EXACT)
        values = list(zip(entry["simulated"], entry["within_bar"], strict=True))
        values.insert(middle, (row["simulated"], abs(row["error"]) <= _limit(reproduction, name)))
        cells = [format_number(value, row["unit"]) + ("" if within else " ✗") for value, within in values]
        lines.append([f"`{name}` [{row['unit']}]", *cells])
    moved = listed(f"{_of(reproduction.levels, id=name)[0]['moved']:.1f} (`{name}`)" for name in spared)
    rest = [entry for entry in reproduction.levels if entry["id"] not in spared]
    most = max(rest, key=lambda entry: entry["moved"])
    leaving = [f"`{entry['id']}`" for entry in rest if not all(entry["within_bar"])]
    left = (
        f" {listed(leaving)} {'leave' if len(leaving) > 1 else 'leaves'} the bar all the same, because the "
        "fit ends so near it."
        if leaving
        else ""
    )
    return (
        f"{text} With solver `{EXACT}`, by the rise of the ground (✗ is outside the bar):\n\n"
        f"{markdown_table(head, lines)}\n\n"
        f"Within these shifts the rows move by {moved} bars, and each of the other {len(rest)} by "
        f"{most['moved']:.2f} bars at most (`{most['id']}`).{left}\n\n"
    )


def _limit(reproduction: Reproduction, name: str) -> float:
    """Return the largest accepted error of a row, 0 if it is only reported."""
    return reproduction.published.row(name).bar.limit or 0.0


def _details_table(reproduction: Reproduction) -> str:
    """Return the table of figures that the paper does not print, by gait."""
    by_name: dict[str, list[str]] = {}
    gaits = list(dict.fromkeys(entry["id"].partition(".")[0] for entry in reproduction.details))
    for entry in reproduction.details:
        name = entry["id"].partition(".")[2]
        line = by_name.setdefault(name, [f"`{name}`", entry["quantity"], entry["unit"]])
        line.append(f"{entry['value']:.2f}")
    return markdown_table(["figure", "quantity", "unit", *gaits], by_name.values())


def _resultants(reproduction: Reproduction, solvers: list[str]) -> str:
    """Return the number of rows within their bars under the used reading of 'maximum force' and under the
    alternative, the resultant."""
    parts = []
    for solver in solvers:
        readings = []
        for row in _of(reproduction.rows, solver=solver, spared=""):
            bar = reproduction.published.row(row["id"]).bar
            resultants = [value for name, value in row["beside"].items() if name.startswith("resultant")]
            readings += [(row["within_bar"], bar.holds(bar.error(v, row["published"]))) for v in resultants]
        used = sum(bool(as_used) for as_used, _ in readings)
        as_resultant = sum(bool(verdict) for _, verdict in readings)
        parts.append(f"{used} and {as_resultant} of {len(readings)} counted with solver `{solver}`")
    return ", ".join(parts)


def _beside_table(reproduction: Reproduction, solvers: list[str]) -> str:
    """Return the table of values under other readings, and of errors against the number in print."""
    lines = []
    for published in reproduction.published.rows:
        by_solver = [row["beside"] for row in _of(reproduction.rows, id=published.id)]
        for name in sorted(by_solver[0].keys() - {"printed"}):
            values = [published.printed, *(beside.get(name) for beside in by_solver)]
            numbers = [format_number(value, published.unit) for value in values]
            lines.append([f"`{published.id}`", name.replace("_", " "), *numbers])
    return markdown_table(["row", "reading", "in print", *(f"solver {solver}" for solver in solvers)], lines)


def _shape(reproduction: Reproduction, claim_id: str, figures: bool) -> str:
    """Return a paragraph on a claim about shape, with the verdict of each solver; if all agree, with the
    evidence of the last."""
    entries = _of(reproduction.shapes, id=claim_id)
    first = entries[0]
    lines = [f"**`{claim_id}`**: {first['claim']}"]
    if first["reading"]:
        lines.append(f"- Reading: {first['reading']}.")
    agree = len({(entry["holds"], entry["used"]) for entry in entries}) == 1
    for e in entries[-1:] if agree else entries:
        verdict = "holds" if e["holds"] else "does not hold"
        read_as = f", read as '{e['used']}'" if e["used"] else ""
        who = f"All solvers: **{verdict}**{read_as}. With" if agree else "Solver"
        end = ":" if agree else f": **{verdict}**{read_as}."
        lines.append(f"- {who} `{e['solver']}`{end} {e['evidence']}.")
    if figures:
        lines.append(f"- Picture: [{first['figure']}]({first['figure']})")
    return "\n".join(lines)


def _definitions(reproduction: Reproduction, solver: str) -> str:
    """Return a list of the rows' definitions and readings, which are the same for all solvers."""
    lines = []
    for row in _of(reproduction.rows, solver=solver):
        reading = f" Reading: {row['reading']}." if row["reading"] else ""
        lines.append(f"- `{row['id']}`: {row['definition']}.{reading}")
    return "\n".join(lines)


def listed(items: Iterable[str], last: str = "and") -> str:
    """Join items as 'a', 'a and b' or 'a, b and c'; return 'none' without items."""
    *first, end = list(items) or ["none"]
    return f"{', '.join(first)} {last} {end}" if first else end


def which_beta(reproduction: Reproduction) -> dict[str, str]:
    """Return texts on the effect of both readings of beta in this run, by the names in the template."""
    published = reproduction.published
    alpha = published.parameters["baumgarte_alpha"]
    by_name = betas(published)
    seconds = published.parameters["duration_s"]
    roots = {name: slowest_root(alpha, beta) for name, beta in by_name.items()}
    drifts = {name: largest_drift(reproduction, solver) for solver, name in EULER.items()}
    judged = {
        name: [row["within_bar"] for row in _of(reproduction.rows, solver=solver, spared="")]
        for solver, name in EULER.items()
    }
    met = [name for name, verdicts in judged.items() if all(verdicts)]
    return {
        "printed_beta": f"{by_name['printed']:.2f}",
        "probable_beta": f"{by_name['probable']:.1f}",
        "damping": f"{alpha / by_name['probable']:.2f}",
        "duration": f"{seconds:g}",
        "decay": listed(
            f"{root:.2f} 1/s ({name} β; {100 * math.exp(root * seconds):.2g} % of an error is left at the "
            "end)"
            for name, root in roots.items()
        ),
        "drift": listed(
            f"{1e3 * a:.2f} mm, {1e3 * b:.2f} mm in stance ({name} β)," for name, (a, b) in drifts.items()
        ),
        "within": listed(f"{sum(rows)} of {len(rows)} ({name} β)" for name, rows in judged.items()),
        # Both readings of beta share the leg, so that zero, one or both can meet all rows.
        "verdict": {
            0: "This leg meets all of these with neither",
            1: f"This leg meets all of these with the {met[0] if met else ''} β only",
            2: "This leg meets all of these with both",
        }[len(met)],
    }


def largest_drift(reproduction: Reproduction, solver: str) -> tuple[float, float]:
    """Return the largest distances of toe or heel from the exact motion over all gaits [m], in the cycle and
    in stance."""
    cycle = []
    stance = []
    for gait in {gait for gait, _, _ in reproduction.traces}:
        trace = reproduction.traces[gait, "elastic", solver]
        exact = reproduction.traces[gait, "elastic", EXACT]
        error = hoof_error(trace, exact)
        # The exact stance for all solvers: drift would move the contacts of an inexact one.
        on_ground = measure_stance(exact)
        inside = (trace["time"] >= on_ground.start) & (trace["time"] <= on_ground.end)
        cycle.append(float(error.max()))
        stance.append(float(error[inside].max()))
    return max(cycle), max(stance)
