"""Tables in Markdown pages."""

from __future__ import annotations

import re

from hoof_env.errors import DataFileError


def put(text: str, name: str, table: str) -> str:
    """The page's text with a table between the marks of its name.

    Raises:
        DataFileError: the page has no such marks.
    """
    marks = f"<!-- {name} -->", f"<!-- /{name} -->"
    if not all(mark in text for mark in marks):
        raise DataFileError(f"the page: expected the marks {' and '.join(marks)}")
    inside = "\n".join((marks[0], table, marks[1]))
    return re.sub(f"{marks[0]}.*{marks[1]}", lambda _: inside, text, flags=re.DOTALL)
