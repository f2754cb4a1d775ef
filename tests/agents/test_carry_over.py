"""Policies under one disturbance at a time: the disturbance is in the environment, and it is alone."""

import numpy as np
import pytest

from agents import carry_over
from agents.cards import POLICIES
from agents.runs import make_env
from hoof_env.evaluation.episodes import score_vector

LEG, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"
AGENT = str(POLICIES / "HorseLeg-v0")


@pytest.mark.parametrize("name", carry_over.DISTURBANCES)
def test_each_disturbance_changes_the_settings_that_it_names_and_no_other(name):
    plain = make_env(LEG).unwrapped.resolved_settings
    settings = carry_over.settings_of(LEG, name, 1.0)
    disturbed = make_env(LEG, **settings).unwrapped.resolved_settings
    changed = {key for key, value in vars(disturbed).items() if value != getattr(plain, key)}
    assert changed
    assert changed <= set(settings)
    assert carry_over.settings_of(LEG, name, 0.0) == {}


def test_what_an_id_refuses_is_left_out():
    assert carry_over.is_refused(FIXED, carry_over.settings_of(FIXED, "pushes", 1.0))
    assert not carry_over.is_refused(LEG, carry_over.settings_of(LEG, "pushes", 1.0))


def test_strength_0_is_the_undisturbed_episode():
    found = carry_over.play(AGENT, "late actions", 0.0, 3)
    seeds = range(carry_over.FIRST_SEED, carry_over.FIRST_SEED + 3)
    assert found.value == np.mean([each["return"] for each in score_vector(AGENT, LEG, seeds)])


def test_the_same_command_goes_on(tmp_path, capsys, monkeypatch):
    command = [AGENT, "--episodes", "2", "--strengths", "1", "--out", str(tmp_path)]
    monkeypatch.setattr(carry_over, "DISTURBANCES", {"late actions": carry_over.DISTURBANCES["late actions"]})
    carry_over.main(command)
    first = (tmp_path / carry_over.TABLE).read_text()
    assert (tmp_path / "curves.png").stat().st_size > 1000
    monkeypatch.setattr(carry_over, "play", lambda *args: pytest.fail("played again"))
    carry_over.main(command)
    assert (tmp_path / carry_over.TABLE).read_text() == first
    assert "HorseLeg-v0" in capsys.readouterr().out
