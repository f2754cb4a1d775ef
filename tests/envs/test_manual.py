"""The tables that `hoof-env manual` prints are what the environments do."""

from __future__ import annotations

import math
import re
from dataclasses import fields
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, LARGER, OTHER, scaled

import hoof_env
from hoof_env import cli
from hoof_env.envs import manual
from hoof_env.errors import ParameterError
from hoof_env.gait import LIMITS, load_gait
from hoof_env.tasks.horse import LEG_ONLY_SETTINGS, MASS
from hoof_env.tasks.horse_gaits import FOLLOWED, LEGS
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.reward import BEARING, MAX_STRIDE
from hoof_env.tasks.settings import Settings, to_json

HORSES = "horse", "rough", "horse_safe"  # tasks of a horse
OF_LEGS = [name for name, task in TASKS.items() if task.body is OneLeg]


def numbers(cell):
    """Numbers of a cell of the column Num: one, several, or one for each of four legs, as in "50+4i"."""
    found = []
    for part in cell.split(", "):
        first, _, step = part.partition("+")
        found.append([int(first) + i * int(step.strip("i") or 1) for i in range(4)] if step else [int(first)])
    return found


def observed(task):
    """Cells for each number of an observation, in their order, without the column Num."""
    cells = {}
    for row in manual.observations(task).rows:
        for name, places in zip(row[1].split(", "), numbers(row[0]), strict=True):
            cells |= {place: [name, *row[2:]] for place in places}
    return [cells[k] for k in sorted(cells)]


@pytest.mark.parametrize("id", sorted(name for name in gym.registry if name.startswith("hoof_env/")))
def test_the_command_prints_the_tables_of_every_id(id, capsys):
    assert cli.main(["manual", "--env-id", id]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"{id}: ")
    titles = re.findall(r"^(\w+)$", printed, re.MULTILINE)
    assert [title for title in titles if title in manual.tables_of(id)] == list(manual.tables_of(id))
    names = re.findall(r"^(\w+)  ", printed, re.MULTILINE)
    for row in manual.tables_of(id)["Rewards"].rows:
        assert row[0] in names
    assert "](" not in printed


