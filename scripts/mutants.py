"""Break the package in sixty places, one at a time, and see what its tests notice.

    python scripts/mutants.py                       sixty places, about two hours; can be interrupted
    python scripts/mutants.py --count 5 --seed 3    five others
    python scripts/mutants.py --list                the places alone

A place is drawn at random among all arithmetic, comparisons, numbers and conditions of hoof_env. Each mutant
runs in a checkout of its own the tests of its room, `tests/<room>`, up to the first failure; for a room
without tests of its own, the tests of the commands and `tests/test_<module>.py`. If they pass, `tests/envs`
follows. Mutants that no test notices are listed at the end: some of them compute the same.
"""

from __future__ import annotations

import argparse
import ast
import csv
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "runs" / "mutants"
COLUMNS = ("file", "line", "before", "after", "noticed", "by", "seconds")
LONGEST = 1800.0
"""Seconds that tests of a mutant may take; one that hangs is noticed."""

ARITHMETIC: dict[type[ast.operator], str] = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Pow: "*", ast.Mod: "+"
}  # fmt: skip
COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A change of one line.

    Attributes:
        file: path from the root.
        line: from 1.
        before, after: the whole line.
    """

    file: str
    line: int
    before: str
    after: str


def mutants_of(path: Path) -> Iterator[Mutant]:
    """All mutants of a file whose change is within one line."""
    text = path.read_text()
    lines = text.splitlines()
    # One tree for both: the nodes of a second one could have the identities of the first
    nodes = list(ast.walk(ast.parse(text)))
    skipped = {id(inner) for node in nodes for inner in _not_run(node)}
    for node in nodes:
        found = _changed(node, lines)
        if found is None or id(node) in skipped:
            continue
        line, start, end, new = found
        before = lines[line - 1]
        after = before[:start] + new + before[end:]
        if after != before:
            yield Mutant(str(path.relative_to(ROOT)), line, before.strip(), after.strip())


def _not_run(node: ast.AST) -> Iterator[ast.AST]:
    """What is in annotations."""
    if isinstance(node, ast.AnnAssign):
        yield from ast.walk(node.annotation)
    if isinstance(node, ast.arg) and node.annotation:
        yield from ast.walk(node.annotation)


def _changed(node: ast.AST, lines: list[str]) -> tuple[int, int, int, str] | None:
    """Line, first and last column and new text of a change of a node, or None."""
    if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
        return _between(node.left, node.right, ARITHMETIC[type(node.op)], lines)
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        return _between(node.left, node.comparators[0], COMPARISONS[type(node.ops[0])], lines)
    if isinstance(node, ast.BoolOp) and len(node.values) == 2:
        other = "or" if isinstance(node.op, ast.And) else "and"
        return _between(node.values[0], node.values[1], other, lines)
    is_number = isinstance(node, ast.Constant) and type(node.value) in (int, float)
    if is_number and node.lineno == node.end_lineno:
        changed = node.value + 1 if node.value in (0, 1) else node.value * 1.1
        new = repr(int(node.value) + 1 if isinstance(node.value, int) else changed)
        return node.lineno, node.col_offset, node.end_col_offset or 0, new
    return None


def _between(left: ast.expr, right: ast.expr, new: str, lines: list[str]) -> tuple[int, int, int, str] | None:
    """A change of the operator between two operands on one line."""
    if left.end_lineno != right.lineno or left.end_col_offset is None:
        return None
    gap = lines[right.lineno - 1][left.end_col_offset : right.col_offset]
    if not gap.isascii() or any(sign in gap for sign in "()#"):
        return None
    return right.lineno, left.end_col_offset, right.col_offset, f" {new} "


def draw(count: int, seed: int) -> list[Mutant]:
    """Some mutants of the package at random, always the same for a seed and a commit."""
    files = sorted((ROOT / "hoof_env").rglob("*.py"))
    every = [mutant for path in files for mutant in mutants_of(path)]
    return random.Random(seed).sample(every, count)


def tests_of(file: str) -> list[list[str]]:
    """Arguments of pytest, one list after the other, for a file of the package."""
    room = Path(file).parts[1].removesuffix(".py")
    own = Path("tests") / room
    stem = Path(file).stem.lstrip("_")
    single = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests").glob(f"test_{stem}.py"))
    several = dict.fromkeys([*single, "tests/test_cli.py", "tests/test_export.py"])
    first = [str(own)] if (ROOT / own).is_dir() else [*several]
    rest = ["tests/envs"]
    return [first] if first == rest else [first, rest]


def is_noticed(tree: Path, mutant: Mutant) -> str:
    """The test that fails on a mutant; empty if none does."""
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    for tests in tests_of(mutant.file):
        run = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--no-header", *tests]
        try:
            done = subprocess.run(
                run, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST
            )
        except subprocess.TimeoutExpired:
            return "takes too long"
        if done.returncode:
            failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
            return failed[0].split(" - ")[0] if failed else f"exit {done.returncode}"
    return ""


def try_out(tree: Path, mutant: Mutant) -> dict[str, object]:
    """The row of a mutant."""
    path = tree / mutant.file
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    lines[mutant.line - 1] = lines[mutant.line - 1].replace(mutant.before, mutant.after)
    path.write_text("".join(lines))
    began = time.monotonic()
    try:
        by = is_noticed(tree, mutant)
    finally:
        path.write_text(text)
    row = {**vars(mutant), "noticed": int(bool(by)), "by": by, "seconds": round(time.monotonic() - began)}
    return {name: row[name] for name in COLUMNS}


def main() -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--list", action="store_true", help="print the places and run nothing")
    arguments = parser.parse_args()
    drawn = draw(arguments.count, arguments.seed)
    if arguments.list:
        for mutant in drawn:
            print(f"{mutant.file}:{mutant.line}: {mutant.before}  ->  {mutant.after}")
        return 0
    head = ["git", "rev-parse", "--short=12", "HEAD"]
    commit = subprocess.run(head, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    OUT.mkdir(parents=True, exist_ok=True)
    out = OUT / f"{commit}-{arguments.seed}.csv"
    rows: list[dict[str, object]] = []
    if out.exists():
        with out.open(newline="") as file:
            rows = list(csv.DictReader(file))
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "-q", "--detach", tree, commit], cwd=ROOT, check=True)
        try:
            for mutant in drawn[len(rows) :]:
                rows.append(try_out(tree, mutant))
                with out.open("w", newline="") as file:
                    writer = csv.DictWriter(file, COLUMNS)
                    writer.writeheader()
                    writer.writerows(rows)
                said = rows[-1]["by"] or "NOT NOTICED"
                print(f"{len(rows)}/{len(drawn)} {mutant.file}:{mutant.line}: {said}", flush=True)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)
    noticed = sum(int(row["noticed"]) for row in rows)  # type: ignore[call-overload]
    print(f"{noticed} of {len(rows)} noticed; {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
