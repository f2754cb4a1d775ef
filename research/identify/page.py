"""The page of a search: what it found, how good that is, and how often it got there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hoof_env.paper.report import format_error, format_number
from hoof_env.paper.reproduce import SOLVERS
from hoof_env.paper.rows import ILL
from research.identify.confirm import Confirmation


def describe_choice(choice: Mapping[str, Any]) -> str:
    """A choice in words, without the signs of its dyads."""
    travel = "+x" if choice["travel"] > 0 else "-x"
    return f"link 9 to {choice['link9']}, swing {choice['swing']}, toe {choice['toe']}, travels {travel}"


def page(data: Mapping[str, Any], confirmation: Confirmation | None) -> str:
    """The whole page from what `report.write_results` puts into `identify.json`."""
    parts = [
        "# The leg that the paper does not print, identified",
        _origin(data),
        _verdict(data, confirmation),
    ]
    if confirmation is not None:
        claims = (
            f"- `{c['id']}`, solver `{c['solver']}`: **{'holds' if c['holds'] else 'does not hold'}**. "
            f"{c['evidence']}."
            for c in data["claims"]
        )
        parts += [
            "## Targets beside simulated",
            "By the full system. Errors are in the measure of the bar; ✗ marks a row outside its bar, † an "
            "inelastic walking row with the paper's solver: these are ill-conditioned and have no bar.",
            _rows_table(confirmation),
            "## Claims",
            "\n".join(claims),
            "## Plausibility",
            "What the search demands beside the rows, in m, s, deg or parts of one.",
            _table(
                ["demand", "bound", "exact solver", "paper's solver", "why"],
                (
                    [f"`{d['name']}`", d["bound"], _number(d["exact"]), _number(d["paper"]), d["why"]]
                    for d in data["plausibility"]
                ),
            ),
        ]
    return "\n\n".join([*parts, *_starts(data)]) + "\n"


def _origin(data: Mapping[str, Any]) -> str:
    search = data["search"]
    used = ", ".join(f"{name} {number}" for name, number in search["versions"].items())
    return (
        f"Written by `{search['command']}` with {used}; start {search['start']}, targets "
        f"{search['targets']}. {data['evaluations']} evaluations, those with the paper's solver by their "
        f"weight; {data['wall_s']:.0f} s since the search was begun or last resumed; its jobs took "
        f"{data['job_s']:.0f} s in all."
    )


def _verdict(data: Mapping[str, Any], confirmation: Confirmation | None) -> str:
    if confirmation is None:
        return "**No candidate was found that the full system can simulate.**"
    counted, others = (
        ", ".join(
            "{1} of {2} rows within their bars with solver `{0}`".format(solver, *confirmation.within(solver))
            for solver in SOLVERS
            if (solver in confirmation.counted) == wanted
        )
        for wanted in (True, False)
    )
    if confirmation.holds:
        return f"**The bar is met**: {counted}, every required claim true. It does not ask for: {others}."
    missing = ", ".join(f"`{name}` ({solver})" for name, solver in confirmation.outside + confirmation.untrue)
    return f"**The bar is not met**: {counted}. It does not ask for: {others}. Missing: {missing}."


def _rows_table(confirmation: Confirmation) -> str:
    run = confirmation.reproduction
    of = {(row["id"], row["solver"]): row for row in run.rows}
    lines = []
    for aim in run.published.rows:
        line = [f"`{aim.id}`", aim.unit, format_number(aim.value, aim.unit), aim.bar_text]
        for solver in SOLVERS:
            row = of[aim.id, solver]
            mark = " ✗" if row["within_bar"] is False else " †" if row["spared"] == ILL else ""
            line += [format_number(row["simulated"], aim.unit), format_error(row, run) + mark]
        lines.append(line)
    head = ["row", "unit", "target", "bar"]
    return _table(head + [text for solver in SOLVERS for text in (f"solver {solver}", "error")], lines)


def _starts(data: Mapping[str, Any]) -> list[str]:
    reached = {key: sum(s[key] for s in data["starts"]) for key in ("exact", "both", "confirmed")}
    choices = (
        [c["choice"], *(str(c[key]) for key in ("starts", *reached)), f"{c['error']:.2f}"]
        for c in data["counts"]
    )
    lines = (
        [
            f"{s['root']} ({s['start']})",
            describe_choice(s["choice"]),
            "".join("+" if sign > 0 else "-" for sign in s["choice"]["assembly"]),
            *(str(s[key]) for key in ("jobs", "evaluations")),
            f"{s['seconds']:.0f}",
            f"{s['error']:.2f}",
            next((name for name in ("confirmed", "both", "exact") if s[name]), "-"),
        ]
        for s in data["starts"]
    )
    return [
        "## Starts that reached the bar, by choice",
        f"Of {len(data['starts'])} independent starts {reached['exact']} reached every bar with the exact "
        f"solver, {reached['both']} with both, and the full system confirmed {reached['confirmed']}. A "
        "search ends at the first confirmed candidate unless told to keep going.",
        _table(["choice", "starts", "exact", "both", "confirmed", "lowest error [bars]"], choices),
        "## Independent starts",
        "A start counts with all jobs that refined what it found; its error is that of the worst row with "
        "the exact solver alone, and 2 more for a shortage of one.",
        _table(
            ["start", "choice", "assembly", "jobs", "evaluations", "s", "lowest error [bars]", "reached"],
            lines,
        ),
    ]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _table(head: list[str], rows: Iterable[list[str]]) -> str:
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *rows))
