"""Writing results so that a failure or an interrupt never leaves half a file behind; tables in Markdown."""

from __future__ import annotations

import io
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hoof_env.errors import OutputError


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """A temporary folder inside `folder`, which is made if need be; if the block succeeds, its files replace
    those of `folder`. Folders that were made and have stayed empty go again. `OutputError` if it cannot
    be."""
    stage = None
    made = []
    try:
        made = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=folder))
        yield stage
        for file in sorted(stage.iterdir()):
            os.replace(file, folder / file.name)
    except OSError as error:
        if stage is None:
            reason = f"({error.strerror}); expected a writable folder"
            raise OutputError(f"cannot write to {str(folder)!r} {reason}") from None
        raise OutputError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from None
    finally:
        if stage is not None:
            shutil.rmtree(stage, ignore_errors=True)
        for path in made:
            with suppress(OSError):  # one that holds something
                path.rmdir()


def check_folder(folder: Path) -> None:
    """Raise `OutputError` unless files can be written to `folder`, which may still have to be made."""
    with staged(folder):
        pass


def check_new(path: Path, overwrite: bool) -> str:
    """What to add to a report of a new file: the folder that is made for it, or nothing. `OutputError` where
    there is a file already and `overwrite` is False, or there cannot be one."""
    try:
        is_there = path.is_file()
        has_folder = path.parent.exists()
    except OSError as error:
        raise OutputError(f"cannot write to {str(path)!r}: {error.strerror}") from None
    if is_there and not overwrite:
        raise OutputError(f"{str(path)!r} exists already; name another file, or add --overwrite")
    return "" if has_folder else f"; made the folder {path.parent}"


def free_memory() -> float:
    """How much memory this process may still take [bytes]; infinite where the system does not say."""
    found = [float("inf")]
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        found += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
    with suppress(OSError, ValueError):  # of a container
        group = Path("/sys/fs/cgroup")
        most, used = ((group / f"memory.{name}").read_text() for name in ("max", "current"))
        found.append(float(most) - float(used))
    if len(found) == 1:
        with suppress(OSError, ValueError, AttributeError):
            found.append(float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    return max(min(found), 0.0)


LEAST_COLUMNS = 40
"""Width of help at least: in a narrower terminal the tables of tyro and rich never end."""


def bear_any_output() -> None:
    """Have a command replace what the encoding of its output lacks, and lay out help for a terminal of some
    width at least."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    if shutil.get_terminal_size().columns < LEAST_COLUMNS:
        os.environ["COLUMNS"] = str(LEAST_COLUMNS)


def flush_or_drop() -> None:
    """Write what a command has printed; where that cannot be, as on a full disk, it is dropped, so that
    Python does not try again at its end."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def markdown_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown from the cells of its head and of its rows; a row that is shorter than the head
    ends in empty cells."""
    titles = list(head)
    lines = [[*row, *[""] * (len(titles) - len(row))] for row in map(list, rows)]
    first, *rest = (f"| {' | '.join(line)} |" for line in (titles, *lines))
    return "\n".join([first, "|" + "---|" * len(titles), *rest])
