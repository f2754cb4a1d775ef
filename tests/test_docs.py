"""What pages say of the repository is true: links lead somewhere, commands and files exist, examples run."""

import json
import re
from importlib import import_module
from pathlib import Path

import pytest

from hoof_env.cli import COMMANDS
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.reward import check_weights
from tests.test_rooms import FLOORS

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("agents", "benchmarks", "docs", "examples", "hoof_env", "results", "scripts", "studies", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))])
LIVE = [page for page in PAGES if not {"evidence", "studies"} & {*page.parts}]
"""Frozen pages name the commands of their commits."""
HAND_WRITTEN = (
    "agents", "contexts", "decisions", "elasticity", "engine", "help", "hop", "horse", "jax", "look_inside",
    "own_task", "paper", "parameters", "project", "seeing", "start", "task", "view",
)  # fmt: skip
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
EXAMPLES = [
    page
    for page in (
        ROOT / "README.md",
        *sorted((ROOT / "docs").glob("*.md")),
        *sorted((ROOT / "docs/api").glob("*.md")),
    )
    if page.stem != "own_task" and "```python" in page.read_text(encoding="utf-8")
]
"""Pages whose code this file runs; the tests of tasks and legs of one's own run the code of own_task."""

LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^( {4}|```).*?$|`[^`\n]*`", re.MULTILINE)


def name(page):
    return page.relative_to(ROOT).as_posix()


def anchors(text):
    """What GitHub calls the headings of a page."""
    heads = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def broken(page):
    """Relative links and images of a page whose file or heading is not there."""
    for link in LINK.findall(CODE.sub("", page.read_text(encoding="utf-8"))):
        place, _, anchor = link.partition("#")
        target = page.parent / place if place else page
        if re.match(r"[a-z]+:", link):
            continue
        if not target.exists() or (anchor and anchor not in anchors(target.read_text(encoding="utf-8"))):
            yield link


def is_command(module):
    return module.with_suffix(".py").is_file() or (module / "__main__.py").is_file()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    assert not list(broken(page))


@pytest.mark.parametrize("page", LIVE, ids=name)
def test_commands_and_files_exist(page):
    text = page.read_text(encoding="utf-8")
    modules = set(re.findall(r"python -m ((?:agents|benchmarks|docs|hoof_env|tests)[\w.]*\w)", text))
    assert not {one for one in modules if not is_command(ROOT / one.replace(".", "/"))}
    commands = set(re.findall(r"(?:`|bin/)hoof-env ([a-z]+)\b(?![^.:]{0,60}\sof commit)", text))
    assert not commands - set(COMMANDS)
    files = set(
        re.findall(r"`((?:agents|benchmarks|docs|examples|hoof_env|scripts|tests)/[\w./-]+\.\w+)`", text)
    )
    assert not {file for file in files if not (ROOT / file).is_file()}


@pytest.mark.parametrize("page", EXAMPLES, ids=name)
def test_examples_run_from_top_to_bottom(page, tmp_path, monkeypatch):
    if page.stem == "jax":
        pytest.importorskip("jax", reason="jax is no part of the environment of set-up: make test-jax")
    monkeypatch.chdir(tmp_path)
    blocks = [code for kind, code in BLOCK.findall(page.read_text(encoding="utf-8")) if kind == "python"]
    exec(compile("\n".join(blocks), name(page), "exec"), {})


def test_files_that_compare_reads_are_made_on_the_page():
    text = (ROOT / "docs" / "task.md").read_text(encoding="utf-8")
    made = set(re.findall(r"hoof-env export --out (\S+)", text)) | {"lab.csv"}  # which is the reader's
    read = {name for pair in re.findall(r"hoof-env compare (\S+) (\S+)", text) for name in pair}
    assert read
    assert not read - made


def test_the_weights_on_the_page_of_the_task_agree_with_the_code():
    text = (ROOT / "docs" / "task.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| `(\w+)` \| ([\d.]+) per ", text, re.MULTILINE))
    assert {name: float(weight) for name, weight in told.items()} == check_weights(None)
    rail = json.loads(re.search(r"^weights = (\{.+\})$", text, re.MULTILINE)[1])
    assert check_weights(rail) == check_weights(TASKS["rail"].settings({}).reward_weights)


def test_every_equation_that_the_code_quotes_is_on_the_page_of_the_engine():
    tags = re.findall(r"\\tag\{(E\d)\}", (ROOT / "docs" / "engine.md").read_text())
    code = "".join(path.read_text() for path in (ROOT / "hoof_env" / "dynamics").glob("*.py"))
    assert tags == [f"E{n}" for n in range(1, 10)]
    assert set(re.findall(r"\((E\d+)\)", code)) == set(tags)


def test_contributing_lists_the_rooms_of_the_house():
    """In the order of tests/test_rooms.py, by the names that the page has for rooms."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = text.partition("| part of `hoof_env` |")[2].partition("\n\n")[0].splitlines()[2:]
    told = [name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])]
    names = [Path(room).stem for floor in FLOORS for room in floor if room.startswith("hoof_env/")]
    others = ("constants", "errors")
    inner = [name for name in names if not name.startswith("_") and name not in others]
    assert told == sorted(set(inner), key=lambda name: inner.index(name))


def test_every_call_of_posix_is_in_the_table_of_contributing():
    """What the table lists is searched for in the code, and where it is found must be told."""
    rows = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("| call |")[2].splitlines()
    for call in (
        "os.sched_getaffinity",
        "os.kill",
        "os.fork",
        "os.killpg",
        "fcntl.flock",
        "resource.getrusage",
    ):
        files = {
            name(path)
            for folder in ("agents", "benchmarks", "hoof_env", "scripts")
            for path in (ROOT / folder).rglob("*.py")
            if f"{call}(" in path.read_text(encoding="utf-8")
        }
        told = " ".join(row for row in rows if f"`{call}`" in row)
        assert not {file for file in files if f"`{file}`" not in told}, call


def test_the_hand_written_pages_are_in_the_readme():
    assert {page.stem for page in (ROOT / "docs").glob("*.md")} - {"index"} == set(HAND_WRITTEN)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert not [page for page in HAND_WRITTEN if f"](docs/{page}.md)" not in readme]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_has_one_title_and_its_images_have_texts(page):
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    assert len(re.findall(r"^# ", text, re.MULTILINE)) == 1
    assert "![](" not in text


def test_the_api_has_the_bases_of_its_classes():
    """Inherited methods stand with the base that has them, and Sphinx refuses a page that lacks one."""
    text = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "api").glob("*.md"))
    names = re.findall(r"^\.\. autoclass:: (\S+)", text, re.MULTILINE)
    classes = [getattr(import_module(module), name) for module, _, name in (n.rpartition(".") for n in names)]
    bases = {base for each in classes for base in each.__bases__ if base.__module__.startswith("hoof_env")}
    assert bases <= {*classes}, bases - {*classes}


def test_every_frozen_page_says_of_which_commit_it_is():
    table = (ROOT / "docs/evidence/README.md").read_text(encoding="utf-8")
    for page in sorted((ROOT / "docs/evidence").glob("*.md")):
        if page.name not in (
            "README.md",
            "ecosystem.md",
            "front.md",
            "costs.md",
            "hop.md",
            "jax.md",
            "seeing.md",
            "softness.md",
            "swaps.md",
            "horse_gaits.md",
            "horse_forces.md",
            "gait_change.md",
            "hips.md",
            "canter.md",
            "horse_learning.md",
        ):  # commands write these
            stamp = page.read_text(encoding="utf-8").split("\n")[2]
            commit = re.match(
                r"> \*\*Frozen evidence, not regenerated\.\*\* Data of commit `(\w{7})`, about .", stamp
            )
            assert commit, page
            assert f"`{commit[1]}`" in next(row for row in table.split("\n") if f"]({page.name})" in row)


def test_it_can_fail(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# One head\n[a](none.md) [b](page.md#one-head) [c](#two) `[d](no.md)` [e](https://x.org)\n"
    )
    assert list(broken(page)) == ["none.md", "#two"]


def test_the_examples_of_side_by_side_numbers_run():
    text = (ROOT / "hoof_env/simd/README.md").read_text(encoding="utf-8")
    space = {"__name__": "page"}
    exec("\n".join(code for kind, code in BLOCK.findall(text) if kind == "python"), space)
    assert (space["balls"][space["Ball"].rows("bounces")] == 2.0).all()
    assert space["motion"]["toe_normal"].max() > 0


def test_the_landing_on_the_page_is_the_one_that_its_code_prints(capsys):
    blocks = BLOCK.findall((ROOT / "docs" / "look_inside.md").read_text(encoding="utf-8"))
    exec("\n".join(code for kind, code in blocks if kind == "python"), {})
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 21
    (told,) = (code.splitlines() for kind, code in blocks if kind == "text" and code.startswith("toe"))
    shown = [line for line in told if line != "..."]
    assert len(shown) >= 6
    assert [line for line in printed if line in shown] == shown
