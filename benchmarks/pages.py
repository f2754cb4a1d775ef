"""Tables on hand-written pages, between marks that a command fills from its data."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from agents import runs
from hoof_env.errors import ParameterError

DOCS = Path(__file__).parents[1] / "docs"


def filled(text: str, tables: Mapping[str, str]) -> str:
    """Return a page whose marks `<!-- table NAME -->` and `<!-- end NAME -->` have these tables between them.

    Raises:
        ParameterError: the page has no such marks.
    """
    for name, table in tables.items():
        begin, end = f"<!-- table {name} -->", f"<!-- end {name} -->"
        pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
        if not pattern.search(text):
            raise ParameterError(f"page: expected {begin} and {end} on it, found none")
        text = pattern.sub(lambda _, b=begin, t=table, e=end: f"{b}\n\n{t}\n\n{e}", text)  # type: ignore[misc]
    return text


def fill(page: Path, tables: Mapping[str, str]) -> None:
    """Write the tables into a page."""
    runs.write_text(page, filled(page.read_text(encoding="utf-8"), tables))
