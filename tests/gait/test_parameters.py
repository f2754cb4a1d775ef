"""Gait parameters: limits, order, and the two gaits of the default preset."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hoof_env  # noqa: F401
from hoof_env.gait import (
    FASTEST_CRANK,
    LIMITS,
    PARAMETERS,
    GaitParameters,
    HarmonicGait,
    gait_names,
    load_gait,
    paper_gaits,
)
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.presets import read_preset
from tests.legs import FIRST_FIT

inside = st.tuples(*(st.floats(low, high) for low, high in LIMITS.values()))


def test_a_gait_has_no_second_harmonic_unless_it_is_given():
    assert HarmonicGait(6.0, 0.1, 0.2, 0.3) == HarmonicGait(6.0, 0.1, 0.2, 0.3, (0.0, 0.0))


@given(values=inside)
@settings(deadline=None)
def test_an_array_and_back(values):
    gait = GaitParameters.from_array(values)
    assert tuple(gait.to_array()) == values
    assert tuple(getattr(gait, name) for name in PARAMETERS) == values


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_limit_itself_is_taken(name):
    low, high = LIMITS[name] if name != "crank_speed" else (0.0, FASTEST_CRANK)
    gait = dict(zip(PARAMETERS, (1.0, 0.5, 0.0, 0.0), strict=True))
    for value in (low, high):
        GaitParameters(**{**gait, name: value})


@pytest.mark.parametrize(
    # Golden: amplitude and phase of the swing as the identifying search reported them; the preset holds
    # phi = offset + A sin(theta) + B cos(theta)
    ("name", "offset", "amplitude", "phase"),
    [
        ("walk", 0.3434509445955683, 0.1856136496014587, -0.9921320005284548),
        ("run", 1.111873519500804, 0.7071698802333156, -2.46127843461837),
    ],
)
def test_the_gaits_of_first_fit(name, offset, amplitude, phase):
    gait = load_gait(name, FIRST_FIT)
    assert gait.crank_speed == 2 * np.pi
    for theta in np.linspace(0, 6, 7):
        swing = gait.swing_offset + gait.swing_sin * np.sin(theta) + gait.swing_cos * np.cos(theta)
        assert swing == pytest.approx(offset + amplitude * np.sin(theta + phase), abs=1e-12)


def test_names_of_gaits():
    assert gait_names(FIRST_FIT) == ["run", "walk"]
    assert {"run", "walk"} <= set(gait_names())


def test_a_preset_holds_more_gaits_than_the_papers(tmp_path):
    preset = read_preset(FIRST_FIT)
    given = {"crank_speed": 5.0, "swing_offset": 0.7, "swing_sin": 0.1, "swing_cos": -0.3}
    preset["gaits"]["carrying_walk"] = given
    path = tmp_path / "three.json"
    path.write_text(json.dumps(preset))
    assert gait_names(path) == ["carrying_walk", "run", "walk"]
    assert load_gait("carrying_walk", path) == GaitParameters(**given)
    assert load_gait("walk", path) == load_gait("walk", FIRST_FIT)


@pytest.mark.parametrize(
    ("gaits", "names"),
    [
        ("walk zigzag run carrying_walk", ["run", "walk"]),
        ("run amble", ["run"]),
        ("trot amble", ["amble", "trot"]),
    ],
)
def test_the_papers_gaits_stand_apart_from_those_found_later(gaits, names):
    chosen = paper_gaits({name: name.upper() for name in gaits.split()})
    assert list(chosen.items()) == [(name, name.upper()) for name in names]


def test_a_gait_with_harmonics_is_kept_in_a_file(tmp_path):
    leg, gait = load_geometry(), HarmonicGait(5.0, 0.4, 0.1, -0.2, (0.1, 0.05))
    leg.save(
        tmp_path / "leg.json", gaits={"trot": gait, "walk": load_gait("walk")}, ground={"stiffness": 2e4}
    )
    assert load_gait("trot", tmp_path / "leg.json") == gait
    assert HarmonicGait.from_array(gait.to_array()) == gait
