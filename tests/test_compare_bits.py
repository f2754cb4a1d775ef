"""The comparison of bits: what differs, what is meant to, and when the base's digests are taken again."""

import importlib
import tomllib
from pathlib import Path

import pytest

from scripts.environments import Environment

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def bits(monkeypatch):
    """The script as a module."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    return importlib.import_module("compare_bits")


@pytest.fixture
def renamed(bits):
    """A map of names, with differences that are meant."""
    return bits.Renamed(
        keys={"theta": "crank_angle"},
        words={"choose": "where"},
        code={},
        intended={
            "^engines: .* forces$": "order of sums",
            "cannot be compiled": "traced",
        },
    )


BASE = {
    "engines: leg | theta": "0123",
    "engines: leg | forces": "0123",
    "refusals: law | refused": "TypeError: cannot be compiled: choose",
    "refusals: term | refused": "TypeError: choose a number",
}


def test_names_and_words_may_change(bits, renamed, capsys):
    now = {
        "engines: leg | crank_angle": "0123",
        "engines: leg | forces": "0123",
        "refusals: law | refused": "TypeError: cannot be compiled: where",
        "refusals: term | refused": "TypeError: where a number",
    }
    assert bits.compare(BASE, now, renamed) == 0
    assert capsys.readouterr().out == "4 digests, 0 differ, 0 as intended\n"


def test_a_refusal_is_meant_to_differ_by_its_words(bits, renamed, capsys):
    now = {
        "engines: leg | crank_angle": "0123",
        "engines: leg | forces": "4567",
        "refusals: law | refused": "TypeError: expected a number",
        "refusals: term | refused": "accepted",
        "refusals: new | refused": "TypeError: this cannot be compiled",
    }
    assert bits.compare(BASE, now, renamed) == 1
    said = capsys.readouterr().out.splitlines()
    assert said == [
        "as intended, traced: refusals: law | refused: TypeError: cannot be compiled: where before, "
        "TypeError: expected a number now",
        "differs: refusals: term | refused: TypeError: where a number before, accepted now",
        "as intended, traced: refusals: new | refused: missing before, "
        "TypeError: this cannot be compiled now",
        "4 digests, 1 differ, 3 as intended",
    ]


def test_words_are_not_looked_for_in_digests(bits):
    renamed = bits.Renamed(keys={}, words={}, code={}, intended={"0123": "a digest"})
    assert bits.compare({"engines: leg | x": "0123"}, {"engines: leg | x": "4567"}, renamed) == 1


def test_digests_are_kept_for_an_environment(bits, monkeypatch, tmp_path):
    taken = []

    def digests_of(tree, part, code, python):
        taken.append((part, python))
        return {f"{part}: leg | x": python}

    monkeypatch.setattr(bits, "KEPT", tmp_path)
    monkeypatch.setattr(bits, "digests_of", digests_of)
    first = {"engines": Environment("a", "1"), "sb3": Environment("b", "2")}
    for _ in range(2):
        found = bits.base_digests("abc", tmp_path, first, {})
        assert found == {"engines: leg | x": "a", "sb3: leg | x": "b"}
    assert taken == [("engines", "a"), ("sb3", "b")]
    bits.base_digests("abc", tmp_path, {"engines": Environment("a", "3")}, {})
    bits.base_digests("def", tmp_path, {"engines": Environment("a", "1")}, {})
    assert taken[2:] == [("engines", "a")] * 2


def test_extras_are_of_parts_and_of_the_package(bits):
    assert set(bits.EXTRAS) <= {*bits.PARTS, "refusals"}
    known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert {extra for extras in bits.EXTRAS.values() for extra in extras} <= set(known)
