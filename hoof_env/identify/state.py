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

from hoof_env.errors import DataFileError, OutputError
from hoof_env.identify.records import Result

FOLDER = "state"
_HINT = "name another folder or delete this one"


@dataclass(frozen=True)
class State:
    """The files of one search (see `open_state`); `digest` marks those that belong to it."""

    folder: Path
    digest: str

    def result(self, job_id: str) -> Result | None:
        """A finished job, or None.

        Raises:
            DataFileError: its file is damaged or of another search.
        """
        path = self.folder / f"job-{job_id}.json"
        if not path.exists():
            return None
        data = _read_json(path, f"delete it to repeat job {job_id}")
        try:
            digest, result = data["problem"], Result.from_dict(data["result"])
        except (KeyError, TypeError):
            raise DataFileError(f"{path} is damaged; delete it to repeat job {job_id}") from None
        self._check(path, digest)
        return result

    def finish(self, result: Result) -> None:
        """Write a finished job, which ends its checkpoint."""
        text = json.dumps({"problem": self.digest, "result": result.to_dict()}, indent=1, allow_nan=False)
        _write(self.folder / f"job-{result.id}.json", text.encode())
        self._checkpoint(result.id).unlink(missing_ok=True)

    def load(self, job_id: str) -> bytes | None:
        """The checkpoint of a running job, or None.

        Raises:
            DataFileError: it is damaged or of another search.
        """
        path = self._checkpoint(job_id)
        if not path.exists():
            return None
        digest, _, content = path.read_bytes().partition(b"\n")
        self._check(path, digest.decode(errors="replace"))
        try:
            pickle.loads(content)
        except Exception:  # a damaged pickle may raise anything
            raise DataFileError(f"{path} is damaged; delete it to repeat job {job_id}") from None
        return content

    def save(self, job_id: str, checkpoint: bytes) -> None:
        """Write the checkpoint of a running job."""
        _write(self._checkpoint(job_id), self.digest.encode() + b"\n" + checkpoint)

    def _checkpoint(self, job_id: str) -> Path:
        return self.folder / f"job-{job_id}.pickle"

    def _check(self, path: Path, digest: Any) -> None:
        if digest != self.digest:
            raise DataFileError(
                f"{path} belongs to another search (expected {self.digest}, got {digest!r}); {_HINT}"
            )


def open_state(out: Path, problem: Mapping[str, Any], digest: str, *, resume: bool) -> State:
    """Begin a search in `out`, or go on with the one that is there.

    Args:
        out: the search's output folder, made if need be.
        problem: JSON object, what tells this search from another; `digest` of the same.
        resume: go on with a search rather than begin one.

    Raises:
        DataFileError: nothing to resume, or a search for something else, or a damaged file.
        OutputError: the folder holds a search that would be overwritten, or cannot be written.
    """
    folder = out / FOLDER
    file = folder / "problem.json"
    if resume:
        if not file.is_file():
            raise DataFileError(f"{str(out)!r} holds no search to resume; leave out --resume to begin one")
        found = _read_json(file, f"nothing can be resumed: {_HINT}")
        differing = _differences(found, json.loads(json.dumps(problem)))
        if differing:
            raise DataFileError(f"{str(out)!r} holds another search: {'; '.join(differing)}; {_HINT}")
    elif file.exists() or (out / "identified.json").exists():
        raise OutputError(
            f"{str(out)!r} already holds a search; add --resume to go on with it, or name another folder"
        )
    else:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"cannot write to {str(out)!r} ({error.strerror}); expected a writable folder"
            ) from None
        _write(file, json.dumps(problem, indent=1).encode())
    return State(folder, digest)


def _differences(found: Any, wanted: dict[str, Any]) -> list[str]:
    if not isinstance(found, dict):
        return [f"its problem.json holds no object but {type(found).__name__}"]
    keys = [key for key in {**wanted, **found} if found.get(key) != wanted.get(key)]
    return [f"{key} is {found.get(key)!r} there and {wanted.get(key)!r} here" for key in keys]


def _read_json(path: Path, hint: str) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFileError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise DataFileError(f"{path} is damaged; {hint}") from None


def _write(path: Path, content: bytes) -> None:
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
