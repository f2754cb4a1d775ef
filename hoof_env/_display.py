"""Readable forms of objects in consoles and notebooks: tables and lines instead of addresses in memory."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any


def html_table(head: Iterable[str], rows: Iterable[Iterable[Any]], caption: str = "") -> str:
    """Return a table in HTML; cells are converted to text."""
    top = "".join(f'<th style="text-align: left">{escape(cell)}</th>' for cell in head)
    lines = []
    for row in rows:
        cells = "".join(f'<td style="text-align: left">{escape(str(cell))}</td>' for cell in row)
        lines.append(f"<tr>{cells}</tr>")
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{top}</tr></thead><tbody>{''.join(lines)}</tbody></table>"


def line_of(name: str, /, **parts: Any) -> str:
    """Return one line in angle brackets: a name and parts by name."""
    return f"<{' '.join([name, *(f'{key}={value}' for key, value in parts.items())])}>"
