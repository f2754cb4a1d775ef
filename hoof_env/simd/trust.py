"""Checks that no other user could have written a file that can run code, before it is read.

Compiled kernels are pickles. A user with the right to write to their folder could run code as every user that
reads them, so a folder or file of another user, or one that others can write, is refused. A system without
owners and modes, such as Windows, is not checked.
"""

from __future__ import annotations

import os
import shlex
import stat
from contextlib import suppress
from pathlib import Path

from hoof_env.errors import OutputError

PACKAGE = Path(__file__).resolve().parents[1]
OTHERS = stat.S_IWGRP | stat.S_IWOTH


def read(path: str) -> bytes:
    """Return the content of a file; raise `OutputError` if another user could have written it."""
    # the open file is checked, not its path, which could be replaced in between
    with open(path, "rb") as file:
        _check(path, os.fstat(file.fileno()))
        return file.read()


def check_folder(folder: str) -> None:
    """Raise `OutputError` if there is such a folder and another user could write to it."""
    with suppress(FileNotFoundError, NotADirectoryError, PermissionError):
        _check(folder, os.stat(folder))


def close_new(folder: str) -> None:
    """Make an empty folder of this user unwritable for others: it was just made, perhaps under a generous
    umask."""
    with suppress(OSError):
        if os.name == "posix" and os.stat(folder).st_uid == os.geteuid() and not os.listdir(folder):
            close(folder)


def close(path: str) -> None:
    """Make a file or folder of this user unwritable for all but its owner."""
    if os.name == "posix" and (mode := stat.S_IMODE(os.stat(path).st_mode)) & OTHERS:
        # a file system may have no modes; the check at the next reading decides
        with suppress(PermissionError):
            os.chmod(path, mode & ~OTHERS)


def _check(path: str, found: os.stat_result) -> None:
    if os.name != "posix":
        return
    # users that own or can write this package can run code anyway: inside it they are trusted
    package = os.stat(PACKAGE)
    is_inside = PACKAGE in Path(path).resolve().parents
    open_to = found.st_mode & OTHERS
    if is_inside and found.st_gid == package.st_gid:
        open_to &= ~package.st_mode
    if is_inside:
        open_to &= ~(package.st_mode & stat.S_IWOTH)
    # a sticky folder, as /tmp: others can add to it, but not replace the folder in it that is checked next
    if found.st_mode & stat.S_ISVTX and stat.S_ISDIR(found.st_mode):
        open_to = 0
    if open_to & stat.S_IWGRP and _is_ours(found.st_gid):
        open_to &= ~stat.S_IWGRP
    is_shared = is_inside and found.st_gid == package.st_gid and package.st_mode & stat.S_IWGRP
    if found.st_uid not in (os.geteuid(), 0, package.st_uid) and not is_shared:
        why = f"its owner is {_user(found.st_uid)}"
    elif open_to:
        why = "it is writable by " + ("everybody" if open_to & stat.S_IWOTH else _group(found.st_gid))
    else:
        return
    folder = os.environ.get("NUMBA_CACHE_DIR") or (path if os.path.isdir(path) else os.path.dirname(path))
    close_it = f"run `chmod -R go-w {shlex.quote(folder)}` if all in it is yours, " if open_to else ""
    raise OutputError(
        f"compiled kernels in {path!r} cannot be trusted, for {why}: they are pickles, which can run any "
        f"code; expected a folder and files of your own or of root that nobody else can write: {close_it}"
        "delete these files, or set the environment variable NUMBA_CACHE_DIR to a folder of your own"
    )


def _is_ours(group: int) -> bool:
    """True for a group without other members: the one that many systems make for each user, and let write by
    the umask; or root's, unless this user is root."""
    if os.geteuid() == 0:
        return False
    # modules of POSIX only
    import grp
    import pwd

    with suppress(KeyError):
        user = pwd.getpwuid(os.geteuid())
        found = grp.getgrgid(group)
        if user.pw_gid == group and found.gr_name == user.pw_name and set(found.gr_mem) <= {user.pw_name}:
            return True
    return group == 0


def _user(number: int) -> str:
    import pwd

    with suppress(KeyError):
        return pwd.getpwuid(number).pw_name
    return f"user {number}"


def _group(number: int) -> str:
    import grp

    with suppress(KeyError):
        return f"group {grp.getgrgid(number).gr_name}"
    return f"group {number}"
