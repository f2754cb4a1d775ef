"""The manual pages say what the environments do, and the committed ones are those that the command writes."""

from __future__ import annotations

import inspect
import json
import math
import re
import shutil
from dataclasses import fields
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, OTHER, scaled

from hoof_env import cli
from hoof_env.envs import manual, manual_bodies, manual_words, shipped
from hoof_env.envs.manual import TABLES
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.errors import ParameterError
from hoof_env.gait import LIMITS, WIDEST, load_gait
from hoof_env.tasks import horse
from hoof_env.tasks.horse import OPTIONS as HORSE_OPTIONS
from hoof_env.tasks.horse_gaits import FASTEST, LEGS
from hoof_env.tasks.leg_starts import OPTIONS
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.parameters import HILLS
from hoof_env.tasks.plain import to_json
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.reward import BEARING, LONGEST_STRIDE
from hoof_env.tasks.settings import PER_EPISODE, Settings

HORSES = "horse", "rough"  # pages of a horse

ROOT = Path(__file__).parents[2]
DOCS, POLICIES = ROOT / "docs" / "environments", ROOT / "agents" / "policies"
OF_LEGS = [name for name, task in TASKS.items() if task.body is OneLeg]

IDS = {page: re.search(r'gym.make\("(.+?)"', manual.page(page))[1] for page in manual.PAGES}


def section(page, title):
    return re.split(r"\n## ", page.split(f"\n## {title}\n", 1)[1])[0]


def rows(text):
    """Cells of the first table of a text, without its head."""
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("|"))
    table = lines[first + 2 :]
    stop = next((k for k, line in enumerate(table) if not line.startswith("|")), len(table))
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table[:stop]]


def numbers(cell):
    """Numbers of a cell of the column Num: one, several, or those of four legs, as in "50+4i"."""
    found = []
    for part in cell.split(", "):
        first, _, step = part.partition("+")
        found.append([int(first) + i * int(step.strip("i") or 1) for i in range(4)] if step else [int(first)])
    return found


def observed(page):
    """Cells of a page's observation: those of each number, in their order, without the column Num."""
    cells = {}
    for row in rows(section(page, "Observation Space")):
        for name, places in zip(row[1].split(", "), numbers(row[0]), strict=True):
            cells |= {place: [name, *row[2:]] for place in places}
    return [cells[k] for k in sorted(cells)]


def test_every_id_has_a_page():
    assert sorted(IDS.values()) == sorted(name for name in gym.registry if name.startswith("hoof_env/"))


def test_committed_pages_are_what_the_command_writes(tmp_path, capsys, monkeypatch):
    shutil.copytree(POLICIES, tmp_path / "agents/policies", ignore=shutil.ignore_patterns("*.onnx", "*.png"))
    monkeypatch.chdir(tmp_path)
    out = Path("docs/environments")
    assert cli.main(["manual", "--out", str(out), "--films", "agents/policies"]) == 0
    assert f"{len(manual.PAGES) + 3} files written; read {out / 'README.md'} first" in capsys.readouterr().out
    written = {file.name: file.read_text("utf-8") for file in out.iterdir()}
    committed = {file.name: file.read_text("utf-8") for file in DOCS.glob("*.md")}
    assert written == committed, "run `hoof-env manual --out docs/environments --films agents/policies`"


@pytest.mark.parametrize("page", manual.PAGES)
def test_every_page_shows_its_film(page):
    name = IDS[page].removeprefix("hoof_env/").removesuffix("-v0")
    (told, film) = re.search(r"!\[(.+?)\]\((.+?)\)", (DOCS / f"{name}.md").read_text("utf-8")).groups()
    # HorseLegMO has the agent of HorseLeg, and its film.
    assert told.startswith(f"{'HorseLeg' if page == 'mo' else name}, the shipped agent")
    assert ("footfall" in told) == (page in HORSES) == ("gait parameters" not in told)
    policy = "HorseLeg-v0" if page == "mo" else f"{name}-v0"
    assert film == f"../../agents/policies/{policy}/film.gif"
    assert (DOCS / film).is_file()
    assert "![" not in manual.page(page)


