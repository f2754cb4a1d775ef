"""Writing results so that a failure or an interrupt never leaves half a file behind; tables in Markdown."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hoof_env.errors import OutputError


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """A temporary folder inside `folder`, which is made if need be; if the block succeeds, its files replace
    those of `folder`.

    Raises:
        OutputError: `folder` cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=folder))
    except OSError as error:
        raise OutputError(
            f"cannot write to {str(folder)!r} ({error.strerror}); expected a writable folder"
        ) from None
    try:
        yield stage
        for file in sorted(stage.iterdir()):
            os.replace(file, folder / file.name)
    except OSError as error:
        raise OutputError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def check_folder(folder: Path) -> None:
    """Make `folder` if need be and raise `OutputError` unless files can be written there."""
    with staged(folder):
        pass


@contextmanager
def new_file(path: Path, overwrite: bool) -> Iterator[str]:
    """Guards the making of a file; if the block fails, the folders that were made for it go again.

    Yields:
        What to add to a report: the folder that is made, or nothing.

    Raises:
        OutputError: there is a file already and `overwrite` is False, or there cannot be one.
    """
    try:
        is_there = path.is_file()
        missing = [folder for folder in path.parents if not folder.exists()]
    except OSError as error:
        raise OutputError(f"cannot write to {str(path)!r}: {error.strerror}") from None
    if is_there and not overwrite:
        raise OutputError(f"{str(path)!r} exists already; name another file, or add --overwrite")
    try:
        yield f"; made the folder {path.parent}" if missing else ""
    except BaseException:
        for folder in missing:
            with suppress(OSError):
                folder.rmdir()
        raise


def markdown_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown from the cells of its head and of its rows; a row that is shorter than the head
    ends in empty cells."""
    titles = list(head)
    lines = [[*row, *[""] * (len(titles) - len(row))] for row in map(list, rows)]
    first, *rest = (f"| {' | '.join(line)} |" for line in (titles, *lines))
    return "\n".join([first, "|" + "---|" * len(titles), *rest])
