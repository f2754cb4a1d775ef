"""Every RL library takes hoof-env unchanged: `python -m tests.ecosystem.run`, or `make test-ecosystem`.

Each check of suite.toml runs in the virtual environment that it names, one after the other, whatever becomes
of those before it. Its result replaces the one in docs/evidence/ecosystem.json, from which
docs/evidence/ecosystem.md is written: after a change, the checks that it concerns can run alone.
"""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from tests.ecosystem.table import count_tests, markdown, verdict
from tests.ecosystem.venvs import CACHE, ROOT, Failed, Venv

HERE = Path(__file__).parent
SUITE = tomllib.loads((HERE / "suite.toml").read_text())
VENVS = {
    name: Venv(name, **{k: tuple(v) if isinstance(v, list) else v for k, v in table.items()})
    for name, table in SUITE["venv"].items()
}
LOGS = CACHE / "results"
CHECKOUT_FOLDER = HERE
PAGE = ROOT / "docs" / "evidence" / "ecosystem.md"
RESULTS = PAGE.with_suffix(".json")
VERSIONS = (
    "import sys, importlib.metadata as m; print(*(f'{n} {m.version(n)}' for n in sys.argv[1:]), sep='\\n')"
)


@dataclass(frozen=True)
class Args:
    only: tuple[str, ...] = ()
    """these checks alone: names of suite.toml"""
    quick: bool = False
    """the checks that need no environment but .venv"""


def main() -> int:
    args = tyro.cli(Args, prog="python -m tests.ecosystem.run", description=__doc__)
    checks: dict[str, dict[str, Any]] = SUITE["check"]
    if unknown := set(args.only) - set(checks):
        print(f"error: no check {', '.join(sorted(unknown))}; there are {', '.join(checks)}", file=sys.stderr)
        return 2
    chosen = [
        name
        for name, check in checks.items()
        if name in (args.only or checks) and not (args.quick and "venv" in check)
    ]
    failed = []
    LOGS.mkdir(parents=True, exist_ok=True)
    results: dict[str, dict[str, Any]] = json.loads(RESULTS.read_text())
    for name in chosen:
        print(f"{name:18}", end=" ", flush=True)
        results[name] = check(name, **checks[name])
        results = {name: results[name] for name in checks if name in results}
        RESULTS.write_text(json.dumps(results, indent=1).replace(f"{ROOT}/", "") + "\n")
        good, told = verdict(results[name])
        failed += [] if good else [name]
        print(told if good else f"{told}; more in .ecosystem/results/{name}.log", flush=True)
    # Also without a check, as after a change of a note
    PAGE.write_text(page(json.loads(RESULTS.read_text())))
    print("written: docs/evidence/ecosystem.md")
    print(f"failed: {', '.join(failed)}" if failed else f"all {len(chosen)} accept hoof-env")
    return 1 if failed else 0


def page(results: dict[str, dict[str, Any]]) -> str:
    """Return the page of the results of all checks."""
    checks: dict[str, dict[str, Any]] = SUITE["check"]
    notes = [(check["libraries"], check["note"].strip()) for check in checks.values() if "note" in check]
    return markdown(list(results.values()), notes)


def check(
    name: str, libraries: list[str], seconds: float, venv: str | None = None, note: str = ""
) -> dict[str, Any]:
    """Run one check and return its versions, what became of its tests, and what ended it early, if anything.

    Only the page shows `note`.
    """
    system = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    result: dict[str, Any] = {"libraries": libraries, "commit": _commit(), "system": system, "tests": []}
    place = VENVS[venv] if venv else None
    try:
        if place:
            place.prepare()
        python = str(place.python if place else sys.executable)
        asked = [python, "-c", VERSIONS, *libraries]
        told = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
        result["versions"] = told.splitlines()
    except (Failed, subprocess.CalledProcessError) as error:
        return {**result, "ended": f"not installed: {error}"}
    folder = ROOT / place.folder if place else CHECKOUT_FOLDER
    rows = LOGS / f"{name}.jsonl"
    rows.unlink(missing_ok=True)
    started = time.monotonic()
    options = ("-p", "no:cacheprovider", "-p", "record", "--record", str(rows))
    command = [python, "-m", "pytest", *options, f"{name}.py"]
    ended = _run(command, folder, seconds, LOGS / f"{name}.log")
    lines = rows.read_text().splitlines() if rows.exists() else []
    result["tests"] = count_tests([json.loads(line) for line in lines])
    result["seconds"] = round(time.monotonic() - started, 1)
    return {**result, "ended": ended or ("" if lines else "no test ran")}


def _run(command: list[str], folder: Path, seconds: float, log: Path) -> str:
    """Return what ended the command, where that was not its tests; all of its processes are ended with it."""
    paths = os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"}
    with log.open("w") as file:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            code = process.wait(seconds)
        except subprocess.TimeoutExpired:
            return f"stopped after {seconds:.0f} s"
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
    return "" if code in (0, 1) else f"pytest ended with code {code}"


def _commit() -> str:
    """Return the commit of the checkout, and whether something but the results differs from it."""
    written = [f":!{path.relative_to(ROOT)}" for path in (RESULTS, PAGE)]
    commit = _git("rev-parse", "--short=8", "HEAD") or "unknown"
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", ".", *written)
    return f"{commit}-dirty" if changed else commit


def _git(*arguments: str) -> str:
    return subprocess.run(("git", *arguments), cwd=ROOT, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