@pytest.mark.parametrize("page", manual.PAGES)
def test_every_page_says_which_returns_are_good(page):
    """Those of the table of the policies that ship."""
    name = "HorseLeg" if page == "mo" else IDS[page].removeprefix("hoof_env/").removesuffix("-v0")
    words = "the mean over 100:" if name == "HorseLegFixed" else "over the same 100 episodes"
    text = (DOCS / f"{name}.md").read_text("utf-8").partition(words)[2]
    head = next(line for line in text.splitlines() if line.startswith("|")).strip("|").split("|")
    told = dict(zip(map(str.strip, head), *rows(text)[:1], strict=True))
    table = rows((POLICIES / "README.md").read_text("utf-8").partition("mean returns")[0])
    shipped = next(row for row in table if f"/{name}-v0`" in row[0])[2]
    assert told["shipped agent"] == f"{float(shipped.split()[0]):.3g}"
    others = json.loads((POLICIES / "returns.json").read_text("utf-8"))[f"hoof_env/{name}-v0"]
    assert told["random actions"] == f"{others['random']:.3g}"
    stock = next((value for title, value in told.items() if "stock PPO" in title), None)
    assert stock == (f"{others['stock']:.3g}" if "stock" in others else None)


def test_a_policy_without_scores_is_named(tmp_path, capsys, monkeypatch):
    shutil.copytree(POLICIES / "HorseLeg-v0", tmp_path / "HorseLeg-v0")
    (tmp_path / "HorseLeg-v0" / "score.json").write_text("{}")
    monkeypatch.setattr(shipped, "SHIPPED", tmp_path)
    assert cli.main(["manual", "--out", str(tmp_path / "out"), "--films", str(tmp_path)]) == 2
    assert "score.json: expected those that agents.ship writes" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_policy_without_a_film_is_named(tmp_path, capsys):
    assert cli.main(["manual", "--out", str(tmp_path / "out"), "--films", str(tmp_path)]) == 2
    assert f"films {tmp_path}: expected HorseLeg-v0/film.gif" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_page_is_printed(capsys):
    assert cli.main(["manual", "--env-id", IDS["rail"]]) == 0
    assert capsys.readouterr().out.strip() == manual.page("rail").strip()


