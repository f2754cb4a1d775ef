"""Machine code of kernels in files: plain objects of the processor, in a folder of the user's.

A file's name is the digest of everything that determines its code, so that no file is ever out of date. A
file starts with the digest of its content. A file that another user could write is not read, because it is
run.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
import time
import warnings
from contextlib import suppress
from pathlib import Path

FOLDER = "HOOF_ENV_CACHE_DIR"
"""Environment variable: folder of the files in place of the user's cache folder."""

MAX_FILES = 2000
"""Number of files beyond which the least recently used half goes; a file has 5 to 100 kB."""

DAY = 86400.0
"""Time after which the use of a file is noted again [s]."""

DIGEST = hashlib.sha256().digest_size

_NAME = re.compile(r".+-[0-9a-f]{40}\.o(\..+)?")  # and of one that is being written
_WARNED: set[Path] = set()


def folder() -> Path:
    """Return the folder of the files: the environment variable's, else one in the user's cache folder."""
    if given := os.environ.get(FOLDER):
        return Path(given)
    try:
        home = Path.home()
    except RuntimeError:  # a process without a home, as in a container
        return Path(tempfile.gettempdir()) / f"hoof-env-{os.geteuid()}"
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base / "hoof-env" / "kernels"


def read(name: str) -> bytes | None:
    """Return the content of a file; None without a trusted file."""
    path = folder() / name
    try:
        if not (_is_own(path.parent) and _is_own(path)):
            return None
        found = path.read_bytes()
    except OSError:
        return None
    content = found[DIGEST:]
    if hashlib.sha256(content).digest() != found[:DIGEST]:
        return None  # the disk was full, for one
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > DAY:
            os.utime(path)
    return content


def write(name: str, content: bytes) -> None:
    """Write a content to a file atomically; do nothing if the folder cannot be written."""
    path = folder() / name
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not _is_own(path.parent):
            return
        number, new = tempfile.mkstemp(dir=path.parent, prefix=f"{name}.")
        try:
            with open(number, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            os.replace(new, path)
        except BaseException:
            with suppress(OSError):  # Ctrl-C may come when it has its name
                os.unlink(new)
            raise
        _make_room(path.parent)
    except OSError:
        return  # a read-only or full disk: each process compiles for itself


def _is_own(place: Path) -> bool:
    """Return whether a file or folder belongs to this user or to root, and no other user can change it."""
    if not hasattr(os, "geteuid"):
        return True  # the folders of Windows' users are their own
    try:
        status = place.stat()
    except FileNotFoundError:
        return False
    if status.st_uid in (os.geteuid(), 0) and not status.st_mode & 0o022:
        return True
    if place not in _WARNED:
        _WARNED.add(place)
        warnings.warn(
            f"hoof-env: {place} belongs to others, or others may write there: machine code in it is not"
            f" used, and kernels are compiled in each process; run `chmod go-w {place}` if it is yours, or"
            f" let {FOLDER} name a folder of your own",
            stacklevel=1,
        )
    return False


def _make_room(place: Path) -> None:
    """Remove the least recently used half of too many files of machine code; leave all other files."""
    files = [entry for entry in os.scandir(place) if _NAME.fullmatch(entry.name)]
    if len(files) <= MAX_FILES:
        return
    used = sorted(files, key=lambda entry: entry.stat().st_mtime)
    for entry in used[: len(used) // 2]:
        with suppress(OSError):  # another process may have removed it
            os.unlink(entry.path)
