"""Marked blocks of the pages of docs/environments, which data fill.

A block lies between `<!-- manual TABLE NAME -->` and `<!-- end TABLE -->`. It holds a table of `TABLES` for
the id `hoof_env/NAME-v0`, or with `<!-- manual TABLE NAME besides OTHER -->` its rows that OTHER lacks or
has in another form. Everything outside the blocks is written by hand.
"""

from __future__ import annotations

import re
from pathlib import Path

from docs._manual import results, tables
from hoof_env._output import markdown_table
from hoof_env.envs.manual import Table
from hoof_env.errors import DataFileError

PAGES = Path(__file__).parents[1] / "environments"

TABLES = tables.TABLES | {"returns": results.returns, "ids": results.ids}

BLOCK = re.compile(
    r"(?P<begin><!-- manual (?P<table>\w+)(?: (?P<name>\w+))?(?: besides (?P<other>\w+))? -->\n)"
    r".*?(?P<end><!-- end (?P=table) -->)",
    re.DOTALL,
)


def content(table: str, name: str = "", other: str = "") -> str:
    """Return the content of a block in Markdown.

    Args:
        table: name in `TABLES`.
        name: name of an id without namespace and version.
        other: name of another id, with whose table it is compared; "" for the whole table.

    Raises:
        DataFileError: there is no such table.
    """
    if table not in TABLES:
        raise DataFileError(f"mark: expected one of {', '.join(TABLES)}, got {table!r}")
    own = TABLES[table](name)
    if not isinstance(own, Table):
        return own
    if not other:
        return markdown_table(*own)
    base = TABLES[table](other)
    assert isinstance(base, Table)
    lacking, rest = tables.difference(own, base)
    parts = [f"Without {', '.join(lacking)}."] if lacking else []
    parts += ["Rows that differ:", markdown_table(*rest)] if rest.rows else []
    return "\n\n".join(parts)


def filled(page: str) -> str:
    """Return a page with the present content of all its blocks.

    Raises:
        DataFileError: a mark without its end, or of an unknown table.
    """
    if page.count("<!-- manual ") != len(BLOCK.findall(page)):
        raise DataFileError("page: expected `<!-- end TABLE -->` after each `<!-- manual TABLE NAME -->`")

    def fill(found: re.Match[str]) -> str:
        text = content(found["table"], found["name"] or "", found["other"] or "")
        return f"{found['begin']}\n{text}\n\n{found['end']}"

    return BLOCK.sub(fill, page)
