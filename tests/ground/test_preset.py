"""A preset may name the ground on which its leg was identified; missing entries are defaults."""

import json

import pytest

from hoof_env.ground.contact import SETTINGS, Ground, load_ground
from hoof_env.leg.presets import preset_names, read_preset


def with_ground(ground):
    """A preset's content with this ground, without any for None."""
    data = read_preset(preset_names()[0])
    data.pop("ground", None)
    return data if ground is None else {**data, "ground": ground}


@pytest.fixture
def preset(tmp_path):
    """Writes a preset with this ground; returns its path."""

    def write(ground):
        path = tmp_path / "leg.json"
        path.write_text(json.dumps(with_ground(ground)), encoding="utf-8")
        return path

    return write


def test_what_is_given_is_taken_and_the_rest_is_the_default(preset):
    assert load_ground(preset(None)) == load_ground(preset({})) == Ground()
    assert load_ground(preset({"exponent": 1.375})) == Ground(exponent=1.375)
    both = preset({"exponent": 1.375, "stiffness": 3e4})
    assert load_ground(str(both)) == Ground(stiffness=3e4, exponent=1.375)


def test_an_override_replaces_and_none_keeps(preset):
    path = preset({"exponent": 1.375})
    changed = load_ground(path, exponent=1.25, stiffness=None, restitution=0.0)
    assert changed == Ground(exponent=1.25, restitution=0.0)
    assert load_ground(path, exponent=None) == Ground(exponent=1.375)


def test_what_is_written_is_read_again():
    for ground in (Ground(stiffness=3e4, exponent=1.375), *map(load_ground, preset_names())):
        section = {name: getattr(ground, name) for name in SETTINGS}
        assert load_ground({"ground": section}) == ground
