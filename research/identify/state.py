"""What a search leaves in its folder so that it can go on after it was killed.

`problem.json` says what is searched, `job-ROUND-INDEX.json` holds a finished job, `.pickle` a running one.
Every file is written beside its name and then moved there, so that a kill never leaves half of one.
"""

from __future__ import annotations

import json
import os
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hoof_env.errors import DataFileError, HoofEnvError, OutputError
from research.identify.records import Result

FOLDER = "state"
_HINT = "name another folder or delete this one"


@dataclass(frozen=True)
class State:
    """The files of one search (see `open_state`); `digest` marks those that belong to it.

    `kind` is what errors call it.
    """

    folder: Path
    digest: str
    kind: str = "search"

    def result(self, job_id: str) -> Result | None:
        """A finished job, or None.

        Raises:
            DataFileError: its file is damaged or of another search.
        """
        path = self.folder / f"job-{job_id}.json"
        if not path.exists():
            return None
        data = read_json(path, f"delete it to repeat job {job_id}")
        try:
            digest, result = data["problem"], Result.from_dict(data["result"])
        except (KeyError, TypeError):
            raise DataFileError(f"{path} is damaged; delete it to repeat job {job_id}") from None
        self.check(path, digest)
        return result

    def finish(self, result: Result) -> None:
        """Write a finished job, which ends its checkpoint."""
        text = json.dumps({"problem": self.digest, "result": result.to_dict()}, indent=1, allow_nan=False)
        write(self.folder / f"job-{result.id}.json", text.encode())
        self._checkpoint(result.id).unlink(missing_ok=True)

    def load(self, job_id: str) -> bytes | None:
        """The checkpoint of a running job, or None.

        Raises:
            DataFileError: it is damaged or of another search.
        """
        path = self._checkpoint(job_id)
        if not path.exists():
            return None
        try:
            digest, _, content = path.read_bytes().partition(b"\n")
        except OSError as error:
            raise DataFileError(f"cannot read {path}: {error.strerror or error}") from None
        self.check(path, digest.decode(errors="replace"))
        try:
            pickle.loads(content)
        except Exception:  # a damaged pickle may raise anything
            raise DataFileError(f"{path} is damaged; delete it to repeat job {job_id}") from None
        return content

    def save(self, job_id: str, checkpoint: bytes) -> None:
        """Write the checkpoint of a running job."""
        write(self._checkpoint(job_id), self.digest.encode() + b"\n" + checkpoint)

    def _checkpoint(self, job_id: str) -> Path:
        return self.folder / f"job-{job_id}.pickle"

    def check(self, path: Path, digest: Any) -> None:
        """Raise `DataFileError` unless a file's digest is that of this search."""
        if digest != self.digest:
            raise DataFileError(
                f"{path} belongs to another {self.kind} (expected {self.digest}, got {digest!r}); {_HINT}"
            )


def open_state(
    out: Path,
    problem: Mapping[str, Any],
    digest: str,
    *,
    resume: bool,
    kind: str = "search",
    product: str = "identified.json",
) -> State:
    """Begin a search in `out`, or go on with the one that is there.

    Args:
        out: the search's output folder, made if need be.
        problem: JSON object, what tells this search from another; `digest` of the same.
        resume: go on with a search rather than begin one.
        kind: what errors call it. product: the file that it ends with.

    Raises:
        DataFileError: nothing to resume, or a search for something else, or a damaged file.
        OutputError: the folder holds a search that would be overwritten, or cannot be written.
    """
    folder = out / FOLDER
    file = folder / "problem.json"
    try:
        if resume:
            _check_same(out, file, problem, kind)
        elif file.exists() or (out / product).exists():
            raise OutputError(
                f"{str(out)!r} already holds a search or what one found; name another folder, or go on with "
                f"the same {kind} by --resume"
            )
        else:
            folder.mkdir(parents=True, exist_ok=True)
            write(file, json.dumps(problem, indent=1).encode())
    except HoofEnvError:
        raise
    except OSError as error:
        raise OutputError(
            f"cannot write to {str(out)!r} ({error.strerror}); expected a writable folder"
        ) from None
    return State(folder, digest, kind)


def _check_same(out: Path, file: Path, problem: Mapping[str, Any], kind: str) -> None:
    if not file.is_file():
        raise DataFileError(f"{str(out)!r} holds no {kind} to resume; leave out --resume to begin one")
    found = read_json(file, f"nothing can be resumed: {_HINT}")
    differing = _differences(found, json.loads(json.dumps(problem)))
    if differing:
        raise DataFileError(f"{str(out)!r} holds another {kind}: {'; '.join(differing)}; {_HINT}")


def _differences(found: Any, wanted: dict[str, Any]) -> list[str]:
    if not isinstance(found, dict):
        return [f"its problem.json holds no object but {type(found).__name__}"]
    keys = [key for key in {**wanted, **found} if found.get(key) != wanted.get(key)]
    return [f"{key} is {found.get(key)!r} there and {wanted.get(key)!r} here" for key in keys]


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


def write(path: Path, content: bytes) -> None:
    """Write a file beside its name, then move it there.

    Raises:
        OutputError: it cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
