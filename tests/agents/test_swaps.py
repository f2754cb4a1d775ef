"""Agents swapped between settings: tables and sentences follow from the figures."""

import gymnasium as gym
import pytest

from agents import swaps
from agents.experiments.hop_page import FIGURES
from agents.experiments.outcomes import read_figures
from hoof_env.errors import DataFileError

PAIR = ("inelastic", "elastic")


def seed_of(**figures):
    return {"seed": 0, "steps": 100, "commit": "abc", **dict.fromkeys(FIGURES, 1.0), **figures}


def figures_of_a_pair():
    peaks = {PAIR[0]: {PAIR[0]: 100.0, PAIR[1]: 200.0}, PAIR[1]: {PAIR[0]: 90.0, PAIR[1]: 150.0}}
    return {
        "weight_n": 50.0,
        "played": {
            mine: {
                other: [seed_of(stance_peak_n=peak, failed=failed) for failed in (0.0, 0.05, 1.0)]
                for other, peak in on.items()
            }
            for mine, on in peaks.items()
        },
    }


@pytest.mark.parametrize("name", swaps.SETTINGS)
def test_a_setting_changes_the_leg_as_it_says(name):
    settings = gym.make(swaps.ID, **swaps.SETTINGS[name]).unwrapped.settings
    assert all(getattr(settings, key) == value for key, value in swaps.SETTINGS[name].items())
    assert name in swaps.partners(name)


def test_agents_are_played_on_the_settings_of_their_pairs():
    assert swaps.partners("elastic") == PAIR
    assert swaps.partners(swaps.USUAL) == (swaps.USUAL, "soft-ground", "stiff-limb")


def test_a_table_has_agents_of_both_settings_on_both():
    lines = swaps.table(figures_of_a_pair(), PAIR).splitlines()
    assert len(lines) == 2 + 4
    assert "| restitution 0 | restitution 1 | 3 |" in lines[3]
    assert "4.00" in lines[3]  # weights


def test_a_reading_tells_the_effect_of_the_ground_from_that_of_learning():
    text = swaps.reading(figures_of_a_pair(), PAIR)
    assert "of 3 agents as they were 2 stay up, with 2.00 times the stance peaks" in text
    assert "of 3 agents trained there 2 stay up, with 1.50 times the stance peaks" in text


def test_forces_of_agents_that_fall_are_not_compared():
    figures = figures_of_a_pair()
    figures["played"][PAIR[1]][PAIR[1]] = [seed_of(failed=0.0), seed_of(failed=1.0)]
    assert "of 2 agents trained there 1 stay up. On" in swaps.reading(figures, PAIR)


def test_a_page_of_nothing_is_refused_by_name(tmp_path):
    with pytest.raises(DataFileError, match=r"none.*trained on usual"):
        swaps.measure(swaps.Args(folder=tmp_path / "none", out=tmp_path))


def test_the_published_page_is_of_the_published_figures(tmp_path):
    data = read_figures(swaps.EVIDENCE / swaps.DATA)
    if not data:
        pytest.skip("no figures are published")
    page = swaps.write(tmp_path, data).read_text(encoding="utf-8")
    assert page == (swaps.EVIDENCE / swaps.PAGE_FILE).read_text(encoding="utf-8")
