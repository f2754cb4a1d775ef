"""Short forms of the manual pages: what a page shares with another page is there alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

from hoof_env._output import markdown_table

SHARED = (
    "Reset Options",
    "Episode Summary",
    "Infos",
    "What is Measured",
    "Vector Environment",
    "State",
    "Arguments",
    "Limits of Commands",
    "Size",
)
"""Sections that hold for all ids; they have a page of their own."""

REST = "Shared Sections"
"""Heading of the section that says where the sections are that a short page lacks."""

ROWS = "Rows that differ:"
"""Line before a table that is to be read with that of another page."""


class Table(NamedTuple):
    """A table in Markdown.

    Attributes:
        head: titles of the columns.
        rows: cells of the rows by name, which is the first cell, or the second one where rows are numbered.
    """

    head: list[str]
    rows: dict[str, list[str]]


def shared_sections(page: str) -> str:
    """Return the sections of a page that hold for all ids."""
    return "".join(section for section in _sections(page) if _title(section).strip("# ") in SHARED)


def own_sections(page: str) -> str:
    """Return the other sections of a page."""
    return "".join(section for section in _sections(page) if _title(section).strip("# ") not in SHARED)


def sections_left(page: str, short: str) -> str:
    """Return the sections of a page that its short form still has."""
    titles = {_title(section) for section in _sections(short)}
    return "".join(section for section in _sections(page) if _title(section) in titles)


def without_common(page: str, others: Mapping[str, str]) -> str:
    """Leave out the parts that a page shares with other pages, and say where they are.

    A section that is equal in another page is left out, and the section `REST` refers to it. Of any other one
    paragraphs that the other page has in the same section are left out. A table becomes the rows that differ,
    after the names that it lacks; if the other table has all of these rows, columns that are equal in both
    are left out, too. A section is kept whole if that of the other page has a paragraph without a
    counterpart: with a link, readers would apply it to this page.

    Args:
        page: page in Markdown.
        others: other pages by name, which is NAME.md in the same folder. A section is compared with that of
            the first page that has it.

    Returns:
        The page in Markdown.
    """
    sections = []
    equal: dict[str, list[str]] = {}
    for section in _sections(page):
        title = _title(section)
        name, other = _counterpart(title, others)
        left = None if other is None else _differing(_blocks(section), _blocks(other))
        if left is None:
            sections.append(section)
        elif left:
            start = f"As in [{name}]({name}.md#{_anchor(title)}), except:"
            sections.append("\n\n".join((title, start, *left)) + "\n\n")
        else:
            equal.setdefault(name, []).append(f"[{title.strip('# ')}]({name}.md#{_anchor(title)})")
    if equal:
        sentences = [f"As in {name}: {', '.join(links)}." for name, links in equal.items()]
        sections.append(f"\n\n## {REST}\n\n" + "\n\n".join(sentences))
    return re.sub(r"\n{3,}", "\n\n", "".join(sections)).strip() + "\n"


def _counterpart(title: str, others: Mapping[str, str]) -> tuple[str, str | None]:
    """Return the name of the first page with a section of that title, and the section."""
    for name, page in others.items():
        for section in _sections(page):
            if _title(section) == title:
                return name, section
    return "", None


def _anchor(title: str) -> str:
    """Return the anchor that Markdown renderers give to a heading."""
    return title.strip("# ").lower().replace(" ", "-")


def _sections(page: str) -> list[str]:
    """Divide a page before each heading of the second or third level."""
    return [section for section in re.split(r"(?m)^(?=###? )", page) if section]


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
    return [block for block in left if block]


def _differing_rows(block: str, others: Sequence[str]) -> str:
    """Return how a table differs from another one with the same head; any other block unchanged."""
    own = read_table(block)
    for other in map(read_table, others):
        if own and other and own.head == other.head and _is_in_order(own, other):
            return _difference(own, other)
    return block


def read_table(block: str) -> Table | None:
    """Return the table of a block, None if it is no table."""
    if not block.startswith("|"):
        return None
    head, _, *lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.split("\n")]
    name = _column_of_names(head)
    return Table(head, {cells[name]: cells for cells in lines})


def _column_of_names(head: Sequence[str]) -> int:
    """Return which column has the names of the rows."""
    return 1 if head[0] == "Num" and head[1] == "Observation" else 0


def _is_in_order(own: Table, other: Table) -> bool:
    """True if tables share at least half of their rows, in the same order; where rows are numbered, these
    come first."""
    both = [name for name in other.rows if name in own.rows]
    names = list(own.rows)
    if own.head[0] == "Num":
        names = names[: len(both)]
    return 2 * len(both) >= len(own.rows) and [name for name in names if name in both] == both


def _difference(own: Table, other: Table) -> str:
    """Return the names that a table lacks, and its rows that differ."""
    names = _column_of_names(own.head)
    lacking = [name for name in other.rows if name not in own.rows]
    added = [cells for name, cells in own.rows.items() if name not in other.rows]
    changed = {name: cells for name, cells in own.rows.items() if name in other.rows}
    compared = range(names, len(own.head))  # numbers follow from the order
    differing = {
        name: cells
        for name, cells in changed.items()
        if any(cells[k] != other.rows[name][k] for k in compared)
    }
    shown = list(range(len(own.head)))
    if not added:
        rows = differing.items()
        shown = [k for k in compared if k == names or any(c[k] != other.rows[n][k] for n, c in rows)]
    parts = [f"Without {', '.join(lacking)}."] if lacking else []
    head, *lines = [[cells[k] for k in shown] for cells in (own.head, *differing.values(), *added)]
    if lines:
        parts += [ROWS, markdown_table(head, lines)]
    return "\n\n".join(parts)
