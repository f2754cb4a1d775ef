"""One part of the study: text, the numbers behind it and its figures."""

from __future__ import annotations

import math
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


def for_json(value: Any) -> Any:
    """The same value in plain Python, with None for every number that is not finite."""
    if isinstance(value, dict):
        return {str(key): for_json(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [for_json(entry) for entry in value]
    if hasattr(value, "tolist"):
        return for_json(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
