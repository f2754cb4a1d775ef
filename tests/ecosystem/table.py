"""The acceptance table of the suite's results, for a terminal and for docs/evidence/ecosystem.md."""

from __future__ import annotations

import platform
from typing import Any

import hoof_env

HEAD = """# Libraries that take hoof-env unchanged

Written by `make test-ecosystem` ({system}, hoof-env {version}, commit {commits}). Each row is a test
of `tests/ecosystem`, through the library's own front door, on all ids that it applies to. Libraries that
do not fit together have virtual environments of their own (`tests/ecosystem/suite.toml`).

In a training script of yours call `torch.set_num_threads(1)` first, or set `OMP_NUM_THREADS=1`: torch takes
every core, and its threads spin while they wait for each other, which makes a busy machine ten to thirty
times as slow ([decisions.md](../decisions.md)).

| library | version | what was run | result | s |
|---|---|---|---|---|
"""

NOTES = """
## What to know

"""


def verdict(result: dict[str, Any]) -> tuple[bool, str]:
    """Whether a check is good, and its result in a line."""
    count = dict.fromkeys(("passed", "skipped", "failed"), 0)
    for row in result["rows"]:
        count[row["outcome"]] += 1
    told = ", ".join(f"{number} {outcome}" for outcome, number in count.items() if number)
    told += f" in {result['seconds']:.0f} s" if "seconds" in result else ""
    good = not result["ended"] and not count["failed"] and count["passed"] > 0
    return good, "; ".join(filter(None, [told, result["ended"]]))


def markdown(results: list[dict[str, Any]]) -> str:
    """The page: `HEAD`, one row for each test function of each check, and the notes."""
    commits = ", ".join(sorted({result["commit"] for result in results}))
    system = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    page = HEAD.format(system=system, version=hoof_env.__version__, commits=commits)
    page += "".join(row + "\n" for result in results for row in _rows(result))
    notes = [f"* **{', '.join(r['libraries'])}**: {r['note']}\n" for r in results if r.get("note")]
    return page + (NOTES + "".join(notes) if notes else "")


def _rows(result: dict[str, Any]) -> list[str]:
    packages = [line.split() for line in result.get("versions", [])]
    packages = packages or [[name, "-"] for name in result["libraries"]]
    head = [", ".join(column) for column in zip(*packages, strict=True)]
    tests: dict[str, list[dict[str, Any]]] = {}
    for row in result["rows"]:
        tests.setdefault(row["what"], []).append(row)
    rows = [
        [*head, what, _outcome(cases), f"{sum(r['seconds'] for r in cases):.1f}"]
        for what, cases in tests.items()
    ]
    if result["ended"]:
        rows.append([*head, "the whole check", f"**{result['ended']}**", ""])
    return [f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows]


def _outcome(cases: list[dict[str, Any]]) -> str:
    """'3 passed, 1 skipped (reason)', and the message of every failure."""
    parts = []
    for outcome in ("passed", "skipped", "failed"):
        some = [case for case in cases if case["outcome"] == outcome]
        reasons = "; ".join(sorted({case["reason"] for case in some if case["reason"]}))
        if some:
            told = f"{len(some)} {outcome}" + (f" ({reasons})" if reasons else "")
            parts.append(f"**{told}**" if outcome == "failed" else told)
    return ", ".join(parts)
