"""Vectors and what they mean: to a preset and back, and bad input."""

from __future__ import annotations

import json

import numpy as np
import pytest

from hoof_env.errors import GeometryError, ParameterError
from hoof_env.gait import load_gait
from hoof_env.leg.geometry import load_geometry, read_preset
from research.identify.leg import GAITS, encode, to_preset
from tests.legs import FIRST_FIT

GEOMETRY = load_geometry(FIRST_FIT)
CHOICE, X = encode(FIRST_FIT)


def test_a_preset_is_a_vector_and_back(tmp_path):
    file = tmp_path / "again.json"
    file.write_text(json.dumps(to_preset(X, CHOICE, "a test")))
    again = load_geometry(file)
    assert again.lengths == pytest.approx(dict(GEOMETRY.lengths))
    assert again.pivot == pytest.approx(GEOMETRY.pivot)
    for name in ("assembly", "toe", "heel", "travel", "hip_height"):
        assert getattr(again, name) == getattr(GEOMETRY, name)
    assert again.provenance == "a test"
    assert all(load_gait(gait, file) == load_gait(gait, FIRST_FIT) for gait in GAITS)
    choice, x = encode(file)
    assert choice == CHOICE
    np.testing.assert_allclose(x, X, rtol=1e-14)
    assert encode(file, 1.25)[0].exponent == 1.25


def test_a_preset_has_the_parts_of_the_shipped_one():
    preset, there = to_preset(X, CHOICE, "a test"), read_preset("identified")
    assert preset.keys() == there.keys() - {"gait_provenance"}
    assert preset["geometry"].keys() == there["geometry"].keys()
    assert preset["gaits"]["run"].keys() == there["gaits"]["run"].keys()


@pytest.mark.parametrize("x", [X[:-1], np.append(X[:-1], np.nan)])
def test_a_bad_vector_is_refused(x):
    with pytest.raises(ParameterError, match="x: expected 24"):
        to_preset(x, CHOICE, "")


def test_a_leg_that_cannot_turn_or_a_gait_beyond_its_limits_is_no_preset():
    stuck, beyond = X.copy(), X.copy()
    stuck[0], beyond[18] = np.log(2.0), 3.0
    with pytest.raises(GeometryError):
        to_preset(stuck, CHOICE, "")
    with pytest.raises(ParameterError, match="swing_offset"):
        to_preset(beyond, CHOICE, "")
