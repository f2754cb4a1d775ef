"""Cost of a change: the speed of the work tree compared with another commit's, on this machine.

    python -m benchmarks.compare --base COMMIT            about three minutes

Each round runs one whole process of either commit, in changing order, under the same Python and packages. A
process times the cases of `compare_cases.py` in processor time; a ratio is the work tree's speed over the
base's in one round, above 1 if the work tree is faster. Exits with 1 if a median is below 0.95.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import io
import json
import os
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rounds import describe, spread
from hoof_env._output import markdown_table

ROOT = Path(__file__).resolve().parents[1]
CASES = Path(__file__).with_name("compare_cases.py")
KEPT = ROOT / "runs" / "compare"
"""Folder of the checkouts of bases, kept so that their kernels are compiled once."""

LOWEST = 0.95  # least median ratio
RUNS = 15  # runs of each case in a process


def checkout(commit: str) -> Path:
    """Return a folder with the package as it was at a commit.

    Raises:
        ValueError: there is no such commit.
    """
    ask = ["git", "rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}"]
    done = subprocess.run(ask, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f"expected a commit of this repository, got {commit!r}")
    tree = KEPT / done.stdout.strip()[:12]
    if not tree.exists():
        archive = ["git", "archive", done.stdout.strip(), "hoof_env"]
        packed = subprocess.run(archive, cwd=ROOT, capture_output=True, check=True).stdout
        with tarfile.open(fileobj=io.BytesIO(packed)) as files:
            safely: dict[str, Any] = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
            files.extractall(part := tree.with_suffix(".part"), **safely)  # Python 3.11.2 has no filters
        # A checkout that was interrupted keeps its other name and is made again
        part.rename(tree)
    return tree


def run_cases(tree: Path, runs: int = RUNS, share: float = 1.0) -> dict[str, float]:
    """Return the processor time [s] of each case, timed `runs` times in a process that takes the package from
    `tree`; of a run's steps a share is taken.

    Raises:
        RuntimeError: the process took the package from elsewhere.
    """
    # The package of this tree, whichever is installed
    settings = {"PYTHONPATH": str(tree), "HOOF_ENV_QUIET": "1"}
    # -P: without the modules of the script's folder
    command = [sys.executable, "-P", str(CASES), str(runs), str(share)]
    done = subprocess.run(command, cwd=tree, env=os.environ | settings, stdout=subprocess.PIPE, check=True)
    result = json.loads(done.stdout)
    if not Path(result["package"]).is_relative_to(tree):
        raise RuntimeError(f"expected hoof_env of {tree}, got that of {result['package']}")
    return dict(result["seconds"])


def compare(base: Path, now: Path, rounds: int) -> dict[str, list[float]]:
    """Return ratios of speed, `now` over `base`, by case, one a round; a round before them compiles and warms
    up."""
    trees = {"base": base, "now": now}
    order = np.random.default_rng(0)
    ratios: dict[str, list[float]] = {}
    # By turns, so that what else the machine does slows both commits alike
    for k in range(rounds + 1):
        seconds = {name: run_cases(trees[name]) for name in order.permutation(list(trees))}
        for case, spent in seconds["now"].items() if k else ():
            ratios.setdefault(case, []).append(seconds["base"][case] / spent)
        print(f"\r{k} of {rounds} rounds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return ratios


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; see `--help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compare", description=__doc__.splitlines()[0])
    parser.add_argument("--base", required=True, help="commit to compare with")
    parser.add_argument("--rounds", type=int, default=11)
    args = parser.parse_args(arguments)
    try:
        base = checkout(args.base)
    except ValueError as error:
        parser.error(f"--base: {error}")
    spreads = {case: spread(np.array(r)) for case, r in compare(base, ROOT, args.rounds).items()}
    slower = {case for case, s in spreads.items() if s["median"] < LOWEST}
    rows = [[case, describe(s), "slower" if case in slower else ""] for case, s in spreads.items()]
    print(markdown_table(["case", f"speed over that of {base.name}", f"below {LOWEST}"], rows))
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
