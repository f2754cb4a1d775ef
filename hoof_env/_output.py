"""Output that a failure or an interrupt never leaves half written; tables in Markdown and for terminals."""

from __future__ import annotations

import io
import itertools
import os
import re
import shutil
import sys
import tempfile
import textwrap
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

from hoof_env.errors import OutputError, ParameterError

STAGE = ".unfinished-"
"""First letters of the name of a folder whose files are not complete yet."""

KEPT = "kept-"
"""First letters of the name of a folder with complete files whose places another command took meanwhile."""


@contextmanager
def staged(folder: Path, new: Collection[str] = ()) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`, which is made if need be. If the block succeeds, its files
    replace the files of `folder`. Folders that were made and are still empty are removed.

    Inside the block of another `staged` with its temporary folder, that folder is yielded.

    Args:
        folder: folder of the files.
        new: names of files that must not be there at the end either.

    Raises:
        OutputError: the folder cannot be made or written to; or a file of `new` is there, which stays, and
            all files of the block are in a folder next to it.
    """
    if folder.name.startswith(STAGE):
        yield folder
        return
    stage = None
    made = []
    try:
        made = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=STAGE, dir=folder))
        yield stage
        _publish(stage, folder, new)
    except OutputError:
        raise
    except OSError as error:
        if stage is None:
            reason = f"({error.strerror}); expected a writable folder"
            raise OutputError(f"cannot write to {str(folder)!r} {reason}") from None
        raise OutputError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from None
    finally:
        if stage is not None:
            shutil.rmtree(stage, ignore_errors=True)
        # only empty folders can be removed: those with results stay
        for path in made:
            with suppress(OSError):
                path.rmdir()


@contextmanager
def new_file(path: Path, overwrite: bool, others: Collection[Path] = ()) -> Iterator[Path]:
    """Yield a path, in a temporary folder, for a file that is moved to `path` when it is complete.

    Args:
        path: place of the file.
        overwrite: replace a file that is there; otherwise it stays, even one that appeared during the block.
        others: files that are written with it into the same folder.

    Raises:
        OutputError: as in `staged`.
    """
    names = list(dict.fromkeys(file.name for file in (path, *others)))
    with staged(path.parent, () if overwrite else names) as stage:
        yield stage / path.name


def _publish(stage: Path, folder: Path, new: Collection[str]) -> None:
    """Move the files of a temporary folder to their places, all or none."""
    claimed: list[Path] = []
    try:
        for name in new:
            # The system lets one process alone make a file with "x": from here on others find it.
            with (folder / name).open("x"):
                claimed.append(folder / name)
        for file in sorted(stage.iterdir()):
            os.replace(file, folder / file.name)
        claimed.clear()
    except FileExistsError as error:
        there = Path(error.filename)
        kept = folder / stage.name.replace(STAGE, KEPT)
        # With the rights of any new folder; the temporary one is the owner's alone
        kept.mkdir()
        for file in sorted(stage.iterdir()):
            os.replace(file, kept / file.name)
        raise OutputError(
            f"{str(there)!r} exists already: it was written meanwhile, and stays; the new one is"
            f" {str(kept / there.name)!r}"
        ) from None
    finally:
        for path in claimed:
            path.unlink()


def check_folder(folder: Path) -> None:
    """Raise `OutputError` unless files can be written to `folder`, which may still have to be made."""
    with staged(folder):
        pass


def check_new(path: Path, overwrite: bool) -> str:
    """Return an addition to the report of a new file: the folder that is made for it, or nothing.

    Raises:
        OutputError: there is a file already and `overwrite` is False, or there cannot be one.
    """
    try:
        is_there = path.is_file()
        if path.exists() and not (is_there or path.is_dir()):
            raise OutputError(f"cannot write to {str(path)!r}: expected a file, got a pipe or a device")
        has_folder = path.parent.exists()
    except OSError as error:
        raise OutputError(f"cannot write to {str(path)!r}: {error.strerror}") from None
    if is_there and not overwrite:
        raise OutputError(f"{str(path)!r} exists already; name another file, or add --overwrite")
    return "" if has_folder else f"; made the folder {path.parent}"


def free_memory() -> float:
    """Return the memory that this process may still take [bytes]; infinite if the system does not say."""
    bounds = [float("inf")]
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        bounds += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
    # a container may have less than its machine; `max` holds the word max if it is not limited
    with suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        most, used = ((group / f"memory.{name}").read_text() for name in ("max", "current"))
        bounds.append(float(most) - float(used))
    # systems without /proc
    if len(bounds) == 1:
        with suppress(OSError, ValueError, AttributeError):
            bounds.append(float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    return max(min(bounds), 0.0)


def check_arguments(arguments: Iterable[str]) -> None:
    """Raise `ParameterError` for an empty argument of a command, as a variable that is not set gives: as a
    path it would be the working folder."""
    for before, item in pairwise(["", *arguments]):
        if not item or re.fullmatch("--[a-z-]+=", item):
            name = item.removesuffix("=") or (before if before.startswith("--") else "argument")
            raise ParameterError(
                f"{name}: expected a value, got an empty string, as from a variable without a value"
            )


MIN_COLUMNS = 40
"""Least width of help: in a narrower terminal the tables of tyro and rich never end."""


def bear_any_output() -> None:
    """Make a command replace characters that the encoding of its output lacks, and lay out help for a
    terminal of at least `MIN_COLUMNS`."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    if shutil.get_terminal_size().columns < MIN_COLUMNS:
        os.environ["COLUMNS"] = str(MIN_COLUMNS)


def flush_or_drop() -> None:
    """Write what a command has printed; drop it if that fails, as on a full disk, so that Python does not try
    again at its end."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def markdown_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown from the cells of its head and of its rows; a row that is shorter than the
    head ends in empty cells."""
    titles = list(head)
    lines = [[*row, *[""] * (len(titles) - len(row))] for row in map(list, rows)]
    first, *rest = (f"| {' | '.join(line)} |" for line in (titles, *lines))
    return "\n".join([first, "|" + "---|" * len(titles), *rest])


def terminal_table(head: Iterable[str], rows: Iterable[Iterable[str]], width: int) -> str:
    """Return a table for a terminal: columns side by side, of which the widest are wrapped to fit.

    Args:
        head: titles of the columns.
        rows: cells of each row, as many as there are titles.
        width: width of the terminal [characters]; columns become no narrower than their longest words.
    """
    lines = [list(head), *map(list, rows)]
    columns = list(zip(*lines, strict=True))
    widths = [max(map(len, column)) for column in columns]
    shortest = [max(len(word) for cell in column for word in cell.split() or [""]) for column in columns]
    while sum(widths) + 2 * (len(widths) - 1) > width and widths != shortest:
        widest = max((k for k in range(len(widths)) if widths[k] > shortest[k]), key=widths.__getitem__)
        widths[widest] -= 1
    printed = []
    for line in [lines[0], ["-" * each for each in widths], *lines[1:]]:
        wrapped = [
            textwrap.wrap(cell, each, break_long_words=False, break_on_hyphens=False)
            for cell, each in zip(line, widths, strict=True)
        ]
        for parts in itertools.zip_longest(*wrapped, fillvalue=""):
            padded = (part.ljust(each) for part, each in zip(parts, widths, strict=True))
            printed.append("  ".join(padded).rstrip())
    return "\n".join(printed)
