"""Presets are files: a leg that is written and read is the same, by name, path and content."""

import json
from pathlib import Path

import numpy as np
import pytest

from hoof_env.gait import GaitParameters, load_gait
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.presets import preset_names, read_preset

LEG = load_geometry()


def test_a_preset_by_path_is_the_preset_by_name(tmp_path):
    path = tmp_path / "leg.json"
    path.write_text(json.dumps(read_preset("identified")), encoding="utf-8")
    for source in (path, str(path)):
        assert load_geometry(source).replace(name="identified") == LEG


def test_every_preset_says_whether_it_is_identified_or_published():
    assert load_geometry().name == "identified"
    assert preset_names() == ["fourbar", "identified", "jansen", "klann"]
    assert load_geometry("identified").provenance.startswith("Identified, not published")
    for name in ("jansen", "klann"):
        assert load_geometry(name).provenance.startswith("Published: ")
    assert load_geometry("fourbar").provenance.startswith("Found, not published: ")


def test_content_is_taken_as_a_file_is():
    content = read_preset("identified")
    leg = load_geometry(content)
    assert leg.replace(name="identified") == LEG
    assert (leg.name, leg.provenance) == ("custom", LEG.provenance)


def test_numbers_of_numpy_go_through_a_file(tmp_path):
    odd = {"hip_height": np.float32(1.5), "travel": np.int64(1), "full_turn": np.False_, "linear_density": 2}
    own = LEG.replace(**odd)
    own.save(tmp_path / "leg.json")
    again = load_geometry(tmp_path / "leg.json")
    assert again.replace(name=own.name) == own
    assert (again.hip_height, again.travel, again.full_turn, again.linear_density) == (1.5, 1, False, 2.0)


def test_a_geometry_goes_through_a_dictionary_and_a_file(tmp_path):
    own = LEG.replace(masses=tuple(range(1, 15)), travel=1, name="mine", provenance="drawn by hand")
    assert Geometry.from_dict(json.loads(json.dumps(own.to_dict()))) == own
    gaits = {"trot": load_gait("run", "identified"), "walk": vars(load_gait("walk", "identified"))}
    path = tmp_path / "new" / "mine.json"
    own.save(path, gaits, {"exponent": 1.25})
    again = load_geometry(path)
    assert (again, again.provenance) == (own, own.provenance)
    assert [load_gait(name, path) for name in gaits] == [gaits["trot"], load_gait("walk", "identified")]
    assert load_ground(path) == Ground(exponent=1.25)
    own.save(path)
    assert set(read_preset(path)) == {"provenance", "units", "geometry"}


@pytest.mark.parametrize("preset", ["fourbar", "jansen", "klann"])
def test_gaits_of_other_legs_agree_with_their_study(preset):
    path = Path(__file__).parents[2] / "docs/evidence/legs/gaits.json"
    found = json.loads(path.read_text(encoding="utf-8"))[preset]
    assert {name: load_gait(name, preset) for name in ("walk", "run")} == {
        name: GaitParameters(**values) for name, values in found.items()
    }
