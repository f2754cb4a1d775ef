"""Compare what two commits compute, bit by bit, on this machine.

    python scripts/compare_bits.py --base COMMIT                   everything, some twenty minutes
    python scripts/compare_bits.py --base COMMIT --parts environments engines

Both commits run under the same Python, one after the other, each from a checkout of its own and with the
packages that its own constraints.txt names: environments.py finds or makes an environment for each, under
runs/environments. Only NumPy must be the same version, because its bits differ. They differ between machines,
too, so digests that were written elsewhere say nothing. Digests of the base are kept in runs/bits and are
taken again only when the machine, the base's environment or the cases have changed. Exits with 1 where any
digest differs, and names it, and with 2 where the commits cannot be compared.

What is digested is in bits_cases.py and bits_engines.py, what must be refused in bits_refusals.py. Every
quantity has a digest of its own; renamed.toml says which were renamed since the base, and which are meant to
differ. A refusal is compared by its words.
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
from pathlib import Path
from typing import Any

from bits_cases import PARTS, Cases, add_own_task
from bits_digest import Digests, as_bytes
from bits_refusals import refusals
from environments import Environment, NoEnvironment, environments

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
KEPT = ROOT / "runs" / "bits"
CASES = ("bits_cases.py", "bits_digest.py", "bits_engines.py", "bits_refusals.py")

EXTRAS = {
    "sb3": ("train",),
    "training": ("train",),
    "files": ("render", "export", "lab"),
    "refusals": ("train", "render", "export", "lab", "video"),
}
"""Extras of the package that a part imports; other parts need none."""

Found = dict[str, str]
"""Digests by name; of a refusal its words."""


@dataclass(frozen=True)
class Renamed:
    """What renamed.toml says.

    Attributes:
        keys: new names of quantities by their old ones.
        words: new words of messages by their old ones.
        code: old names of what the cases call by their new ones.
        intended: reasons of digests that are meant to differ, by a pattern of their names, and of a refusal
            by one of its words before or now.
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

    def reason(self, name: str, before: str, now: str) -> str | None:
        """The reason why a digest is meant to differ; None if it is not."""
        texts = (name, before, now) if name.startswith("refusals: ") else (name,)
        for pattern, reason in self.intended.items():
            if any(re.search(pattern, text) for text in texts):
                return reason
        return None


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


def digests_of(tree: Path, part: str, code: Mapping[str, str], python: str) -> Found:
    """Digests of the commit that is checked out in `tree`, from a process of its own under an interpreter."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "digests.json"
        run = [
            python,
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


def kept_file(commit: str, environment: Environment) -> Path:
    """The file of a base's digests on this machine, with these cases, in an environment."""
    cases = [(HERE / name).read_text() for name in CASES]
    machine = [platform.processor(), platform.node()]
    conditions = Digests()
    conditions.add("", as_bytes([*machine, environment.key, environment.python, *cases, commit]))
    return KEPT / f"{conditions.results()['']}.json"


def base_digests(commit: str, tree: Path, parts: Mapping[str, Environment], code: Mapping[str, str]) -> Found:
    """Digests of the base that is checked out in `tree`, part by part, kept for the next comparison on this
    machine."""
    found: Found = {}
    for part, environment in parts.items():
        kept = kept_file(commit, environment)
        known: dict[str, Found] = json.loads(kept.read_text()) if kept.exists() else {}
        if part not in known:
            print(f"{commit[:10]}: {part}", flush=True)
            known[part] = digests_of(tree, part, code, environment.python)
            KEPT.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(known, indent=1))
        found |= known[part]
    return found


def compare(base: Found, now: Found, renamed: Renamed) -> int:
    """Print what differs, and refusals that are meant to; returns how many digests differ that are not meant
    to."""
    base = {renamed.key(name): renamed.text(value) for name, value in base.items()}
    differing = [name for name in base if now.get(name) != base[name]]
    differing += [name for name in now if name not in base]
    meant = 0
    for name in differing:
        before, after = base.get(name, "missing"), now.get(name, "missing")
        reason = renamed.reason(name, before, after)
        if reason is None:
            print(f"differs: {name}: {before} before, {after} now")
            continue
        meant += 1
        if name.startswith("refusals: "):
            print(f"as intended, {reason}: {name}: {before} before, {after} now")
    print(f"{len(base)} digests, {len(differing) - meant} differ, {meant} as intended")
    return len(differing) - meant


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
    now: Found = {}
    with checkout(commit) as tree:
        try:
            pairs = {part: environments(tree, ROOT, EXTRAS.get(part, ())) for part in arguments.parts}
        except NoEnvironment as error:
            parser.error(str(error))
        befores = {part: before for part, (before, _) in pairs.items()}
        base = base_digests(commit, tree, befores, renamed.code)
    for part, (_, environment) in pairs.items():
        print(f"work tree: {part}", flush=True)
        now |= digests_of(ROOT, part, {}, environment.python)
    return 1 if compare(base, now, renamed) else 0


if __name__ == "__main__":
    sys.exit(main())
