"""Tables in Markdown pages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from hoof_env.errors import DataFileError


def table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; a row that is shorter than its head ends in empty cells."""
    lines = [titles, ["---"] * len(titles), *([*row, *[""] * (len(titles) - len(row))] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def put(text: str, name: str, content: str) -> str:
    """The page's text with `content` between the marks of that name.

    Raises:
        DataFileError: the page has no such marks.
    """
    marks = f"<!-- {name} -->", f"<!-- /{name} -->"
    if not all(mark in text for mark in marks):
        raise DataFileError(f"the page: expected the marks {' and '.join(marks)}")
    inside = "\n".join((marks[0], content, marks[1]))
    return re.sub(f"{marks[0]}.*{marks[1]}", lambda _: inside, text, flags=re.DOTALL)
