"""Interpreters with what a commit depends on, so that two commits are compared each with its own packages.

`compare_bits.py` and `benchmarks.compare` ask for one for either commit. Where this interpreter has the
packages that both commits' constraints.txt name, it serves both. Otherwise set-up makes an environment for
each under runs/environments, from what the commit's pyproject.toml and constraints.txt say. The package is
not in it, but comes from the checkout. The folder's name is a digest of the version of Python, the
requirements and the pins, so that commits which agree in them share one. An environment whose making was
interrupted is made again.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

# `packaging` is imported where it is used: cases run in environments that may lack it

HERE = Path(__file__).resolve().parent
MADE = HERE.parent / "runs" / "environments"
"""Folder of the environments."""

NEEDED = ("pyproject.toml", "constraints.txt")
"""Files of a checkout that say what the commit depends on."""

HASHES = "pylock.toml"
"""Set-up checks them; older commits have none."""

SET_UP = "setup_venv.py"


class NoEnvironment(Exception):
    """There is no environment in which two commits can be compared."""


@dataclass(frozen=True)
class Environment:
    """Interpreter with a commit's own dependencies.

    Attributes:
        python: its path.
        key: digest of the version of Python, the requirements and the pins.
    """

    python: str
    key: str


def environments(base: Path, now: Path, extras: Sequence[str] = ()) -> tuple[Environment, Environment]:
    """Find or make the environments of two checkouts.

    Args:
        base, now: folders with pyproject.toml and constraints.txt of a commit.
        extras: the package's extras that are needed too, those that the commit has.

    Raises:
        NoEnvironment: the commits pin different versions of NumPy, or set-up did not succeed.
    """
    before, after = (pins(tree).get("numpy", "none") for tree in (base, now))
    if before != after or before == "none":
        raise NoEnvironment(
            "expected one version of NumPy in both commits, because bits and speed differ between versions; "
            f"got {before} in {base / 'constraints.txt'} and {after} in {now / 'constraints.txt'}: choose a "
            "base that pins the same version"
        )
    asked = [Asked.of(tree, extras) for tree in (base, now)]
    if all(one.is_installed() for one in asked):
        before, after = (Environment(sys.executable, one.key) for one in asked)
    else:  # both are made, so that neither has packages around that the other lacks
        before, after = (Environment(made(one, MADE / one.key), one.key) for one in asked)
    return before, after


@dataclass(frozen=True)
class Asked:
    """What a checkout depends on.

    Attributes:
        tree: the checkout.
        requirements: of the package and some of its extras.
        pins: versions by the names of packages.
    """

    tree: Path
    requirements: tuple[str, ...]
    pins: Mapping[str, str]

    @classmethod
    def of(cls, tree: Path, extras: Iterable[str]) -> Asked:
        """Read the dependencies of a checkout, with the extras among `extras` that it has.

        Raises:
            NoEnvironment: the checkout lacks a file.
        """
        project: dict[str, Any] = tomllib.loads(text_of(tree, "pyproject.toml"))["project"]
        known: dict[str, list[str]] = project.get("optional-dependencies", {})
        requirements = set(project["dependencies"]).union(*(known.get(extra, []) for extra in extras))
        return cls(tree, tuple(sorted(requirements)), pins(tree))

    @property
    def key(self) -> str:
        """Digest of the version of Python, the requirements and the pins."""
        python = [platform.python_implementation(), platform.python_version()]
        system = [sys.platform, platform.machine()]
        given = json.dumps([python, system, self.requirements, sorted(self.pins.items())])
        return hashlib.sha256(given.encode()).hexdigest()[:16]

    def is_installed(self) -> bool:
        """Return whether this interpreter has all that is asked for, and what that depends on, in the
        versions that are pinned."""
        from packaging.requirements import Requirement
        from packaging.utils import canonicalize_name
        from packaging.version import Version

        todo = [(Requirement(line), frozenset[str]()) for line in self.requirements]
        seen = set()
        while todo:
            one, extras = todo.pop()
            if one.marker and not any(one.marker.evaluate({"extra": extra}) for extra in extras or ("",)):
                continue
            name = canonicalize_name(one.name)
            if (name, frozenset(one.extras)) in seen:
                continue
            seen.add((name, frozenset(one.extras)))
            try:
                found = metadata.distribution(name)
            except metadata.PackageNotFoundError:
                return False
            # A build of its own, such as PyTorch's +cpu, is of the same version
            version = Version(found.version).public
            if self.pins.get(name, version) != version or not one.specifier.contains(version, True):
                return False
            todo += [(Requirement(line), frozenset(one.extras)) for line in found.requires or ()]
        return True


def made(asked: Asked, place: Path) -> str:
    """Return the interpreter of the environment in `place`; set-up makes what is missing of it.

    Raises:
        NoEnvironment: set-up did not succeed.
    """
    (place / "scripts").mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE / SET_UP, place / "scripts")
    # No more than the digest has, or set-up would bring the folder up to date for each commit that shares it
    needs = f"[project]\ndependencies = {json.dumps(asked.requirements)}\n"
    (place / "pyproject.toml").write_text(needs, encoding="utf-8")
    lines = sorted(f"{name}=={version}\n" for name, version in asked.pins.items())
    (place / "constraints.txt").write_text("".join(lines), encoding="utf-8")
    if (asked.tree / HASHES).exists():
        shutil.copy(asked.tree / HASHES, place)
    command = [sys.executable, str(place / "scripts" / SET_UP), "dependencies"]
    # So told, uv compiles modules to bytes, which no run of a comparison then does in its own time
    settings = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    if not (place / ".venv" / "set-up.stamp").exists():
        print(f"packages of {asked.tree} go to {place}", file=sys.stderr, flush=True)
    # What is printed here may be a table that is redirected
    if subprocess.run(command, env=settings, stdout=sys.stderr).returncode:
        raise NoEnvironment(
            f"expected the packages of {asked.tree / 'constraints.txt'} in {place}, but set-up stopped: see "
            "to what it names above and run the same command again, which takes it up"
        )
    return str(place / ".venv" / "bin" / "python")


def pins(tree: Path) -> dict[str, str]:
    """Return versions of constraints.txt by the names of packages, those that are meant for this Python and
    system.

    Raises:
        NoEnvironment: the checkout lacks a file.
    """
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    lines = (line.partition("#")[0].strip() for line in text_of(tree, "constraints.txt").splitlines())
    pinned = [Requirement(line) for line in lines if line]
    return {
        canonicalize_name(one.name): str(one.specifier).removeprefix("==")
        for one in pinned
        if one.marker is None or one.marker.evaluate()
    }


def text_of(tree: Path, name: str) -> str:
    """Return the text of a file that a checkout must have.

    Raises:
        NoEnvironment: it lacks the file.
    """
    try:
        return (tree / name).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise NoEnvironment(
            f"expected {name} in the checkout {tree}, because it says what the commit depends on: choose a "
            "commit that has it"
        ) from None
