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
    those of `folder`. Folders that were made and have stayed empty go again. `OutputError` if it cannot
    be."""
    stage, made = None, []
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
        is_there, has_folder = path.is_file(), path.parent.exists()
    except OSError as error:
        raise OutputError(f"cannot write to {str(path)!r}: {error.strerror}") from None
    if is_there and not overwrite:
        raise OutputError(f"{str(path)!r} exists already; name another file, or add --overwrite")
    return "" if has_folder else f"; made the folder {path.parent}"


def markdown_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown from the cells of its head and of its rows; a row that is shorter than the head
    ends in empty cells."""
    titles = list(head)
    lines = [[*row, *[""] * (len(titles) - len(row))] for row in map(list, rows)]
    first, *rest = (f"| {' | '.join(line)} |" for line in (titles, *lines))
    return "\n".join([first, "|" + "---|" * len(titles), *rest])
