"""A leg of one's own as `docs/own_task.md` says: the examples run, the tables are whole, errors exact."""

from __future__ import annotations

import copy
import json
import re
from dataclasses import MISSING, fields
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from family import roll, same
from gymnasium.envs.registration import EnvSpec

from hoof_env import Geometry, read_preset
from hoof_env.gait import LIMITS
from hoof_env.ground import contact as ground
from hoof_env.leg.presets import PARTS
from hoof_env.leg.profile import by_name, functions
from tests.linkage import DYADS, LENGTHS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "own_task.md").read_text(encoding="utf-8").split("## A leg of your own", 1)[1]
MASSES = (DOCS / "evidence" / "limb_masses.md").read_text(encoding="utf-8")
LEG = "hoof_env/HorseLeg-v0"
CONTENT = read_preset("identified")


def test_the_examples_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    known: dict = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE + MASSES, re.DOTALL):
        exec(compile(block, "own_task.md", "exec"), known)
    assert json.loads((tmp_path / "pony.json").read_text())["provenance"] == "identified at half its size"

    leg, fore, hind, trunk = (known[name] for name in ("leg", "fore", "hind", "trunk"))
    assert f"# {fore.mass:.1f} and {hind.mass:.1f} kg" in MASSES
    assert f"# {trunk:.1f} kg: " in MASSES
    theta = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    about = [by_name(functions(one, theta)[0])["frame_inertia"].mean() for one in (leg, fore, hind)]
    said = f"{leg.mass:.1f} kg and, on average over a turn, {about[0]:.1f} kg m^2 about O; the fore limb has"
    assert f"{said} {about[1]:.1f} kg m^2 and the hind limb {about[2]:.1f}," in MASSES


def entries(heading: str) -> dict[str, list[str]]:
    """Rows of the table under a heading, by the names in the first cell."""
    part = PAGE.split(heading, 1)[1].split("\n#", 1)[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in part.splitlines()
        if line.startswith("| `")
    ]
    return {name: row[1:] for row in rows for name in re.findall(r"`(\w+)`", row[0])}


def test_the_page_has_every_entry():
    assert set(entries("### The form of a preset")) == set(PARTS)
    geometry = entries("#### geometry")
    needed = {
        item.name: "yes" if item.default is item.default_factory is MISSING else "no"
        for item in fields(Geometry)
    }
    assert {name: row[0] for name, row in geometry.items()} == needed
    assert re.findall(r"`(\w+)`", geometry["lengths"][2]) == list(LENGTHS)
    assert re.findall(r"`(\w+)`", geometry["assembly"][2]) == [dyad.point for dyad in DYADS]
    assert set(entries("#### gaits")) == set(LIMITS)
    assert set(entries("#### ground")) == set(ground.SETTINGS)


@pytest.mark.parametrize("make", [gym.make, gym.make_vec], ids=["single", "vector"])
def test_a_mapping_is_the_preset_of_that_content(make):
    given = copy.deepcopy(CONTENT)
    env = make(LEG, preset=given, stiffness=None, exponent=None).unwrapped
    named = make(LEG, preset="identified", stiffness=None, exponent=None).unwrapped
    given["geometry"]["hip_height"] = 9.0  # not shared
    assert env.settings.preset == CONTENT
    same(env.reset(seed=0), named.reset(seed=0))
    if make is gym.make:
        for one, two in zip(roll(env, 50), roll(named, 50), strict=True):
            same(one, two)
        assert env.engine.ground == named.engine.ground


def test_a_spec_and_a_state_hold_the_leg_itself():
    env = gym.make(LEG, preset=CONTENT)
    env.reset(seed=0)
    state = env.unwrapped.get_state()
    assert json.loads(json.dumps(state["settings"]))["preset"] == CONTENT
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.geometry == env.unwrapped.geometry
    same(again.unwrapped.set_state(state), env.unwrapped.batch.rows.observations[0])


def test_a_path_stays_a_path(tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(CONTENT), encoding="utf-8")
    for given in (path, str(path)):
        env = gym.make(LEG, preset=given).unwrapped
        assert env.settings.preset == str(path)
        assert env.geometry.name == str(path)
