"""The pages of docs/environments say what the environments do; their tables are what data has now."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from docs._manual import blocks, results, tables
from docs._manual.__main__ import main
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.errors import DataFileError
from hoof_env.policies import catalogue
from hoof_env.tasks import horse, leg_starts
from hoof_env.tasks.horse_gaits import LEGS
from hoof_env.tasks.observation import groups_of
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.settings import PER_EPISODE
from hoof_env.tasks.terrains import DITCHES, HILLS

PAGES = sorted(blocks.PAGES.glob("*.md"))
TEXTS = {path.stem: path.read_text(encoding="utf-8") for path in PAGES}
SHARED = "README", "common", "horses"
IDS = [name for name in TEXTS if name not in SHARED]
NAMES = [task.name for task in TASKS.values()]
POLICIES = Path(__file__).parents[1] / "agents" / "policies"


def section(page, title):
    return re.split(r"\n## ", page.split(f"\n## {title}\n", 1)[1])[0]


def names_of(table):
    """Names in the first column."""
    return re.findall(r"`(\w+)`", " ".join(row[0] for row in table.rows))


def test_every_id_has_a_page():
    ids = {name for name in gym.registry if name.startswith("hoof_env/")}
    assert {f"hoof_env/{name}-v0" for name in IDS} == ids


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_tables_are_what_data_has_now(path):
    page = path.read_text(encoding="utf-8")
    assert blocks.BLOCK.search(page)
    for found in blocks.BLOCK.finditer(page):
        name, other = found["name"] or "", found["other"] or ""
        now = blocks.content(found["table"], name, other)
        assert now in found[0], f"{path.name}, {found['table']}: run `python -m docs._manual`"


def test_the_command_fills_blocks_and_leaves_the_text(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("docs._manual.__main__.PAGES", tmp_path)
    page = tmp_path / "page.md"
    page.write_text("# Text\n\n<!-- manual rewards HorseLeg -->\nold\n<!-- end rewards -->\nmore\n")
    assert main(["--check"]) == 1
    assert "old" in page.read_text()
    assert main([]) == 0
    text = page.read_text()
    assert text.startswith("# Text\n\n<!-- manual rewards HorseLeg -->\n\n| Term | Weight |")
    assert text.endswith("\n\n<!-- end rewards -->\nmore\n")
    assert main(["--check"]) == 0
    assert capsys.readouterr().out.count("page.md") == 2
    assert main(["--out"]) == 2
    page.write_text("# Text\n\n<!-- manual rewards HorseLeg -->\nold\n")
    assert main([]) == 2
    assert "page.md: page: expected `<!-- end" in capsys.readouterr().err


def test_an_unknown_mark_is_named():
    with pytest.raises(DataFileError, match=r"rewards.*got 'prizes'"):
        blocks.content("prizes", "HorseLeg")


def test_a_compared_table_has_the_rows_and_columns_that_differ():
    base = tables.Table(("Name", "Default", "Unit"), [("x", "1", "m"), ("y", "1", "m"), ("z", "2", "s")])
    changed = tables.Table(base.head, [("x", "1", "m"), ("z", "3", "s")])
    assert tables.difference(changed, base) == (["y"], tables.Table(("Name", "Default"), [("z", "3")]))
    added = tables.Table(base.head, [*base.rows, ("w", "0", "")])
    assert tables.difference(added, base) == ([], tables.Table(base.head, [("w", "0", "")]))


@pytest.mark.parametrize("name", IDS)
def test_a_page_shows_its_film_and_the_returns_of_its_policy(name):
    words, film = re.search(r"!\[(.+?)\]\((.+?)\)", TEXTS[name]).groups()
    policy = "HorseLeg" if name == "HorseLegMO" else name  # which has no policy of its own
    assert words.startswith(f"{policy}, the shipped agent")
    assert film == f"../../agents/policies/{policy}-v0/film.gif"
    assert f"<!-- manual returns {name} -->" in TEXTS[name]
    table = results.returns(name)
    told = dict(zip(table.head, table.rows[0], strict=True))
    others = json.loads((POLICIES / "returns.json").read_text("utf-8"))[f"hoof_env/{name}-v0"]
    assert told["shipped agent"] == f"{catalogue.shipped_returns(f'{policy}-v0')['policy']:.3g}"
    assert told["random actions"] == f"{others['random']:.3g}"
    assert any("stock PPO" in title for title in told) == ("stock" in others)
    assert ("no curve" in TEXTS[name]) == ("stock" not in others)


def test_a_policy_without_scores_is_named(tmp_path, monkeypatch):
    (tmp_path / "HorseLeg-v0").mkdir()
    (tmp_path / "HorseLeg-v0" / "score.json").write_text("{}")
    monkeypatch.setattr(catalogue, "SHIPPED", tmp_path)
    results.returns_of.cache_clear()
    with pytest.raises(DataFileError, match=r"score\.json"):
        results.returns("HorseLeg")
    results.returns_of.cache_clear()


@pytest.mark.parametrize("name", NAMES)
def test_spaces_and_groups_of_a_page_agree_with_the_environment(name):
    """On the page, or on the one that it refers to."""
    env = gym.make(f"hoof_env/{name}-v0")
    place = "Horse" if tables.is_horse(name) else name
    acted = TEXTS[place if "## Action Space" in TEXTS[place] else "HorseLeg"]
    assert f"`Box(-1, 1, {env.action_space.shape}, float32)`" in section(acted, "Action Space")
    place = name if "## Observation Space" in TEXTS[name] else place
    seen = TEXTS[place if "## Observation Space" in TEXTS[place] else "HorseLeg"]
    observed = section(seen, "Observation Space")
    assert f"`Box(-1, 1, {env.observation_space.shape}, float32)`" in observed
    listed = re.search(r"not observed by default: (.+?)\.", observed)
    task = tables.task(name)
    if listed:
        groups = [group for group in groups_of(task.entries) if group not in task.settings({}).observation]
        assert re.findall(r"`(\w+)`", listed[1]) == groups


@pytest.mark.parametrize("name", NAMES)
def test_options_infos_and_quantities_agree_with_the_environment(name):
    env = gym.make(f"hoof_env/{name}-v0", randomize=None, episode_seconds=0.04)
    _, started = env.reset(seed=0, options={"parameters": {"friction": 0.3}})
    while not (step := env.step(np.zeros(env.action_space.shape, np.float32)))[3]:
        pass
    info = step[4]
    costs = ["cost", *env.unwrapped.costs] if env.unwrapped.costs else []
    assert [*names_of(tables.figures(name)), *costs] == list(info["episode_summary"])
    keys = {key for key in started if not key.startswith("reward_")}
    assert {*names_of(tables.infos(name)), *costs} == keys
    options = horse.OPTIONS if tables.is_horse(name) else leg_starts.OPTIONS
    assert set(names_of(tables.options(name))) == {*options, "gait", "parameters", "pushes"}
    found = {"both": [], "record": [], "measured": []}
    for names, within, unit, _ in tables.quantities(name).rows:
        found[within] += re.findall(r"`(\w+)`", names)
        assert unit
    record = env.unwrapped.record()
    measured = {re.sub(f"^({'|'.join(LEGS)})_", "", key) for key in info["measured"].names}
    assert sorted(found["both"] + found["record"]) == sorted(record)
    assert sorted(found["both"] + found["measured"]) == sorted(measured)


@pytest.mark.parametrize("name", NAMES)
def test_parameters_are_those_that_a_reset_takes(name):
    listed = re.findall(r"`(\w+)`", tables.parameters(name))
    suspended = {"trunk_share", "trunk_stiffness", "trunk_damping", "trunk_drag"}
    refused = suspended | {"friction_slow", "friction_fast"} if tables.is_horse(name) else set()
    assert set(listed) == set(PER_EPISODE) - refused


def test_all_names_and_no_more_have_words():
    assert set(tables.WORDS["hills"]) == set(HILLS)
    assert set(tables.WORDS["ditches"]) == set(DITCHES)
    known = inspect.signature(HorseLegVectorEnv).parameters
    arguments = {row[0].strip("`") for row in tables.arguments("HorseLeg").rows}
    vector = set(tables.WORDS["vector"])
    assert vector == {*known} - {"num_envs", "task"} - (arguments - {"render_mode", "width", "height"})
    assert set(tables.WORDS["uses"]) == set(IDS)


def test_bold_defaults_are_the_tasks_own():
    for task in TASKS.values():
        bold = {row[0].strip("`") for row in tables.arguments(task.name).rows if row[1].startswith("**")}
        assert bold == set(task.defaults) & {row[0].strip("`") for row in tables.arguments(task.name).rows}


@pytest.mark.parametrize("name", TEXTS)
def test_examples_run(name):
    for block in re.findall(r"```python\n(.*?)```", TEXTS[name], re.DOTALL):
        exec(compile(block, name, "exec"), {})


def test_every_page_of_an_id_has_an_example_with_its_id():
    for name in IDS:
        assert f'gym.make("hoof_env/{name}-v0")' in TEXTS[name]
