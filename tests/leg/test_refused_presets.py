"""Presets that cannot be, by the words of each error: files (`FILES`), names and contents (`PRESETS`)."""

import json

import numpy as np
import pytest

from hoof_env.errors import DataFileError, GeometryError, ParameterError
from hoof_env.gait import load_gait
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.presets import read_preset

CONTENT = read_preset("identified")
BARE = {name: value for name, value in CONTENT["geometry"].items() if name != "pivot"}


def edited(**changes):
    """The text of a preset with other entries of its geometry."""
    return json.dumps(CONTENT | {"geometry": CONTENT["geometry"] | changes})


def edited_length(**lengths):
    return edited(lengths=CONTENT["geometry"]["lengths"] | lengths)


FILES = [
    (None, DataFileError, r"cannot read .*leg\.json: No such file"),
    *(
        (text, DataFileError, words)
        for text, words in (
            ("{", "does not parse"),
            ("[" * 100_000, "does not parse"),
            (b"\xff\xfe\x00\x80", "does not parse"),
            ("[]", "expected a JSON .*'geometry' and 'gaits', got list"),
            ("{}", r"leg\.json: expected an entry 'provenance' .*; found nothing"),
            ('{"geometry": {}, "gaits": {}}', "expected an entry 'provenance' .*; found geometry, gaits"),
            ('{"geometry": {}, "provenance": 3}', "expected an entry 'provenance' .*; got 3"),
            ('{"provenance": ""}', "expected an entry 'geometry' .*found provenance"),
            ('{"provenance": "", "geometry": 3}', "expected an entry 'geometry' .*got 3"),
            (
                '{"provenance": "", "geometry": {"pivot": 3}}',
                r"leg\.json: geometry: .*; missing assembly, heel,",
            ),
            (
                '{"provenance": "", "colour": "bay"}',
                r"leg\.json: unknown entries colour; expected .*prov",
            ),
            (edited(colour="bay"), r"leg\.json: geometry: expected exactly .*; unknown colour$"),
        )
    ),
    (edited_length(FG=np.nan), ParameterError, r"leg\.json: lengths\['FG'\]"),
    (edited_length(CB=0.1), GeometryError, r"leg\.json: dyad 1"),
]
"""Content of a file, or None, class and words of the error."""


@pytest.mark.parametrize(("content", "error", "words"), FILES)
def test_files(content, error, words, tmp_path):
    path = tmp_path / "leg.json"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(error, match=words):
        load_geometry(path)


def test_a_folder_in_place_of_a_file_is_refused(tmp_path):
    with pytest.raises(DataFileError, match="cannot read"):
        load_geometry(tmp_path)


PRESETS = [
    *(
        (lambda given=given: load_geometry(given), "preset: expected .*fourbar, .*got")
        for given in (3, None, True, ["klann"], np.zeros(2), b"klann", "")
    ),
    (
        lambda: load_geometry(load_geometry("klann")),
        r"a file that ends in \.json, as Geometry\.save writes it .* got Geometry\(\.\.\.\)$",
    ),
    (
        lambda: load_geometry("first_fit"),
        "preset: expected .*fourbar, identified, jansen, klann, got 'first_fit'",
    ),
    (
        lambda: load_geometry({**CONTENT, "colour": "bay"}),
        "preset: unknown entries colour; expected .*provenance, ",
    ),
    (
        lambda: load_geometry({name: CONTENT[name] for name in ("geometry", "gaits")}),
        r"preset: expected an entry 'provenance' .*geometry, gaits$",
    ),
    (
        lambda: load_gait("walk", {**CONTENT, "gaits": {5: CONTENT["gaits"]["walk"]}}),
        "gaits: expected names .*strings",
    ),
    (
        lambda: load_geometry({**CONTENT, "geometry": {**BARE, "colour": "bay"}}),
        r"preset: geometry: .*; missing pivot; unknown colour$",
    ),
]
"""Calls with a preset by name or content, and words."""


@pytest.mark.parametrize(("call", "words"), PRESETS)
def test_presets(call, words):
    with pytest.raises(ParameterError, match=words):
        call()
