"""Vectors and what they mean: to a preset and back, names and scales of every variant, bad input."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

from hoof_env.errors import GeometryError, HoofEnvError, ParameterError
from hoof_env.gait.parameters import LIMITS, GaitParameters, load_gait
from hoof_env.leg.geometry import load_geometry, read_preset
from research.identify.candidate import (
    LINK9,
    SWINGS,
    Choice,
    decode,
    encode,
    names,
    random_choice,
    random_start,
    standard_deviations,
    to_preset,
)

GEOMETRY = load_geometry("first_fit")
GAITS = {name: load_gait(name, "first_fit") for name in ("walk", "run")}
CHOICE, X = encode(GEOMETRY, **GAITS)
VARIANTS = list(itertools.product(LINK9, SWINGS))


def test_a_preset_is_a_vector_and_back(tmp_path):
    file = tmp_path / "again.json"
    file.write_text(json.dumps(to_preset(X, CHOICE, "a test", "again")))
    again, gaits = load_geometry(file), {name: load_gait(name, file) for name in GAITS}
    assert again.lengths == pytest.approx(dict(GEOMETRY.lengths))
    assert again.pivot == pytest.approx(GEOMETRY.pivot)
    for name in ("assembly", "toe", "heel", "travel", "hip_height"):
        assert getattr(again, name) == getattr(GEOMETRY, name)
    assert again.provenance == "a test"
    assert gaits == GAITS
    choice, x = encode(again, **gaits)
    assert choice == CHOICE
    np.testing.assert_allclose(x, X, rtol=1e-14)


def test_a_preset_has_the_parts_of_the_shipped_one():
    preset, there = to_preset(X, CHOICE, "a test", "again"), read_preset("identified")
    assert preset.keys() == there.keys() - {"gait_provenance"}
    assert preset["geometry"].keys() == there["geometry"].keys()
    assert preset["gaits"]["run"].keys() == there["gaits"]["run"].keys()


@pytest.mark.parametrize(("link9", "swing"), VARIANTS)
def test_every_variant_names_its_numbers(link9, swing):
    rng = np.random.default_rng(1)
    choice = random_choice(rng, (link9,), (swing,))
    x = random_start(choice, rng)
    assert len(names(choice)) == len(set(names(choice))) == len(x)
    assert len(x) == 18 + {"6": 1, "7": 3}.get(link9, 0) + (10 if swing == "oval" else 6)
    scale = standard_deviations(choice)
    assert scale.shape == x.shape
    assert (scale > 0).all()
    candidate = decode(x, choice)
    assert len(candidate.lengths) == 15
    assert candidate.lengths["OP"] == pytest.approx(np.exp(x[0]))
    assert candidate.gaits["run"]["swing_offset"] == x[-5 if swing == "oval" else -3]
    if (link9, swing) != ("F", "crank"):
        with pytest.raises(HoofEnvError, match="full system"):
            to_preset(x, choice, "", "variant")


def test_a_choice_is_json_a_key_and_random():
    rng = np.random.default_rng(0)
    drawn = [random_choice(rng, LINK9, SWINGS) for _ in range(300)]
    assert all(Choice.from_dict(json.loads(json.dumps(c.to_dict()))) == c for c in drawn)
    assert len(set(drawn)) > 200
    assert {c.link9 for c in drawn} == set(LINK9)
    assert {c.swing for c in drawn} == set(SWINGS)
    assert {c.toe for c in drawn} == {"I", "J"}
    assert {c.travel for c in drawn} == {1, -1}
    assert {random_choice(rng).link9 for _ in range(20)} == {"F"}
    assert random_choice(np.random.default_rng(3)) == random_choice(np.random.default_rng(3))


def test_signs_without_a_meaning_are_one_choice():
    one, two = (Choice((1, 1, sign, sign, 1, -1), "I", 1, "7") for sign in (1, -1))
    assert one == two


def test_starts_lie_inside_the_gaits_limits_and_differ():
    rng, (low, high) = np.random.default_rng(0), LIMITS["swing_offset"]
    starts = np.array([random_start(CHOICE, rng) for _ in range(200)])
    offsets = starts[:, [18, 21]]
    assert offsets.min() >= low
    assert offsets.max() <= high
    assert ((starts[:, 17] > 1.2) & (starts[:, 17] < 1.7)).all()
    assert (starts.std(axis=0) > 0.05).all()
    again = random_start(CHOICE, np.random.default_rng(0))
    np.testing.assert_array_equal(again, starts[0])


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"assembly": (1, 1, 1)}, "assembly"), ({"assembly": (1, 1, 1, 1, 1, 0)}, "assembly"),
        ({"assembly": 5}, "assembly"), ({"toe": "K"}, "toe"), ({"travel": 0}, "travel"),
        ({"link9": "G"}, "link9"), ({"swing": "hip"}, "swing"),
    ],
)  # fmt: skip
def test_a_bad_choice_is_refused(change, match):
    good = {"assembly": (1,) * 6, "toe": "I", "travel": 1}
    with pytest.raises(ParameterError, match=match):
        Choice(**{**good, **change})


@pytest.mark.parametrize("data", [{}, {"assembly": [1] * 6}, {**CHOICE.to_dict(), "heel": "J"}])
def test_a_bad_dictionary_is_refused(data):
    with pytest.raises(ParameterError, match="choice"):
        Choice.from_dict(data)


@pytest.mark.parametrize("x", [X[:-1], [*X[:-1], np.nan], ["a"] * 24, None])
def test_a_bad_vector_is_refused(x):
    with pytest.raises(ParameterError, match="x: expected 24"):
        decode(x, CHOICE)


def test_a_leg_that_cannot_turn_or_a_gait_beyond_its_limits_is_no_preset():
    stuck, beyond = X.copy(), X.copy()
    stuck[0], beyond[18] = np.log(2.0), 3.0
    with pytest.raises(GeometryError):
        to_preset(stuck, CHOICE, "", "stuck")
    with pytest.raises(ParameterError, match="swing_offset"):
        to_preset(beyond, CHOICE, "", "beyond")


def test_another_crank_speed_is_refused():
    walk = GaitParameters(5.0, *GAITS["walk"].to_array()[1:])
    with pytest.raises(ParameterError, match=r"walk\.crank_speed"):
        encode(GEOMETRY, walk, GAITS["run"])
