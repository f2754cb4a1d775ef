"""One part of the study: text, the numbers behind it and its figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Section:
    """What one part of the study found.

    Attributes:
        title: heading.
        markdown: text and tables, every number formatted from `data`; no heading of level 1 or 2.
        data: ready for JSON; holds every number of the text.
        figures: drawing function by file name without suffix; each returns a `matplotlib.figure.Figure`
            and is the first to import matplotlib.
    """

    title: str
    markdown: str
    data: dict[str, Any]
    figures: dict[str, Callable[[], Any]] = field(default_factory=dict)


def table(head: list[str], rows: Iterable[list[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def listed(items: Iterable[str], last: str = "and") -> str:
    """'a', 'a and b', 'a, b and c'; 'none' without items."""
    *first, end = list(items) or ["none"]
    return f"{', '.join(first)} {last} {end}" if first else end
