"""Cost of a change: the speed of the work tree compared with another commit's, on this machine.

    python -m benchmarks.compare --base COMMIT            about three minutes
    python -m benchmarks.compare --base COMMIT --first    what a user waits for; some minutes a round

Each round runs one whole process of either commit, in changing order, under the same Python. Each commit has
the packages that its own constraints.txt names; `scripts/environments.py` finds or makes an environment for
each, under runs/environments. NumPy must be the same version in both. A process times the cases of
`compare_cases.py` in processor time; a ratio is the work tree's speed over the base's in one round, above 1
if the work tree is faster. Exits with 1 if a median is below 0.95, and with 2 where the commits cannot be
compared.

With `--first` the cases come from `compare_first.py` instead: processor seconds of imports, first steps,
an edited reward term and `hoof-env reproduce`, with empty caches and with full ones.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import io
import json
import os
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import compare_first
from benchmarks.compare_first import Side
from benchmarks.rounds import describe, spread
from hoof_env._output import markdown_table
from scripts.environments import HASHES, NEEDED, NoEnvironment, environments

ROOT = Path(__file__).resolve().parents[1]
CASES = Path(__file__).with_name("compare_cases.py")
KEPT = ROOT / "runs" / "compare"
"""Folder of the checkouts of bases, kept so that their kernels are compiled once."""

LOWEST = 0.95  # least median ratio
RUNS = 15  # runs of each case in a process
ROUNDS = 11
FIRST_ROUNDS = 3  # with --first


def checkout(commit: str) -> Path:
    """Return a folder with the package as it was at a commit, and the files that say what it depends on.

    Raises:
        ValueError: there is no such commit, or it lacks one of the files.
    """
    ask = ["git", "rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}"]
    done = subprocess.run(ask, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f"expected a commit of this repository, got {commit!r}")
    commit = done.stdout.strip()
    tree = KEPT / commit[:12]
    if not all((tree / name).exists() for name in NEEDED):
        listed = ["git", "ls-tree", "--name-only", commit, "hoof_env", *NEEDED, HASHES]
        names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
        if missing := [name for name in NEEDED if name not in names]:
            raise ValueError(f"expected a commit with {' and '.join(missing)}, got {commit[:12]} without")
        archive = ["git", "archive", commit, *names]
        packed = subprocess.run(archive, cwd=ROOT, capture_output=True, check=True).stdout
        with tarfile.open(fileobj=io.BytesIO(packed)) as files:
            safely: dict[str, Any] = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
            files.extractall(part := tree.with_suffix(".part"), **safely)  # Python 3.11.2 has no filters
        # A checkout that was interrupted keeps its other name and is made again, as is one without `NEEDED`
        shutil.rmtree(tree, ignore_errors=True)
        part.rename(tree)
    return tree


def run_cases(
    tree: Path, python: str = sys.executable, runs: int = RUNS, share: float = 1.0
) -> dict[str, float]:
    """Return the processor time [s] of each case, timed `runs` times in a process of an interpreter that
    takes the package from `tree`; of a run's steps a share is taken.

    Raises:
        RuntimeError: the process took the package from elsewhere.
    """
    # The package of this tree, whichever is installed
    settings = {"PYTHONPATH": str(tree), "HOOF_ENV_QUIET": "1"}
    # -P: without the modules of the script's folder
    command = [python, "-P", str(CASES), str(runs), str(share)]
    done = subprocess.run(command, cwd=tree, env=os.environ | settings, stdout=subprocess.PIPE, check=True)
    result = json.loads(done.stdout)
    if not Path(result["package"]).is_relative_to(tree):
        raise RuntimeError(f"expected hoof_env in {tree}, got {result['package']}")
    return dict(result["seconds"])


def compare(base: Side, now: Side, rounds: int) -> dict[str, list[float]]:
    """Return ratios of speed, `now` over `base`, by case, one a round; a round before them compiles and warms
    up."""
    sides = {"base": base, "now": now}
    order = np.random.default_rng(0)
    ratios: dict[str, list[float]] = {}
    # By turns, so that what else the machine does slows both commits alike
    for k in range(rounds + 1):
        seconds = {name: run_cases(*sides[name]) for name in order.permutation(list(sides))}
        for case, spent in seconds["now"].items() if k else ():
            ratios.setdefault(case, []).append(seconds["base"][case] / spent)
        print(f"\r{k} of {rounds} rounds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return ratios


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; see `--help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compare", description=__doc__.splitlines()[0])
    parser.add_argument("--base", required=True, help="commit to compare with")
    parser.add_argument("--rounds", type=int, help=f"{ROUNDS} if not given, with --first {FIRST_ROUNDS}")
    parser.add_argument("--first", action="store_true", help="what a user waits for, in processor seconds")
    args = parser.parse_args(arguments)
    try:
        base = checkout(args.base)
        before, after = environments(base, ROOT, compare_first.EXTRAS if args.first else ())
    except ValueError as error:
        parser.error(f"--base: {error}")
    except NoEnvironment as error:
        parser.error(str(error))
    sides: tuple[Side, Side] = ((base, before.python), (ROOT, after.python))
    if args.first:
        seconds = compare_first.compare(*sides, args.rounds or FIRST_ROUNDS)
        print(compare_first.table(seconds, base.name))
        return 0
    spreads = {case: spread(np.array(r)) for case, r in compare(*sides, args.rounds or ROUNDS).items()}
    slower = {case for case, s in spreads.items() if s["median"] < LOWEST}
    rows = [[case, describe(s), "slower" if case in slower else ""] for case, s in spreads.items()]
    print(markdown_table(["case", f"speed over {base.name}'s", f"below {LOWEST}"], rows))
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
