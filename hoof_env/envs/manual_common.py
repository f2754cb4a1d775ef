"""What manual pages share: a page that refers to another one for the sections that are the same."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import SequenceMatcher


def without_common(page: str, name: str, other: str) -> str:
    """Replace what a page shares with another page by links to that page's sections.

    Paragraphs that stand in the same section of both go, and so do equal rows of tables. A section stays
    whole where the other page's has a paragraph without a counterpart, and a table where the other one has a
    name that it lacks: a reader would take them for said here, too.

    Args:
        page: the page in Markdown.
        name: of the other page, which lies beside it as NAME.md.
        other: the other page.

    Returns:
        The page in Markdown, with the headings that it had.
    """
    others = {_title(section): section for section in _sections(other)}
    found = []
    for section in _sections(page):
        title = _title(section)
        left = _differing(_blocks(section), _blocks(others[title])) if title in others else None
        if left is None:
            found.append(section)
            continue
        anchor = title.strip("# ").lower().replace(" ", "-")
        start = f"As in [{name}]({name}.md#{anchor})"
        found.append("\n\n".join((title, f"{start}, but for:" if left else f"{start}.", *left)) + "\n\n")
    return "".join(found).rstrip() + "\n"


def _sections(page: str) -> list[str]:
    """Divide a page before each heading of the second or third rank."""
    return re.split(r"(?m)^(?=###? )", page)


def _title(section: str) -> str:
    """Return the heading of a section; the part before all others has its title, which no other page has."""
    return section.partition("\n")[0]


def _blocks(section: str) -> list[str]:
    """Divide a section without its heading into paragraphs, tables and pieces of code."""
    body = section.partition("\n")[2]
    blocks = re.findall(r"```.*?```|(?:(?!\n\n|```).)+", body, re.DOTALL)
    return [block.strip() for block in blocks if block.strip()]


def _differing(own: Sequence[str], others: Sequence[str]) -> list[str] | None:
    """Return the blocks that another section lacks, or None where that one has more than these replace."""
    left = []
    for kind, i, i_end, j, j_end in SequenceMatcher(None, others, own, autojunk=False).get_opcodes():
        if kind == "equal":
            continue
        if i_end - i > j_end - j:
            return None
        left += [_differing_rows(block, others[i:i_end]) for block in own[j:j_end]]
    return left


def _differing_rows(block: str, others: Sequence[str]) -> str:
    """Return a table without the rows that another one has, too, if it has all names of that one; another
    block whole."""
    rows = block.split("\n")
    names = {_first_cell(row) for row in rows}
    for other in (text.split("\n") for text in others if block.startswith("|")):
        if other[0] == rows[0] and {_first_cell(row) for row in other} <= names:
            return "\n".join([*rows[:2], *(row for row in rows[2:] if row not in other)])
    return block


def _first_cell(row: str) -> str:
    return row.split("|")[1] if row.startswith("|") else ""
