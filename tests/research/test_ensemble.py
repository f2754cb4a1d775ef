import json
from pathlib import Path

import pytest

from hoof_env.errors import DataFileError, HoofEnvError, ParameterError
from hoof_env.gait.parameters import load_gait
from hoof_env.leg.geometry import load_geometry, preset_names, read_preset
from research.identify import ensemble
from research.identify.ensemble import GAITS, has_ensemble, load_ensemble, to_data, write_member

PRESET = preset_names()[0]
FOLDER = Path(ensemble.__file__).with_name("ensembles")
SHIPPED = [file.name.removesuffix(".json") for file in FOLDER.iterdir()] if FOLDER.is_dir() else []


def content():
    """Two legs: that of a preset, and one with another hip height."""
    one, two = read_preset(PRESET), read_preset(PRESET)
    two["geometry"]["hip_height"] += 0.01
    errors = {"exact": 0.5, "paper": 0.9}, {"exact": 0.8, "paper": 0.7}
    members = [
        write_member(p, e, s) for p, e, s in zip((one, two), errors, ({}, {"walk.flat": 0.1}), strict=True)
    ]
    return to_data(members, "made by hand", "walks")


@pytest.fixture
def write(tmp_path):
    """Writes an ensemble's file; returns its path."""

    def write(data):
        path = tmp_path / "legs.json"
        path.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
        return path

    return write


def test_a_file_holds_what_was_written_into_it(write):
    ensemble = load_ensemble(write(content()))
    own = load_geometry(PRESET)
    assert (ensemble.name, ensemble.provenance, ensemble.walk) == ("legs", "made by hand", "walks")
    assert ensemble.bar == {"exact": 0.8, "paper": 0.9}
    one, two = ensemble.members
    assert one.geometry == own.replace(name="member 1")
    assert two.geometry == own.replace(name="member 2", hip_height=own.hip_height + 0.01)
    assert one.gaits == {gait: load_gait(gait, PRESET) for gait in GAITS}
    assert (one.short, two.short) == ({}, {"walk.flat": 0.1})


def test_a_member_can_be_used_as_a_preset(write, tmp_path):
    for number, member in enumerate(load_ensemble(write(content())).members):
        path = tmp_path / f"{number}.json"
        path.write_text(json.dumps(member.to_preset()), encoding="utf-8")
        assert load_geometry(path) == member.geometry
        assert {gait: load_gait(gait, path) for gait in GAITS} == member.gaits


def broken(change):
    data = content()
    change(data)
    return data


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("{", "does not parse"),
        ([], "list 'members'"),
        (broken(lambda d: d.update(members=[])), "at least one leg"),
        (broken(lambda d: d["members"][1].pop("gaits")), "member 2: lacks 'gaits'"),
        (broken(lambda d: d["members"].__setitem__(0, 3)), "member 1: expected an object"),
        (broken(lambda d: d["members"][0]["gaits"].pop("run")), "member 1: lacks 'run'"),
        (broken(lambda d: d["members"][0]["geometry"].update(colour="bay")), "member 1: is incomplete"),
        (broken(lambda d: d["members"][1]["geometry"]["lengths"].update(PB=0.01)), "member 2: dyad"),
        (broken(lambda d: d["members"][1]["errors"].update(exact=-1)), "member 2: errors"),
        (broken(lambda d: d["members"][1].update(short={"walk.flat": "much"})), "member 2: short"),
        (broken(lambda d: d["bar"].update(exact=0.5)), "bar: expected {'exact': 0.8"),
        (broken(lambda d: d.update(walk="trots")), "walk: expected one of brakes, walks, got 'trots'"),
        (broken(lambda d: d["members"][1].update(d["members"][0])), "members 1 and 2: expected different"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_ensemble_is_refused_with_the_reason(write, data, message):
    path = write(data)
    with pytest.raises(DataFileError, match=r"legs\.json") as error:
        load_ensemble(path)
    assert message in str(error.value)


def test_without_an_ensemble_or_a_file_the_error_says_so(tmp_path):
    assert not has_ensemble("no_such_preset")
    with pytest.raises(ParameterError, match="expected a preset that has one"):
        load_ensemble("no_such_preset")
    with pytest.raises(HoofEnvError, match="cannot read"):
        load_ensemble(tmp_path / "missing.json")


def test_shipped_ensembles_belong_to_presets_are_none_and_have_at_least_20_legs():
    assert set(SHIPPED) <= set(preset_names())
    assert all(has_ensemble(name) for name in SHIPPED)
    assert "ensembles" not in preset_names()
    for name in SHIPPED:
        ensemble = load_ensemble(name)
        assert len(ensemble.members) >= 20
        assert ensemble.provenance
