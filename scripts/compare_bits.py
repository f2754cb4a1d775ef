"""Compare what two commits compute, bit by bit, on this machine.

    python scripts/compare_bits.py --base COMMIT                   everything, some twenty minutes
    python scripts/compare_bits.py --base COMMIT --parts environments engines

Both commits run under the same Python, one after the other, each from a checkout of its own: bits differ
between machines, so digests that were written elsewhere say nothing. Digests of the base are kept in
runs/bits and are taken again only when the machine, the Python packages or the cases have changed.
Exits with 1 where any digest differs, and names it.

What is digested is in bits_cases.py and bits_engines.py, what must be refused in bits_refusals.py. Every
quantity has a digest of its own; renamed.toml says which were renamed since the base, and which are meant to
differ.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from bits_cases import PARTS, Cases, add_own_task
from bits_digest import Digests, as_bytes
from bits_refusals import refusals

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
KEPT = ROOT / "runs" / "bits"
CASES = ("bits_cases.py", "bits_digest.py", "bits_engines.py", "bits_refusals.py")

Found = dict[str, str]
"""Digests by name; of a refusal its words."""


@dataclass(frozen=True)
class Renamed:
    """What renamed.toml says.

    Attributes:
        keys: new names of quantities by their old ones.
        words: new words of messages by their old ones.
        code: old names of what the cases call by their new ones.
        intended: reasons of digests that are meant to differ, by a pattern of their names.
    """

    keys: Mapping[str, str]
    words: Mapping[str, str]
    code: Mapping[str, str]
    intended: Mapping[str, str]

    @classmethod
    def read(cls) -> Renamed:
        """Read renamed.toml."""
        tables = tomllib.loads((HERE / "renamed.toml").read_text())
        return cls(**{name: tables.get(name, {}) for name in ("keys", "words", "code", "intended")})

    def key(self, name: str) -> str:
        """The name that a digest of the base has now."""
        part, _, rest = name.partition(": ")
        case, _, path = rest.rpartition(" | ")
        parts = [self._part(word) for word in path.split(".")]
        return f"{part}: {case} | {'.'.join(parts)}"

    def _part(self, word: str) -> str:
        """One part of a dotted name, perhaps with a horse's leg before it."""
        leg = re.match(r"((left|right)_(fore|hind)_)?", word)
        before = leg[0] if leg else ""
        rest = word.removeprefix(before)
        return before + self.keys.get(rest, rest)

    def text(self, words: str) -> str:
        """A message of the base in the words of now."""
        for old, new in self.words.items():
            words = re.sub(rf"(?<![\w-]){re.escape(old)}(?![\w-])", new, words)
        return words


def refused() -> Iterator[tuple[str, str]]:
    """What each case of bad input is answered with."""
    for name, attempt in refusals():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                attempt()
            except (Exception, SystemExit) as error:
                words = re.sub(r" at 0x[0-9a-f]+", "", f"{type(error).__name__}: {error}")
                yield f"{name} | refused", words
            else:
                yield f"{name} | refused", "accepted"


def digests_of_part(part: str) -> Found:
    """Digests of a part, of the package that can be imported here."""
    found: Found = {}
    if part == "refusals":
        found = dict(refused())
    else:
        cases: Callable[[], Cases] = PARTS[part]
        for case, digests in cases():
            found |= {f"{case} | {name}": value for name, value in digests.results().items()}
    return {f"{part}: {name}": value for name, value in found.items()}


# Running both commits


def digests_of(tree: Path, part: str, code: Mapping[str, str]) -> Found:
    """Digests of the commit that is checked out in `tree`, from a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "digests.json"
        run = [
            sys.executable,
            __file__,
            "--write",
            str(out),
            "--code",
            json.dumps(dict(code)),
            "--parts",
            part,
        ]
        subprocess.run(run, cwd=tree, env=environment, check=True)
        found: Found = json.loads(out.read_text())
    return found


@contextmanager
def checkout(commit: str) -> Iterator[Path]:
    """A temporary work tree of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "base"
        subprocess.run(["git", "worktree", "add", "-q", "--detach", tree, commit], cwd=ROOT, check=True)
        try:
            yield tree
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)


def base_digests(commit: str, parts: list[str], renamed: Renamed) -> Found:
    """Digests of the base, part by part, kept for the next comparison on this machine."""
    packages = sorted(f"{d.metadata['Name']} {d.version}" for d in metadata.distributions())
    cases = [(HERE / name).read_text() for name in CASES]
    conditions = Digests()
    conditions.add("", as_bytes([platform.processor(), platform.node(), *packages, *cases, commit]))
    kept = KEPT / f"{conditions.results()['']}.json"
    known: dict[str, Found] = json.loads(kept.read_text()) if kept.exists() else {}
    missing = [part for part in parts if part not in known]
    if missing:
        with checkout(commit) as tree:
            for part in missing:
                print(f"{commit[:10]}: {part}", flush=True)
                known[part] = digests_of(tree, part, renamed.code)
                KEPT.mkdir(parents=True, exist_ok=True)
                kept.write_text(json.dumps(known, indent=1))
    return {name: digest for part in parts for name, digest in known[part].items()}


def compare(base: Found, now: Found, renamed: Renamed) -> int:
    """Print what differs; returns how many digests do, those that are meant to not counted."""
    base = {renamed.key(name): renamed.text(value) for name, value in base.items()}
    now = dict(now)
    differing = [name for name in base if now.get(name) != base[name]]
    differing += [name for name in now if name not in base]
    meant = [name for name in differing if any(re.search(pattern, name) for pattern in renamed.intended)]
    for name in differing:
        if name not in meant:
            before, after = base.get(name, "missing"), now.get(name, "missing")
            print(f"differs: {name}: {before} before, {after} now")
    print(f"{len(base)} digests, {len(differing) - len(meant)} differ, {len(meant)} as intended")
    return len(differing) - len(meant)


def main() -> int:
    """Run the command line; returns the exit code."""
    known = (*PARTS, "refusals")
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--base", help="commit to compare with")
    parser.add_argument("--parts", nargs="+", choices=known, default=list(known))
    parser.add_argument(
        "--write", type=Path, help="write the digests of the package that is imported to a file"
    )
    parser.add_argument("--code", type=json.loads, default={}, help="names in the cases, as JSON")
    arguments = parser.parse_args()
    if arguments.write:
        add_own_task(arguments.code)
        found: dict[str, Any] = {}
        for part in arguments.parts:
            found |= digests_of_part(part)
        arguments.write.write_text(json.dumps(found))
        return 0
    if not arguments.base:
        parser.error("--base: expected a commit")
    rev = ["git", "rev-parse", "--verify", f"{arguments.base}^{{commit}}"]
    commit = subprocess.run(rev, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    renamed = Renamed.read()
    base = base_digests(commit, arguments.parts, renamed)
    now: Found = {}
    for part in arguments.parts:
        print(f"work tree: {part}", flush=True)
        now |= digests_of(ROOT, part, {})
    return 1 if compare(base, now, renamed) else 0


if __name__ == "__main__":
    sys.exit(main())
