"""Presets are files: what is missing, corrupt or out of range is named, with the file."""

import json

import pytest

from hoof_env.errors import DataFileError, GeometryError, ParameterError
from hoof_env.leg.geometry import load_geometry, preset_names, read_preset

LEG = load_geometry("first_fit")


def preset_file(tmp_path, change=None, text=None):
    data = read_preset("first_fit")
    if change:
        change(data)
    path = tmp_path / "leg.json"
    path.write_text(json.dumps(data) if text is None else text, encoding="utf-8")
    return path


def test_a_preset_by_path_is_the_preset_by_name(tmp_path):
    path = preset_file(tmp_path)
    for source in (path, str(path)):
        assert load_geometry(source).replace(name="first_fit") == LEG


def test_every_preset_is_identified_not_published():
    assert load_geometry().name == "identified"
    assert {"first_fit", "identified"} <= set(preset_names())
    for name in preset_names():
        assert load_geometry(name).provenance.startswith("Identified, not published")


def test_a_missing_file_and_an_unknown_name(tmp_path):
    with pytest.raises(DataFileError, match=r"cannot read .*none\.json: No such file"):
        load_geometry(tmp_path / "none.json")
    with pytest.raises(DataFileError, match="cannot read"):
        load_geometry(tmp_path)  # a folder
    with pytest.raises(ParameterError, match=r"preset: expected one of .*first_fit.*, got 'second_fit'"):
        load_geometry("second_fit")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "does not parse"),
        ("[" * 100_000, "does not parse"),
        ("[]", "expected a JSON object with 'geometry' and 'gaits', got list"),
        ("{}", "its 'geometry' is incomplete or has unknown entries: 'provenance'"),
        ('{"provenance": "", "geometry": 3}', "its 'geometry' is incomplete"),
        ('{"provenance": "", "geometry": {"pivot": [0, 0]}}', "its 'geometry' is incomplete"),
        ('{"provenance": "", "geometry": {"pivot": 3}}', "its 'geometry' is incomplete"),
    ],
)
def test_a_corrupt_file_is_named(tmp_path, text, message):
    with pytest.raises(DataFileError, match=message):
        load_geometry(preset_file(tmp_path, text=text))


def test_a_file_that_is_not_text(tmp_path):
    path = tmp_path / "leg.json"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(DataFileError, match="does not parse"):
        load_geometry(path)


def test_a_file_with_an_unknown_entry_or_a_bad_value(tmp_path):
    with pytest.raises(DataFileError, match=r"unknown entries.*colour"):
        load_geometry(preset_file(tmp_path, lambda data: data["geometry"].update(colour="bay")))
    with pytest.raises(ParameterError, match=r"lengths\['FG'\]"):
        load_geometry(preset_file(tmp_path, lambda data: data["geometry"]["lengths"].update(FG=float("nan"))))
    with pytest.raises(GeometryError, match="dyad 1"):
        load_geometry(preset_file(tmp_path, lambda data: data["geometry"]["lengths"].update(CB=0.1)))
