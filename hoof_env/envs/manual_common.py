"""Removal of the parts that a manual page shares with another page, to which it then refers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import SequenceMatcher


def without_common(page: str, name: str, other: str) -> str:
    """Replace the parts that a page shares with another page by links to that page's sections.

    Paragraphs that are in the same section of both pages are removed, and so are equal rows of tables. A
    section is kept whole if that of the other page has a paragraph without a counterpart, and a table if the
    other one has a name that it lacks: with a link, readers would apply them to this page, too.

    Args:
        page: page in Markdown.
        name: name of the other page, which is NAME.md in the same folder.
        other: the other page.

    Returns:
        The page in Markdown, with all of its headings.
    """
    others = {_title(section): section for section in _sections(other)}
    sections = []
    for section in _sections(page):
        title = _title(section)
        left = _differing(_blocks(section), _blocks(others[title])) if title in others else None
        if left is None:
            sections.append(section)
            continue
        # The anchor that Markdown renderers give to a heading.
        anchor = title.strip("# ").lower().replace(" ", "-")
        start = f"As in [{name}]({name}.md#{anchor})"
        sections.append("\n\n".join((title, f"{start}, but for:" if left else f"{start}.", *left)) + "\n\n")
    return "".join(sections).rstrip() + "\n"


def _sections(page: str) -> list[str]:
    """Divide a page before each heading of the second or third level."""
    return re.split(r"(?m)^(?=###? )", page)


def _title(section: str) -> str:
    """Return the heading of a section; of the first part of a page its title, which no other page has."""
    return section.partition("\n")[0]


def _blocks(section: str) -> list[str]:
    """Divide a section without its heading into paragraphs, tables and pieces of code."""
    body = section.partition("\n")[2]
    blocks = re.findall(r"```.*?```|(?:(?!\n\n|```).)+", body, re.DOTALL)
    return [block.strip() for block in blocks if block.strip()]


def _differing(own: Sequence[str], others: Sequence[str]) -> list[str] | None:
    """Return the blocks that another section lacks; None if that one has blocks without a counterpart."""
    left = []
    # Without the heuristic for junk, which would treat frequent blocks as different.
    for kind, i, i_end, j, j_end in SequenceMatcher(None, others, own, autojunk=False).get_opcodes():
        if kind == "equal":
            continue
        if i_end - i > j_end - j:
            return None
        left += [_differing_rows(block, others[i:i_end]) for block in own[j:j_end]]
    return left


def _differing_rows(block: str, others: Sequence[str]) -> str:
    """Return a table without the rows of another one with the same head, if it has all names of that one; any
    other block unchanged."""
    rows = block.split("\n")
    names = {_first_cell(row) for row in rows}
    for other in (text.split("\n") for text in others if block.startswith("|")):
        if other[0] == rows[0] and {_first_cell(row) for row in other} <= names:
            return "\n".join([*rows[:2], *(row for row in rows[2:] if row not in other)])
    return block


def _first_cell(row: str) -> str:
    """Return the first cell of a row of a table, the name; "" of another line."""
    return row.split("|")[1] if row.startswith("|") else ""
