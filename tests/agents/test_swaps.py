"""Agents swapped between settings: which are compared, and what the page says of them."""

import gymnasium as gym
import pytest

from agents import swaps
from agents.experiments.outcomes import read_figures
from hoof_env.errors import DataFileError


def test_each_setting_is_one_of_the_id_and_in_a_pair():
    assert {name for pair in swaps.PAIRS for name in pair} == set(swaps.SETTINGS) == set(swaps.NAMES)
    assert set(swaps.TITLES) == set(swaps.PAIRS)
    for changed in swaps.SETTINGS.values():
        settings = gym.make(swaps.ID, **changed).unwrapped.settings
        assert {name: getattr(settings, name) for name in changed} == changed


def test_the_stiff_limb_has_the_damping_ratio_of_the_usual_one():
    usual = gym.make(swaps.ID).unwrapped.settings
    stiff = swaps.SETTINGS["stiff-limb"]
    ratios = [
        damping / stiffness**0.5
        for damping, stiffness in (
            (usual.hoof_damping, usual.hoof_stiffness),
            (stiff["hoof_damping"], stiff["hoof_stiffness"]),
        )
    ]
    assert ratios[1] == pytest.approx(ratios[0], rel=0.01)


def test_what_a_setting_does_and_what_is_learnt_there_come_apart():
    def of(peak, returned):
        return [{"stance_peak_n": peak, "loading_rate_n_s": peak, "return": returned}]

    first, second = pair = swaps.PAIRS[1]
    played = {first: {first: of(2.0, 0), second: of(3.0, 10)}, second: {first: of(1, 0), second: of(1.0, 30)}}
    text = swaps.reading({"played": played}, pair)
    assert "factor of 1.50 with the gait as it was, and of 0.50" in text
    assert "+20" in text


def test_a_page_of_nothing_is_refused_by_name(tmp_path):
    with pytest.raises(DataFileError, match=r"none.*trained on usual"):
        swaps.measure(swaps.Args(folder=tmp_path / "no", usual=tmp_path / "none", out=tmp_path))


def test_the_published_page_is_of_the_published_figures(tmp_path):
    data = read_figures(swaps.EVIDENCE / swaps.DATA)
    if not data:
        pytest.skip("no figures are published")
    page = swaps.write(tmp_path, data).read_text(encoding="utf-8")
    assert page == (swaps.EVIDENCE / swaps.PAGE_FILE).read_text(encoding="utf-8")