def test_unknown_pages_and_folders_are_one_line(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert cli.main(["manual", "--env-id", "HorseLeg"]) == 2
    assert cli.main(["manual", "--out", str(tmp_path / "file")]) == 2
    assert capsys.readouterr().err.count("hoof-env: error: ") == 2
    with pytest.raises(ParameterError, match=r"task: expected one of .*rail"):
        manual.page("trot")


@pytest.mark.parametrize("page", manual.PAGES)
def test_tables_match_the_spaces(page):
    text, env = manual.page(page), gym.make(IDS[page])
    for space in (env.action_space, env.observation_space):
        assert space.dtype == np.float32
        assert (space.low == -1).all()
        assert (space.high == 1).all()
    if page == "mo":  # whose spaces are the leg's
        return
    assert f"`Box(-1, 1, {env.action_space.shape}, float32)`" in section(text, "Action Space")
    assert f"`Box(-1, 1, {env.observation_space.shape}, float32)`" in section(text, "Observation Space")
    legs = "|".join(leg.replace("_", " ") for leg in LEGS)
    names = [re.sub(rf"({legs})[:,] ", "", name) for name in env.unwrapped.observation_names]
    assert [cells[0] for cells in observed(text)] == names
    assert len(names) == env.observation_space.shape[0]


@pytest.mark.parametrize("page", OF_LEGS)
def test_actions_change_the_gait_as_the_table_says(page):
    """From one end of the limits to the other, at the rates of the table once the filters follow."""
    env = gym.make(IDS[page], episode_seconds=4.0)
    leg = env.unwrapped
    table = rows(section(manual.page(page), "Action Space"))
    limits = np.array([re.fullmatch(r"(\S+) to (\S+) \S+", row[5]).groups() for row in table], float)
    assert limits == pytest.approx(np.array(list(LIMITS.values())), rel=1e-4)
    for column, end, action in ((2, 0, -1.0), (3, 1, 1.0)):
        rates, gaits = np.array([float(row[column]) for row in table]), []
        env.reset(seed=0, options={"gait": dict(zip(LIMITS, limits[:, 1 - end], strict=True))})
        for _ in range(150):
            _, _, failed, _, info = env.step(np.full(4, action, np.float32))
            assert not failed
            gaits.append([info["measured"][name] for name in LIMITS])
        assert (np.array(gaits[30]) - gaits[25]) / (5 * leg.dt) == pytest.approx(rates, rel=0.02)
        assert gaits[-1] == pytest.approx(limits[:, end], abs=1e-3)
    assert [row[4] for row in table] == ["rad/s^2", "rad/s", "rad/s", "rad/s"]


def test_offsets_of_a_horse_are_those_of_the_table():
    """The commands under ones, once offsets have followed, beside those of the same moment without offsets;
    cranks at the same angles."""
    env = gym.make(HORSE)
    leg = env.unwrapped
    text = section(manual.page("horse"), "Action Space")
    table = rows(text)
    env.reset(seed=0, options={"target_speed": 2.0})
    state, commands, followed = leg.get_state(), {}, float(re.search(r"moves ([\d.]+) of the way", text)[1])
    for action in (0.0, -1.0, 1.0):
        leg.set_state(state)
        info = env.step(np.full(16, action, np.float32))[4]
        commands[action] = np.array([info["measured"][f"left_hind_command_{name}"] for name in LIMITS])
    for column, action in ((3, -1.0), (4, 1.0)):
        said = followed * np.array([float(row[column]) for row in table])
        found = commands[action] - commands[0.0]
        found[0] /= commands[0.0][0]
        assert found == pytest.approx(said, rel=1e-6)
    raw = leg.raw_observation()
    assert raw["offset: left hind, swing offset"] == pytest.approx(followed)


@pytest.mark.parametrize("page", OF_LEGS)
def test_observations_are_scaled_as_the_table_says(page):
    env = gym.make(IDS[page])
    leg = env.unwrapped
    env.reset(seed=5, options={"speed": 1.0} if leg.settings.trunk != "fixed" else {})
    leg.record()
    table = {cells[0]: cells[1] for cells in observed(manual.page(page))}
    checked, landed, allowance = set(), False, BEARING * LONGEST_STRIDE
    for _ in range(60):
        observation, *_, info = env.step(leg.action_for(load_gait("run", leg.settings.preset)))
        measured = info["measured"]
        allowance = min(allowance + BEARING * leg.dt, BEARING * LONGEST_STRIDE)
        allowance -= min(allowance, measured["normal_impulse"] / leg.weight)
        now = {name: float(values[-1].ravel()[0]) for name, values in leg.record().items()}
        there = {
            "forward speed": now["vx"], "vertical speed": now["vy"], "height": now["y"],
            "toe load": now["toe_normal"], "heel load": now["heel_normal"],
            "toe contact": now["toe_penetration"] > 0, "heel contact": now["heel_penetration"] > 0,
            "crank speed": now["crank_speed"], "swing offset": now["swing_offset"],
            "swing sine coefficient": now["swing_sin"], "swing cosine coefficient": now["swing_cos"],
            "rate of crank speed": now["crank_speed_rate"], "rate of swing offset": now["swing_offset_rate"],
            "rate of swing sine coefficient": now["swing_sin_rate"],
            "rate of swing cosine coefficient": now["swing_cos_rate"],
            "sin(crank angle)": math.sin(now["crank_angle"]),
            "cos(crank angle)": math.cos(now["crank_angle"]),
            "bearing allowance": allowance, "running peak force": measured["running_peak"],
            "steepest rise of the force": measured["steepest_rise"],
        }  # fmt: skip
        for point in ("toe", "heel"):
            slowness = now[f"{point}_inverse_approach_speed"]
            there[f"{point} approach speed"] = 1 / slowness if slowness > 0 else 0.0
        ground = leg.terrain.height_at(now["x"])
        for name in table:
            if ahead := re.match(r"height of the ground ([\d.]+) m ahead", name):
                there[name] = float(leg.terrain.height_at(now["x"] + float(ahead[1])) - ground)
        landed |= bool(there["heel contact"])
        for place, (name, scaling) in enumerate(table.items()):
            if name in there:
                checked.add(name)
                expected = scaled(scaling, float(there[name]), leg)
                assert observation[place] == pytest.approx(expected, abs=2e-6), name
    assert landed
    assert set(table) - checked <= {"commanded speed"}


@pytest.mark.parametrize("page", TASKS)
def test_every_setting_is_documented_with_its_default(page):
    made = gym.make(IDS[page]).unwrapped.settings
    table = rows(section(manual.page(page), "Arguments"))
    *settings, render_mode, width, height = [(row[0].strip("`"), row[1].strip("*")) for row in table]
    assert [render_mode, width, height] == [("render_mode", "None"), ("width", "960"), ("height", "540")]
    names = [name for name, _ in settings]
    assert names == [item.name for item in fields(Settings) if page not in HORSES or item.name in names]
    for name, value in settings:
        assert eval(value) == to_json(made)[name], name
    bold = {row[0].strip("`") for row in table if row[1].startswith("**")}
    assert bold == set(TASKS[page].defaults) & set(names)


CHANGED = OTHER | {
    "preset": "identified", "gait": "walk", "trunk": "rail", "hip_height": 1.5, "normal_law": "flores",
    "friction_law": "tanh", "hoof_stiffness": 2e4, "hoof_damping": 900.0, "terrain": {"kind": "slope"},
    "drive": "motor", "solver": "paper", "baumgarte_alpha": 10.0, "baumgarte_beta": 10.0,
    "integrator": "rk3", "sim_dt": 5e-4, "dt": 0.01, "episode_seconds": 5.0, "target_speed": 2.0,
    "target_seconds": (1.0, 2.0), "observation": ("crank",), "reward_weights": {"peak": 2.0},
    "constants": {"free": 1.0}, "schedule": {"strength": [0.0, 1.0, 5]},
    "randomize": {"friction": 0.5}, "noise": {"trunk": 0.1}, "bias": {"trunk": 0.1}, "push_impulse": 9.0,
    "push_seconds": (1.0, 2.0), "pushes": [[1.0, 9.0, 0.0]], "strength": 0.5, "observation_delay": 1.0,
    "action_delay": 1.0, "observation_history": 2, "last_actions": 1, "privileged": ["trunk"],
}  # fmt: skip
BESIDE = {name: {"drive": "motor"} for name in ("motor_gain", "motor_torque", "motor_inertia")} | {
    f"friction_{name}": {"hoof_stiffness": None} for name in ("law", "slow", "fast")
}
BESIDE["push_seconds"] = {"push_impulse": 9.0}


def test_the_page_of_the_horse_lists_what_a_horse_takes():
    """Each setting with another value than the default, beside what it needs."""
    listed = {row[0].strip("`") for row in rows(section(manual.page("horse"), "Arguments"))}
    for name in (item.name for item in fields(Settings)):
        try:
            TASKS["horse"].settings(given := {name: CHANGED[name]} | BESIDE.get(name, {}))
            if name in ("trunk", "hip_height", "solver"):
                gym.make(HORSE, **given)
            is_taken = True
        except ParameterError:
            is_taken = False
        assert is_taken == (name in listed), name


def test_the_page_of_the_horse_has_the_numbers_of_the_code(monkeypatch):
    """One that is written down instead would not follow."""
    for name, value in (
        ("PHASE_SPREAD", 0.0123), ("PITCH_SPREAD", 0.0234), ("SPEED_SPREAD", 0.345), ("PITCH", 0.456),
        ("HEIGHT", (0.567, 1.678)), ("CLEARANCE", 0.0789), ("MASS", 489.0),
    ):  # fmt: skip
        monkeypatch.setattr(horse, name, value)
    tables = manual_words.tables()
    for module in (manual, manual_bodies, manual_words):
        monkeypatch.setattr(module, "TABLES", tables)
    monkeypatch.setattr(manual, "WORDS", tables["words"])
    page = manual.page("horse")
    start, end = section(page, "Starting State"), section(page, "Episode End")
    assert "within 0.0123 strides of it, pitch within 0.0234 rad" in start
    assert "34.5 % up or down" in start
    assert "more than 0.456 rad or leaves 0.567 to 1.678 m over" in end
    assert "than 7.89 cm" in end
    assert "under a fourth of 489 kg" in section(page, "Arguments")


def test_the_page_of_the_horse_says_where_commands_are_clipped():
    limits = manual.page("horse").partition("### Limits of Commands")[2].replace("\n", " ")
    assert f"the crank's speed to 0 to {FASTEST:g} rad/s at `size` 1" in limits
    for name in ("swing_offset", "swing_sin", "higher"):
        low, high = WIDEST[name]
        assert f"{low:g} to {high:g} rad" in limits
    assert WIDEST["swing_sin"] == WIDEST["swing_cos"]  # the page says one range of both


def test_sentences_are_apart():
    for page in manual.PAGES:
        prose = re.sub(r"```.*?```|`[^`\n]*`", "x", manual.page(page), flags=re.DOTALL)
        assert not re.findall(r"[a-z]{3}\.[A-Z]\w* \w+", prose)


def test_the_tables_have_what_there_is_and_nothing_else():
    assert list(TABLES["settings"]) == [item.name for item in fields(Settings)]
    assert set(TABLES["options"]) == {"gait", "parameters", "pushes", *OPTIONS}
    assert list(TABLES["hills"]) == list(HILLS)
    known = inspect.signature(HorseLegVectorEnv).parameters
    assert set(TABLES["vector"]) == {*known} - {"num_envs", "task"} - set(TABLES["settings"])
    assert all(meaning for table in (TABLES["settings"], TABLES["options"]) for _, meaning in table.values())


@pytest.mark.parametrize("page", TASKS)
def test_rewards_options_and_figures_are_those_of_the_environment(page):
    text, env = manual.page(page), gym.make(IDS[page], episode_seconds=0.02)
    weights = env.unwrapped.batch.weights
    options = HORSE_OPTIONS if page in HORSES else OPTIONS
    _, started = env.reset(seed=0, options={"parameters": {"friction": 0.3}})
    info = env.step(np.zeros(env.action_space.shape, np.float32))[4]
    table = rows(section(text, "Rewards"))
    terms = [row[0].strip("`") for row in table]
    assert [f"reward_{name}" for name in terms] == [name for name in info if name.startswith("reward_")]
    assert [float(row[1]) for row in table] == [weights[name] for name in terms]
    figures = [row[0].strip("`") for row in rows(section(text, "Episode Summary"))]
    assert figures == list(info["episode_summary"])
    told = {f"reward_{name}" for name in terms} | {row[0].strip("`") for row in rows(section(text, "Infos"))}
    assert set(started) == told
    assert set(info) == told - {"parameters"} | {"episode_summary", "end", "is_success"}
    start = section(text, "Reset Options")
    assert {row[0].strip("`") for row in rows(start)} == {*options, "gait", "parameters", "pushes"}
    suspended = {"trunk_share", "trunk_stiffness", "trunk_damping", "trunk_drag"}
    refused = suspended | {"friction_slow", "friction_fast"} if page in HORSES else set()
    for name in PER_EPISODE:
        assert (f"`{name}`" in start) != (name in refused)


@pytest.mark.parametrize("page", manual.PAGES)
def test_examples_run(page):
    blocks = re.findall(r"```python\n(.*?)```", manual.page(page), re.DOTALL)
    assert len(blocks) == (4 if page in TASKS else 1)
    for block in blocks:
        exec(compile(block, page, "exec"), {})


@pytest.mark.parametrize("page", list(TASKS))
def test_every_key_of_infos_and_every_quantity_is_there(page):
    text, env = manual.page(page), gym.make(IDS[page], randomize=None)
    infos, measured = section(text, "Infos").split("### What is Measured")
    _, info = env.reset(seed=0)
    told = [cells[0].strip("`") for cells in rows(infos)]
    assert [key for key in told if key != "parameters"] == [key for key in info if "reward" not in key]
    found = {"both": [], "record": [], "measured": []}
    legs = LEGS if page in HORSES else []
    shown = {re.sub(f"^({'|'.join(LEGS)})_", "", name) for name in info["measured"].names}
    for names, within, unit, _ in rows(measured):
        found[within] += re.findall(r"`(\w+)`", names)
        assert unit
    record = env.unwrapped.record()
    assert sorted(found["both"] + found["record"]) == sorted(record)
    assert sorted(found["both"] + found["measured"]) == sorted(shown)
    assert len(info["measured"].names) == len(set(info["measured"].names))
    assert f"shape\n({len(info['measured'])},)" in measured
    assert {array.shape for array in record.values()} == {(1, 1), (1, max(len(legs), 1), 1)}