def test_tables_fit_the_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "90")
    assert cli.main(["manual"]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 90


def test_unknown_ids_are_one_line(capsys):
    assert cli.main(["manual", "--env-id", "HorseLeg"]) == 2
    assert capsys.readouterr().err.startswith("hoof-env: error: id: ")
    with pytest.raises(ParameterError, match="HorseLegRail-v0"):
        manual.tables_of("hoof_env/Trot-v0")


def test_the_manual_of_an_own_id_says_which_leg_it_has(capsys, tmp_path):
    """And not the paper's leg, or parts from outside that it does not have."""
    texts = {}
    pony = hoof_env.load_geometry("identified").scaled(0.5).replace(provenance="half as tall as another one")
    gaits = {name: hoof_env.load_gait(name, "identified") for name in ("walk", "run")}
    pony.save(tmp_path / "pony.json", gaits=gaits, ground={})
    for preset in ("identified", "jansen", "klann", "fourbar", str(tmp_path / "pony.json")):
        hoof_env.register("test/OtherLeg-v0", preset=preset)
        assert cli.main(["manual", "--env-id", "test/OtherLeg-v0"]) == 0
        printed = texts[preset] = capsys.readouterr().out
        assert "outside this package" not in printed
        leg = hoof_env.load_geometry(preset)
        about = " ".join(printed.partition("Arguments")[0].split())
        assert f"hips {leg.hip_height:.5g} m high. {leg.provenance[:20]}" in about
        assert f"Leg: preset {preset}" in about
        assert ("Batbaatar" in about) == (preset == "identified")
        env = gym.make("test/OtherLeg-v0")
        rows = {row[0]: row[3] for row in manual.arguments(manual.task_of_id("test/OtherLeg-v0")).rows}
        own = re.search(r": ([\d.]+) of this leg", rows["crank_rate"])
        rate = float(own.group(1)) if own else 18.0
        assert rate == pytest.approx(env.unwrapped.body.rates[0], rel=1e-3)
    assert len(set(texts.values())) == 5
    assert rate == pytest.approx(36.0)


@pytest.mark.parametrize("preset", ["jansen", "klann", "fourbar"])
def test_the_page_of_the_horse_says_which_mechanisms_it_refuses(preset):
    page = Path(__file__).parents[2] / "docs" / "environments" / "Horse.md"
    assert re.search(rf'"{preset}".* is refused', page.read_text("utf-8"), re.DOTALL)
    with pytest.raises(ParameterError, match="mechanism"):
        gym.make(HORSE, preset=preset)


@pytest.mark.parametrize("task", TASKS)
def test_tables_match_the_spaces(task):
    env = gym.make(TASKS[task].id)
    legs = "|".join(leg.replace("_", " ") for leg in LEGS)
    names = [re.sub(rf"({legs})[:,] ", "", name) for name in env.unwrapped.observation_names]
    assert [cells[0] for cells in observed(TASKS[task])] == names
    places = [place for row in manual.actions(TASKS[task]).rows for each in numbers(row[0]) for place in each]
    assert sorted(places) == list(range(env.action_space.shape[0]))


@pytest.mark.parametrize("task", OF_LEGS)
def test_actions_change_the_gait_as_the_table_says(task):
    """From one end of the limits to the other, at the rates of the table once the filters follow."""
    # A leg that carries itself would fall
    held = {"trunk": "suspended"} if TASKS[task].settings({}).trunk in ("boom", "floating") else {}
    env = gym.make(TASKS[task].id, episode_seconds=4.0, **held)
    near = 0.07 if held else 0.02  # the bound of the filters, which is its rate, is approached from below
    leg = env.unwrapped
    table = manual.actions(TASKS[task]).rows
    limits = np.array([re.fullmatch(r"(\S+) to (\S+) \S+", row[5]).groups() for row in table], float)
    assert limits == pytest.approx(np.array(list(LIMITS.values())), rel=1e-4)
    for column, end, action in ((2, 0, -1.0), (3, 1, 1.0)):
        rates, gaits = np.array([float(row[column]) for row in table]), []
        env.reset(seed=0, options={"gait": dict(zip(LIMITS, limits[:, 1 - end], strict=True))})
        for _ in range(150):
            _, _, failed, _, info = env.step(np.full(4, action, np.float32))
            assert not failed
            gaits.append([info["measured"][name] for name in LIMITS])
        assert (np.array(gaits[30]) - gaits[25]) / (5 * leg.dt) == pytest.approx(rates, rel=near)
        assert gaits[-1] == pytest.approx(limits[:, end], abs=1e-3)
    assert [row[4] for row in table] == ["rad/s^2", "rad/s", "rad/s", "rad/s"]


def test_offsets_of_a_horse_agree_with_the_table():
    """The commands under ones, once offsets have followed, beside the commands of the same moment without
    offsets; cranks at the same angles."""
    env = gym.make(HORSE)
    leg = env.unwrapped
    table = manual.actions(TASKS["horse"]).rows
    env.reset(seed=0, options={"target_speed": 2.0})
    state, commands = leg.get_state(), {}
    for action in (0.0, -1.0, 1.0):
        leg.set_state(state)
        info = env.step(np.full(16, action, np.float32))[4]
        commands[action] = np.array([info["measured"][f"left_hind_command_{name}"] for name in LIMITS])
    for column, action in ((3, -1.0), (4, 1.0)):
        expected = FOLLOWED * np.array([float(row[column]) for row in table])
        found = commands[action] - commands[0.0]
        found[0] /= commands[0.0][0]
        assert found == pytest.approx(expected, rel=1e-6)
    raw = leg.raw_observation()
    assert raw["offset: left hind, swing offset"] == pytest.approx(FOLLOWED)


@pytest.mark.parametrize("task", OF_LEGS)
def test_observations_are_scaled_as_the_table_says(task):
    env = gym.make(TASKS[task].id)
    leg = env.unwrapped
    env.reset(seed=5, options={"speed": 1.0} if leg.settings.trunk != "fixed" else {})
    leg.record()
    table = {cells[0]: cells[1] for cells in observed(TASKS[task])}
    checked, landed, allowance = set(), False, BEARING * MAX_STRIDE
    for _ in range(60):
        observation, *_, info = env.step(leg.action_for(load_gait("run", leg.settings.preset)))
        measured = info["measured"]
        allowance = min(allowance + BEARING * leg.dt, BEARING * MAX_STRIDE)
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
            "true rate of the crank": now["crank_angle_rate"],
            "sin(crank angle)": math.sin(now["crank_angle"]),
            "cos(crank angle)": math.cos(now["crank_angle"]),
            "pitch": now["pitch"], "pitch rate": now["pitch_rate"],
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
                expected = np.clip(scaled(scaling, float(there[name]), leg), -1.0, 1.0)
                assert observation[place] == pytest.approx(expected, abs=2e-6), name
    assert landed
    assert set(table) - checked <= {"commanded speed"}


@pytest.mark.parametrize("task", TASKS)
def test_every_setting_has_its_default(task):
    settings = to_json(gym.make(TASKS[task].id).unwrapped.settings)
    table = {row[0]: row[1] for row in manual.arguments(TASKS[task]).rows}
    pictures = {name: table.pop(name) for name in ("render_mode", "width", "height")}
    assert pictures == {"render_mode": "None", "width": "960", "height": "540"}
    names = [item.name for item in fields(Settings) if task not in HORSES or item.name in table]
    assert list(table) == names
    for name, value in table.items():
        assert eval(value) == settings[name], name


@pytest.mark.parametrize("task", TASKS)
def test_the_table_of_rewards_agrees_with_the_environment(task):
    env = gym.make(TASKS[task].id, episode_seconds=0.04)
    _, info = env.reset(seed=0)
    weights = {row[0]: float(row[1]) for row in manual.rewards(TASKS[task]).rows}
    assert [f"reward_{name}" for name in weights] == [name for name in info if name.startswith("reward_")]
    assert weights == dict(env.unwrapped.weights)


CHANGED = LARGER | OTHER | {
    "preset": "identified", "gait": "walk", "trunk": "rail", "hip_height": 1.5, "normal_law": "flores",
    "friction_law": "tanh", "hoof_stiffness": 2e4, "hoof_damping": 900.0, "terrain": {"kind": "slope"},
    "drive": "motor", "solver": "paper", "integrator": "rk3", "sim_dt": 5e-4, "dt": 0.01,
    "target_speed": 2.0, "target_seconds": (1.0, 2.0), "observation": ("crank",),
    "reward_weights": {"peak": 2.0}, "constants": {"free": 1.0}, "schedule": {"strength": [0.0, 1.0, 5]},
    "randomize": {"friction": 0.5}, "noise": {"trunk": 0.1}, "bias": {"trunk": 0.1}, "push_impulse": 9.0,
    "push_seconds": (1.0, 2.0), "pushes": [[1.0, 9.0, 0.0]],
    "privileged": ["trunk"], "cost": {"peak": 900.0}, "force_threshold": 50.0, "context_set": "all/train",
    "context_visible": True,
}  # fmt: skip
BESIDE = {name: {"drive": "motor"} for name in ("motor_gain", "motor_torque", "motor_inertia")} | {
    f"friction_{name}": {"hoof_stiffness": None} for name in ("law", "slow", "fast")
}
BESIDE["push_seconds"] = {"push_impulse": 9.0}
BESIDE["context_visible"] = {"context_set": "all/train"}


def test_the_table_of_the_horse_lists_what_a_horse_takes():
    """Each setting with another value than the default, beside what it needs."""
    listed = {row[0] for row in manual.arguments(TASKS["horse"]).rows}
    for name in (item.name for item in fields(Settings)):
        try:
            TASKS["horse"].settings(given := {name: CHANGED[name]} | BESIDE.get(name, {}))
            if name in LEG_ONLY_SETTINGS:
                gym.make(HORSE, **given)
            is_taken = True
        except ParameterError:
            is_taken = False
        assert is_taken == (name in listed), name


def test_meanings_have_their_numbers_and_choices():
    for task in TASKS.values():
        assert not [row for row in manual.arguments(task).rows if "$" in row[3] or not row[3]]
    rows = {row[0]: row[3] for row in manual.arguments(TASKS["horse"]).rows}
    assert f"{MASS:g} kg" in rows["hoof_damping"]
