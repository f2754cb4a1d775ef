"""The place of the hips: what it does to the load, and that it is put back."""

import pytest

from agents import hips
from hoof_env.leg.limb_masses import trunk_mass
from hoof_env.tasks import horse


def test_hips_are_put_back_whatever_happens():
    before = dict(horse.HIPS)

    def fail():
        with hips.hips_forward(0.1):
            assert horse.HIPS["fore"] == pytest.approx(before["fore"] + 0.1)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert before == horse.HIPS


def test_fore_legs_bear_less_with_hips_further_forward():
    """By moments about the centre of mass: less by the distance over that between fore and hind hooves, which
    are as far apart as their crank centres, times the trunk's share of the mass, for the legs move along."""
    here, there = (hips.played(distance, "kinematic-walk", 4) for distance in (0.0, 0.1))
    apart = horse.HIPS["fore"] - horse.HIPS["hind"]
    expected = -0.1 * trunk_mass(horse.MASS) / horse.MASS / apart
    assert there["impulse_fore"] - here["impulse_fore"] == pytest.approx(expected, rel=0.15)


def test_the_page_has_each_place(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(hips, "FORWARD", (0.0, 0.1))
    hips.main(["--episodes", "2", "--out", str(tmp_path)])
    text = (tmp_path / "hips.md").read_text()
    assert "| 0.1 | kinematic-walk |" in text
    assert "nan" not in text
    capsys.readouterr()
