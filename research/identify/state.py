"""What a search leaves in its folder so that it can go on after it was killed.

`state/problem.json` says what is searched, and every finished part of it has a file of its own there.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from hoof_env import __version__
from hoof_env._output import staged
from hoof_env.errors import DataFileError, OutputError

T = TypeVar("T")

_HINT = "name another folder or delete this one"


@dataclass(frozen=True)
class State:
    """The files of one search in `folder`; `digest` marks those that belong to it."""

    folder: Path
    digest: str

    def load(self, name: str, kind: type[T]) -> T | None:
        """The dataclass that `save` wrote under a name; None if there is nothing.

        Raises:
            DataFileError: the file is damaged or of another search.
        """
        path = self.folder / f"{name}.json"
        if not path.exists():
            return None
        data = read_json(path, f"delete it to repeat {name}")
        try:
            digest, fields = data["problem"], data["content"].items()
            content = kind(**{key: tuple(v) if isinstance(v, list) else v for key, v in fields})
        except (AttributeError, KeyError, TypeError):
            raise DataFileError(f"{path} is damaged; delete it to repeat {name}") from None
        if digest != self.digest:
            raise DataFileError(
                f"{path} belongs to another search (expected {self.digest}, got {digest!r}); {_HINT}"
            )
        return content

    def save(self, name: str, content: Any) -> None:
        """Write a dataclass under a name; a kill never leaves half of it."""
        write_json(self.folder, name, {"problem": self.digest, "content": asdict(content)})


def open_state(out: Path, problem: Mapping[str, Any], *, resume: bool, product: str) -> State:
    """Begin a search in `out`, or go on with the one that is there.

    Args:
        problem: JSON object, what tells this search from another.
        product: the file that it ends with.

    Raises:
        DataFileError: nothing to resume, or a search for something else, or a damaged file.
        OutputError: the folder holds a search that would be overwritten, or cannot be written.
    """
    state = State(out / "state", digest_of(problem))
    file = state.folder / "problem.json"
    try:
        is_there, is_taken = file.is_file(), file.exists() or (out / product).exists()
    except OSError as error:
        raise OutputError(f"cannot write to {str(out)!r} ({error.strerror})") from None
    if is_taken and not resume:
        raise OutputError(
            f"{str(out)!r} already holds a search or what one found; name another folder, or go on with "
            "the same search by --resume"
        )
    if not resume:
        write_json(state.folder, "problem", problem)
        return state
    if not is_there:
        raise DataFileError(f"{str(out)!r} holds no search to resume; leave out --resume to begin one")
    there, here = read_json(file, f"nothing can be resumed: {_HINT}"), json.loads(json.dumps(problem))
    if there != here:
        was = there if isinstance(there, dict) else {}
        keys = (key for key in here if was.get(key) != here[key])
        differing = (f"{key} is {was.get(key)!r} there and {here[key]!r} here" for key in keys)
        raise DataFileError(f"{str(out)!r} holds another search: {'; '.join(differing)}; {_HINT}")
    return state


def digest_of(content: Any) -> str:
    """16 hexadecimal digits that tell one JSON value from another."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def read_json(path: Path, hint: str) -> Any:
    """The content of a JSON file.

    Raises:
        DataFileError: it cannot be read, or is damaged; the `hint` says what to do then.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFileError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise DataFileError(f"{path} is damaged; {hint}") from None


def write_json(folder: Path, name: str, content: Any) -> Path:
    """Write a JSON file whole or not at all; returns its path."""
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with staged(folder) as stage:
        (stage / f"{name}.json").write_text(text, encoding="utf-8")
    return folder / f"{name}.json"


def versions() -> dict[str, str]:
    """Of what a search's numbers depend on."""
    packages = {name: version(name) for name in ("cma", "numpy", "numba")}
    return {"hoof-env": __version__, "Python": platform.python_version(), **packages}
