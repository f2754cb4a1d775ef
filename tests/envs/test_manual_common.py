"""Pages of the manual refer to that of HorseLeg and lose nothing by it."""

import re
from pathlib import Path

import gymnasium as gym
import pytest

from hoof_env.envs import manual
from hoof_env.envs.manual_common import REST, ROWS, shared_sections, without_common
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.plain import to_json
from hoof_env.tasks.registry import TASKS

DOCS = Path(__file__).parents[2] / "docs" / "environments"
OTHERS = [task for task in TASKS if task != "leg"]


def lines_by_heading(page):
    """Lines of a page under each of its headings, without blank ones."""
    found, lines = {}, []
    is_code = False
    for line in page.splitlines():
        is_code ^= line.startswith("```")
        if re.match("#+ ", line) and not is_code:
            found[line] = lines = []
        elif line.strip():
            lines.append(line)
    return found


def read(name):
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def others(name):
    """The pages to which a page refers, with its id in their examples."""
    tasks = {task.name: key for key, task in TASKS.items()}
    near = {other: manual.page(tasks[other]) for other in manual.NEAREST.get(name, ())}
    if name in manual.HORSES:
        near["horses"] = manual.page("horse")
    pages = near | {other: read(other) for other in ("HorseLeg", "common") if other != name}
    written = {"common": "HorseLeg", "horses": "Horse"}  # the ids in the examples of shared pages
    return {
        other: page.replace(f"/{written.get(other, other)}-v0", f"/{name}-v0")
        for other, page in pages.items()
    }


def anchor(heading):
    return heading.strip("# ").lower().replace(" ", "-")


@pytest.mark.parametrize("task", TASKS)
def test_what_a_page_lacks_stands_in_the_section_that_it_refers_to(task):
    name = TASKS[task].name
    elsewhere = {other: lines_by_heading(page) for other, page in others(name).items()}
    check_nothing_is_lost(lines_by_heading(manual.page(task)), lines_by_heading(read(name)), elsewhere)


def test_what_horses_share_lacks_nothing():
    page = shared_sections(manual.page("horse"))
    common = read("common").replace("/HorseLeg-v0", "/Horse-v0")
    check_nothing_is_lost(
        {"# What Both Horses Share": [], **lines_by_heading(page)},
        lines_by_heading(read("horses")),
        {"common": lines_by_heading(common)},
    )


def check_nothing_is_lost(whole, short, elsewhere):
    """Raise unless a short page, with the sections that it refers to, has all lines of the whole one."""
    rest = "".join(short.pop(f"## {REST}", []))
    for heading, lines in whole.items():
        own = short.pop(heading, None)
        links = [f"({other}.md#{anchor(heading)})" for other in elsewhere]
        if own is None:
            (other,) = (other for other, link in zip(elsewhere, links, strict=True) if link in rest)
            assert lines == elsewhere[other][heading]
        elif own != lines and heading != next(iter(whole)):
            (other,) = (other for other, link in zip(elsewhere, links, strict=True) if link in own[0])
            common = elsewhere[other][heading]
            assert restored(own, common) == read_tables(lines)
            assert {line for line in lines if not line.startswith("|")} <= {*own, *common}
    assert not short


def restored(lines, common):
    """Tables of a section of which `common` is the section that it refers to."""
    tables = read_tables(common)
    found = {}
    for line in lines:
        if line.startswith("Without "):
            names = line.removeprefix("Without ").removesuffix(".").split(", ")
            tables = {
                head: {name: row for name, row in rows.items() if name not in names}
                for head, rows in tables.items()
            }
    is_merged = ROWS in lines
    for head, rows in read_tables(lines).items():
        known = next((other for other in tables if set(head) <= set(other)), None)
        if is_merged and known:
            for name, cells in rows.items():
                tables[known][name] = tables[known].get(name, {}) | cells
        else:
            found[head] = rows
    return tables | found


def read_tables(lines):
    """Cells of the tables among lines, by head, name of the row and column."""
    found, rows, head = {}, {}, ()
    for number, line in enumerate(lines):
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("|") and number + 1 < len(lines) and lines[number + 1].startswith("|---"):
            head = tuple(cells)
            found[head] = rows = {}
        elif line.startswith("|") and not line.startswith("|---"):
            name = cells[1] if head[:2] == ("Num", "Observation") else cells[0]
            # Numbers follow from the order of the rows.
            rows[name] = {title: cell for title, cell in zip(head, cells, strict=True) if title != "Num"}
    return found


@pytest.mark.parametrize("task", [task for task in OTHERS if TASKS[task].body is OneLeg])
def test_a_page_lists_the_settings_that_are_not_those_of_horse_leg(task):
    own, usual = (to_json(gym.make(TASKS[one].id).unwrapped.settings) for one in (task, "leg"))
    arguments = lines_by_heading(read(TASKS[task].name))["## Arguments"]
    listed = {row.split("|")[1].strip(" `") for row in arguments if row.startswith("| `")}
    assert listed == {name for name in own if own[name] != usual[name]}


PAGE = "# {name}\n\nfilm\n\n## A\n\none\n\n{a}\n\n## B\n\n{b}\n"
TABLE = "| Name | Default |\n|---|---|\n"


def shortened(own, other):
    return without_common(PAGE.format(name="Own", **own), {"Other": PAGE.format(name="Other", **other)})


def test_equal_sections_paragraphs_and_rows_go():
    code = "```python\nx = 1\n\ny = 2\n```"
    page = shortened(
        {"a": code, "b": TABLE + "| x | 1 |\n| y | 2 |\n| z | 3 |"},
        {"a": code, "b": TABLE + "| x | 1 |\n| y | 1 |"},
    )
    assert page == (
        "# Own\n\nfilm\n\n## B\n\nAs in [Other](Other.md#b), except:\n\nRows that differ:\n\n"
        + TABLE
        + "| y | 2 |\n| z | 3 |\n\n## Shared Sections\n\nAs in Other: [A](Other.md#a).\n"
    )


def test_columns_that_are_equal_go_and_rows_that_are_missing_are_named():
    head = "| Name | Default | Unit |\n|---|---|---|\n"
    page = shortened(
        {"a": "two", "b": head + "| x | 1 | m |\n| z | 3 | s |"},
        {"a": "two", "b": head + "| x | 1 | m |\n| y | 1 | m |\n| z | 2 | s |"},
    )
    assert "except:\n\nWithout y.\n\nRows that differ:\n\n| Name | Default |\n|---|---|\n| z | 3 |\n" in page


def test_a_table_of_other_rows_or_in_another_order_stays_whole():
    for rows in ("| a | 1 |\n| b | 2 |", "| y | 1 |\n| x | 1 |"):
        page = shortened({"a": "two", "b": TABLE + rows}, {"a": "two", "b": TABLE + "| x | 1 |\n| y | 1 |"})
        assert f"except:\n\n{TABLE}{rows}\n" in page


def test_what_the_other_page_has_beyond_is_not_claimed():
    page = shortened({"a": "two", "b": "four"}, {"a": "two\n\nthree", "b": "five"})
    assert page == (
        "# Own\n\nfilm\n\n## A\n\none\n\ntwo\n\n## B\n\nAs in [Other](Other.md#b), except:\n\nfour\n"
    )


def test_a_section_of_its_own_stays():
    page = without_common("# Own\n\n## C\n\none\n", {"Other": "# Other\n\n## D\n\none\n"})
    assert page == "# Own\n\n## C\n\none\n"
