"""A pytest plugin: with `--record FILE` every test adds a line of JSON to that file when it has ended."""

from __future__ import annotations

import json
from collections.abc import Generator
from pathlib import Path

import pytest

SECONDS = pytest.StashKey[float]()
OUTCOME = pytest.StashKey[tuple[str, str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--record", type=Path, required=True, help="file for one line of JSON per test")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Function, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    item.stash[SECONDS] = item.stash.get(SECONDS, 0.0) + report.duration
    if report.outcome != "passed":
        item.stash[OUTCOME] = (report.outcome, _reason(report, call))
    if report.when == "teardown":
        outcome, reason = item.stash.get(OUTCOME, ("passed", ""))
        line = {
            "what": (item.function.__doc__ or item.name).splitlines()[0].rstrip("."),
            "case": item.name.partition("[")[2].rstrip("]"),
            "outcome": outcome,
            "reason": reason,
            "seconds": round(item.stash[SECONDS], 2),
        }
        with item.config.getoption("record").open("a") as file:
            file.write(json.dumps(line) + "\n")
    return report


def _reason(report: pytest.TestReport, call: pytest.CallInfo[None]) -> str:
    if isinstance(report.longrepr, tuple):  # file, line, why it was skipped
        return report.longrepr[2].removeprefix("Skipped: ")
    error = call.excinfo.value if call.excinfo else None
    said = str(error).strip().splitlines()
    return f"{type(error).__name__}: {said[0] if said else ''}"
