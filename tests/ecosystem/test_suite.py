"""The suite itself: its files; a failure is told and stops nothing; what never ends is ended."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.ecosystem import run
from tests.ecosystem.table import count_tests, markdown, verdict

PROGRAM = '''
import time
import pytest

@pytest.mark.parametrize("case", ["a", "b"])
def test_good(case):
    """Passes."""

def test_bad():
    """Fails."""
    raise ValueError("no | such leg")

def test_skipped():
    """Skips."""
    pytest.skip("not yet")

def test_endless():
    """Never ends."""
    time.sleep(WAIT)
'''


@pytest.fixture
def check(tmp_path, monkeypatch):
    """Return a function that runs a check whose last test sleeps [s], within some seconds."""
    monkeypatch.setattr(run, "LOGS", tmp_path)
    monkeypatch.setattr(run, "CHECKOUT_FOLDER", tmp_path)
    (tmp_path / "pytest.ini").touch()

    def run_sample(sleeps, seconds):
        (tmp_path / "check_sample.py").write_text(PROGRAM.replace("WAIT", str(sleeps)))
        return run.check("check_sample", libraries=["gymnasium"], seconds=seconds)

    return run_sample


def test_a_failure_is_reported_and_does_not_stop_the_rest(check):
    result = check(sleeps=0, seconds=300)
    good, told = verdict(result)
    assert not good
    assert told.startswith("3 passed, 1 skipped, 1 failed in ")
    page = markdown([result], [(["gymnasium"], "Mind the gap.")]).splitlines()
    version = subprocess.check_output([sys.executable, "-c", run.VERSIONS, "gymnasium"], text=True).split()[1]
    rows = [row.rsplit(" | ", 2)[0] for row in page if row.startswith("| gymnasium")]
    assert rows == [
        f"| gymnasium | {version} | Passes | 2 passed",
        f"| gymnasium | {version} | Fails | **1 failed (ValueError: no / such leg)**",
        f"| gymnasium | {version} | Skips | 1 skipped (not yet)",
        f"| gymnasium | {version} | Never ends | 1 passed",
    ]
    assert page[-1] == "* **gymnasium**: Mind the gap."


def test_an_endless_test_is_ended_and_earlier_results_stay(check):
    # As long as this machine needs for the tests that end, and some more
    limit = round(2 + 4 * check(sleeps=0, seconds=300)["seconds"])
    result = check(sleeps=600, seconds=limit)
    good, told = verdict(result)
    assert not good
    assert told.endswith(f"stopped after {limit} s")
    assert told.startswith("2 passed, 1 skipped, 1 failed")
    assert len(result["tests"]) == 3
    assert f"**stopped after {limit} s**" in markdown([result], [])


def test_a_check_whose_library_is_missing_fails():
    result = run.check("test_gymnasium", libraries=["no-such-library"], seconds=1)
    assert not verdict(result)[0]
    assert "no-such-library" in markdown([json.loads(json.dumps(result))], [])


def test_a_check_in_which_no_test_runs_fails():
    skipped = {"what": "", "case": "", "outcome": "skipped", "reason": "", "seconds": 0.0}
    assert not verdict({"tests": count_tests([skipped]), "ended": "", "seconds": 1.0})[0]


def rows(page):
    """Lines of the tables of a page."""
    return [line for line in page.splitlines() if line.startswith("|")]


def test_the_tables_of_the_page_agree_with_the_stored_results():
    stored = json.loads(run.RESULTS.read_text())
    assert list(stored) == list(run.SUITE["check"])
    assert rows(run.PAGE.read_text()) == rows(run.page(stored))
    assert len(rows(run.page(stored))) > len(stored)


def test_every_check_has_its_file_and_every_file_its_check():
    files = {
        path.stem
        for path in Path(__file__).parent.rglob("*_*.py")
        if path.stem.split("_")[0] in ("check", "test")
    }
    assert files - {"test_suite"} == set(run.SUITE["check"])
    assert {check["venv"] for check in run.SUITE["check"].values() if "venv" in check} == set(run.VENVS)
