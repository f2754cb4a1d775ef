"""Pages of the manual refer to that of HorseLeg and lose nothing by it."""

import re
from pathlib import Path

import gymnasium as gym
import pytest

from hoof_env.envs import manual
from hoof_env.envs.manual_common import without_common
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


@pytest.mark.parametrize("task", OTHERS)
def test_what_a_page_lacks_stands_in_the_section_that_it_refers_to(task):
    name = TASKS[task].name
    whole, short = lines_by_heading(manual.page(task)), lines_by_heading(read(name))
    common = lines_by_heading(manual.page("leg").replace("/HorseLeg-v0", f"/{name}-v0"))
    assert list(whole) == list(short)
    for heading, lines in whole.items():
        missing = [line for line in lines if line not in short[heading]]
        assert not [line for line in missing if line not in common[heading]], heading
        if missing:
            anchor = heading.strip("# ").lower().replace(" ", "-")
            assert short[heading][0].startswith(f"As in [HorseLeg](HorseLeg.md#{anchor})")


def tables(lines):
    """Rows of the tables among lines by head and first cell."""
    found, rows = {}, {}
    for number, line in enumerate(lines):
        if line.startswith("|") and number + 1 < len(lines) and lines[number + 1].startswith("|---"):
            found[line] = rows = {}
        elif line.startswith("|") and not line.startswith("|---"):
            rows[line.split("|")[1]] = line
    return found


@pytest.mark.parametrize("task", OTHERS)
def test_rows_that_are_listed_replace_those_of_the_other_page(task):
    """Both pages together have the whole table, and no row that is not in it."""
    name = TASKS[task].name
    whole, short = lines_by_heading(manual.page(task)), lines_by_heading(read(name))
    common = lines_by_heading(read("HorseLeg"))
    for heading, lines in short.items():
        if lines and lines[0].startswith("As in "):
            others, own = tables(common[heading]), tables(lines)
            for head, rows in tables(whole[heading]).items():
                listed = own.get(head, {})
                assert listed == rows or others[head] | listed == rows


@pytest.mark.parametrize("task", [task for task in OTHERS if TASKS[task].body is OneLeg])
def test_a_page_lists_the_settings_that_are_not_those_of_horse_leg(task):
    own, usual = (to_json(gym.make(TASKS[one].id).unwrapped.settings) for one in (task, "leg"))
    arguments = lines_by_heading(read(TASKS[task].name))["## Arguments"]
    listed = {row.split("|")[1].strip(" `") for row in arguments if row.startswith("| `")}
    assert listed == {name for name in own if own[name] != usual[name]}


PAGE = "# {name}\n\nfilm\n\n## A\n\none\n\n{a}\n\n## B\n\n{b}\n"
TABLE = "| Name | Default |\n|---|---|\n"


def shortened(own, other):
    return without_common(PAGE.format(name="Own", **own), "Other", PAGE.format(name="Other", **other))


def test_equal_paragraphs_rows_and_code_go():
    code = "```python\nx = 1\n\ny = 2\n```"
    page = shortened(
        {"a": code, "b": TABLE + "| x | 1 |\n| y | 2 |\n| z | 3 |"},
        {"a": code, "b": TABLE + "| x | 1 |\n| y | 1 |"},
    )
    assert page == (
        "# Own\n\nfilm\n\n## A\n\nAs in [Other](Other.md#a).\n\n"
        "## B\n\nAs in [Other](Other.md#b), but for:\n\n" + TABLE + "| y | 2 |\n| z | 3 |\n"
    )


def test_what_the_other_page_has_beyond_is_not_claimed():
    own = {"a": "two", "b": TABLE + "| x | 1 |"}
    page = shortened(own, {"a": "two\n\nthree", "b": TABLE + "| x | 1 |\n| y | 1 |"})
    assert page == (
        "# Own\n\nfilm\n\n## A\n\none\n\ntwo\n\n## B\n\nAs in [Other](Other.md#b), but for:\n\n"
        + own["b"]
        + "\n"
    )


def test_a_section_of_its_own_stays():
    page = without_common("# Own\n\n## C\n\none\n", "Other", "# Other\n\n## D\n\none\n")
    assert page == "# Own\n\n## C\n\none\n"
