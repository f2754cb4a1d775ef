"""Files that a user names, read only if they are regular: a pipe would be waited for, a device has no end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from hoof_env.errors import ParameterError, brief

MAX_BYTES = 1 << 28
"""Largest size of a file of text that is read whole [bytes]."""


def check_regular(path: Path) -> None:
    """Raise `OSError` for what is there but no regular file: a folder, a pipe or a device."""
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, "expected a file, got a folder, a pipe or a device", str(path))


def read_text(path: Path) -> str:
    """Return the content of a file of text in UTF-8.

    Raises:
        OSError: it cannot be read, is no regular file, or is larger than `MAX_BYTES`.
        ValueError: it is not UTF-8.
    """
    check_regular(path)
    if path.stat().st_size > MAX_BYTES:
        raise OSError(errno.EFBIG, f"expected at most {MAX_BYTES >> 20} MiB", str(path))
    return path.read_text(encoding="utf-8")


def as_path(name: str, given: str | os.PathLike[str]) -> Path:
    """Return a path that a caller gave as a path or as text; `ParameterError` for anything else."""
    if not isinstance(given, (str, os.PathLike)) or given == "":
        raise ParameterError(f"{name}: expected a path, got {brief(given)}")
    return Path(given)
