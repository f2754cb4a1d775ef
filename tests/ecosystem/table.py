"""The acceptance table of the suite's results, for a terminal and for docs/evidence/ecosystem.md."""

from __future__ import annotations

from typing import Any

HEAD = """# Libraries that take hoof-env unchanged

Written by `make test-ecosystem` ({systems}). Each row is a test of
`tests/ecosystem`, run at the commit of its last column, through the library's own front door, on all ids
that it applies to. Libraries that do not fit together have virtual environments of their own
(`tests/ecosystem/suite.toml`).

In a training script of yours call `torch.set_num_threads(1)` first, or set `OMP_NUM_THREADS=1`: torch takes
every core, and its threads spin while they wait for each other, which makes a busy machine ten to thirty
times as slow ([decisions.md](../decisions.md)).

| library | version | what was run | result | s | commit |
|---|---|---|---|---|---|
"""

OUTCOMES = ("passed", "skipped", "failed")
"""Results that a test can have."""

NOTES = """
## What to know

"""


def count_tests(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return what became of each test function: its cases by outcome, their reasons and seconds."""
    cases: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        cases.setdefault(row["what"], []).append(row)
    return [_count(what, some) for what, some in cases.items()]


def _count(what: str, cases: list[dict[str, Any]]) -> dict[str, Any]:
    counted: dict[str, Any] = {"what": what, "seconds": round(sum(case["seconds"] for case in cases), 1)}
    for outcome in OUTCOMES:
        some = [case for case in cases if case["outcome"] == outcome]
        if some:
            reasons = sorted({case["reason"] for case in some if case["reason"]})
            counted[outcome] = {"cases": len(some), "reasons": reasons}
    return counted


def verdict(result: dict[str, Any]) -> tuple[bool, str]:
    """Return whether a check is good, and its result in a line."""
    count = {
        outcome: sum(test[outcome]["cases"] for test in result["tests"] if outcome in test)
        for outcome in OUTCOMES
    }
    told = ", ".join(f"{number} {outcome}" for outcome, number in count.items() if number)
    told += f" in {result['seconds']:.0f} s" if "seconds" in result else ""
    good = not result["ended"] and not count["failed"] and count["passed"] > 0
    return good, "; ".join(filter(None, [told, result["ended"]]))


def markdown(results: list[dict[str, Any]], notes: list[tuple[list[str], str]]) -> str:
    """Return the page: `HEAD`, one row for each test function of each check, and the notes on libraries."""
    page = HEAD.format(systems="; ".join(sorted({result["system"] for result in results})))
    page += "".join(row + "\n" for result in results for row in _rows(result))
    told = "".join(f"* **{', '.join(libraries)}**: {note}\n" for libraries, note in notes)
    return page + (NOTES + told if told else "")


def _rows(result: dict[str, Any]) -> list[str]:
    packages = [line.split() for line in result.get("versions", [])]
    packages = packages or [[name, "-"] for name in result["libraries"]]
    head = [", ".join(column) for column in zip(*packages, strict=True)]
    rows = [
        [*head, test["what"], _outcome(test), f"{test['seconds']:.1f}", result["commit"]]
        for test in result["tests"]
    ]
    if result["ended"]:
        rows.append([*head, "the whole check", f"**{result['ended']}**", "", result["commit"]])
    return [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows]


def _outcome(test: dict[str, Any]) -> str:
    """Return '3 passed, 1 skipped (reason)', with the message of every failure."""
    parts = []
    for outcome in OUTCOMES:
        if outcome in test:
            reasons = "; ".join(test[outcome]["reasons"])
            told = f"{test[outcome]['cases']} {outcome}" + (f" ({reasons})" if reasons else "")
            parts.append(f"**{told}**" if outcome == "failed" else told)
    return ", ".join(parts)
