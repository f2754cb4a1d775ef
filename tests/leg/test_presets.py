"""Presets are files: what is missing, corrupt or out of range is named, with the file."""

import json

import pytest

from hoof_env.errors import DataFileError, GeometryError, OutputError, ParameterError
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.leg.geometry import Geometry, load_geometry, preset_names, read_preset

LEG = load_geometry()


def preset_file(tmp_path, change=None, text=None):
    data = read_preset("identified")
    if change:
        change(data)
    path = tmp_path / "leg.json"
    path.write_text(json.dumps(data) if text is None else text, encoding="utf-8")
    return path


def test_a_preset_by_path_is_the_preset_by_name(tmp_path):
    path = preset_file(tmp_path)
    for source in (path, str(path)):
        assert load_geometry(source).replace(name="identified") == LEG


def test_every_preset_says_whether_it_is_identified_or_published():
    assert load_geometry().name == "identified"
    assert preset_names() == ["fourbar", "identified", "jansen", "klann"]
    assert load_geometry("identified").provenance.startswith("Identified, not published")
    for name in ("jansen", "klann"):
        assert load_geometry(name).provenance.startswith("Published: ")
    assert load_geometry("fourbar").provenance.startswith("Found, not published: ")


def test_a_missing_file_and_an_unknown_name(tmp_path):
    with pytest.raises(DataFileError, match=r"cannot read .*none\.json: No such file"):
        load_geometry(tmp_path / "none.json")
    with pytest.raises(DataFileError, match="cannot read"):
        load_geometry(tmp_path)  # a folder
    known = "fourbar, identified, jansen, klann"
    with pytest.raises(ParameterError, match=f"preset: expected one of {known}, got 'first_fit'"):
        load_geometry("first_fit")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "does not parse"),
        ("[" * 100_000, "does not parse"),
        ("[]", "expected a JSON object with 'geometry' and 'gaits', got list"),
        ("{}", r"leg\.json: expected an entry 'provenance' .*; found nothing"),
        ('{"geometry": {}, "gaits": {}}', "expected an entry 'provenance' .*; found geometry, gaits"),
        ('{"geometry": {}, "provenance": 3}', "expected an entry 'provenance' .*; got 3"),
        ('{"provenance": ""}', "expected an entry 'geometry' .*, an object; found provenance"),
        ('{"provenance": "", "geometry": 3}', "expected an entry 'geometry' .*, an object; got 3"),
        ('{"provenance": "", "geometry": {"pivot": 3}}', r"leg\.json: geometry: .*; missing assembly, heel,"),
        ('{"provenance": "", "colour": "bay"}', r"leg\.json: unknown entries colour; expected some of prov"),
    ],
)
def test_a_corrupt_file_is_named(tmp_path, text, message):
    with pytest.raises(DataFileError, match=message):
        load_geometry(preset_file(tmp_path, text=text))


def test_a_file_with_an_unknown_entry_or_a_bad_value(tmp_path):
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(DataFileError, match="does not parse"):
        load_geometry(tmp_path / "bytes.json")
    with pytest.raises(DataFileError, match=r"leg\.json: geometry: expected exactly .*; unknown colour$"):
        load_geometry(preset_file(tmp_path, lambda data: data["geometry"].update(colour="bay")))
    with pytest.raises(ParameterError, match=r"leg\.json: lengths\['FG'\]"):
        load_geometry(preset_file(tmp_path, lambda data: data["geometry"]["lengths"].update(FG=float("nan"))))
    with pytest.raises(GeometryError, match=r"leg\.json: dyad 1"):
        load_geometry(preset_file(tmp_path, lambda data: data["geometry"]["lengths"].update(CB=0.1)))


def test_content_is_taken_as_a_file_is_and_its_errors_are_those_of_an_argument():
    content = read_preset("identified")
    leg = load_geometry(content)
    assert leg.replace(name="identified") == LEG
    assert (leg.name, leg.provenance) == ("custom", LEG.provenance)
    with pytest.raises(ParameterError, match="preset: unknown entries colour; expected some of provenance, "):
        load_geometry({**content, "colour": "bay"})
    with pytest.raises(ParameterError, match=r"preset: expected an entry 'provenance' .*geometry, gaits$"):
        load_geometry({"geometry": content["geometry"], "gaits": content["gaits"]})
    with pytest.raises(ParameterError, match="gaits: expected names that are texts"):
        load_gait("walk", {**content, "gaits": {5: content["gaits"]["walk"]}})
    geometry = {name: value for name, value in content["geometry"].items() if name != "pivot"}
    with pytest.raises(ParameterError, match=r"preset: geometry: .*; missing pivot; unknown colour$"):
        load_geometry({**content, "geometry": {**geometry, "colour": "bay"}})


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
    with pytest.raises(ParameterError, match=r"path: expected a file that ends in \.json, got .*mine\.txt"):
        own.save(tmp_path / "mine.txt")
    with pytest.raises(OutputError, match="cannot write to"):
        own.save(path / "under" / "mine.json")
    with pytest.raises(ParameterError, match=r"ground: .*; unknown stifness"):
        own.save(path, ground={"stifness": 1e4})
    with pytest.raises(ParameterError, match=r"gaits\['trot'\]\['crank_speed'\]: expected .*fast"):
        own.save(path, {"trot": {"crank_speed": "fast"}})
    with pytest.raises(ParameterError, match="gaits: expected a mapping"):
        own.save(path, ["walk"])
    for name, value in (("toe", ["I"]), ("name", ["l"]), ("travel", [1, 1]), ("provenance", 3)):
        with pytest.raises(ParameterError, match=f"{name}.*: expected"):
            Geometry.from_dict({**own.to_dict(), name: value})
    with pytest.raises(ParameterError, match=r"geometry: expected exactly .* and perhaps .*; missing toe"):
        Geometry.from_dict({name: value for name, value in own.to_dict().items() if name != "toe"})
