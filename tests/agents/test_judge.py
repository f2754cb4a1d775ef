"""The judges' command: what it measures on forces that are known, and what it writes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from agents import judge
from agents.gait_figures import Stance, lag_of, stances_of
from hoof_env.envs.reference import reference_gaits
from hoof_env.errors import HoofEnvError, ParameterError

TIME = np.arange(0.0, 6.0, 1e-3)


def forces(lag, duty=0.5, stride=0.8):
    """Of four legs with stances like half sines, fore hoofs `lag` strides after the hind ones."""
    phases = [lag, lag + 0.5, 0.0, 0.5]
    parts = [(TIME / stride - phase) % 1.0 for phase in phases]
    return np.array([np.where(part < duty, 1e3 * np.sin(np.pi * part / duty), 0.0) for part in parts]).T


@pytest.mark.parametrize("lag", [0.0, 0.05, 0.17, 0.25, 0.4, 0.49])
def test_the_lag_is_that_of_the_footfall(lag):
    found = lag_of(stances_of(TIME, forces(lag), 50.0), 0.8)
    assert min((found - lag) % 0.5, (lag - found) % 0.5) < 0.005


def test_lags_of_a_trot_do_not_average_to_a_walk():
    """Just before and just after the hind hoof are both a trot."""
    found = [lag_of(stances_of(TIME, forces(lag), 50.0), 0.8) for lag in (0.01, 0.49)]
    assert all(min(one, 0.5 - one) < 0.02 for one in found)


def test_stances_are_whole_and_last_as_long_as_they_do():
    found = stances_of(TIME, forces(0.25, duty=0.4), 1.0)
    lasted = [one.ended - one.began for one in found]
    assert np.allclose(lasted, 0.4 * 0.8, atol=0.003)
    assert {one.leg for one in found} == {0, 1, 2, 3}


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (lambda x: np.sin(np.pi * x), False),
        (lambda x: np.sin(np.pi * x) + 0.6 * np.sin(3 * np.pi * x), True),
        (lambda x: np.sin(np.pi * x) * (1 + 0.02 * np.sin(40 * np.pi * x)), False),
        (lambda x: np.where(x < 0.2, x, 0.2 + 0.5 * (x - 0.2)) * (x < 0.95), False),
    ],
    ids=["half sine", "two peaks", "noise", "ramp"],
)
def test_two_peaks_are_two_peaks(shape, expected):
    x = np.linspace(0, 1, 400)
    assert Stance(0, 0.0, 0.4, 1e3 * np.maximum(shape(x), 0)).is_two_peaked is expected


def figures(**changes):
    """As `play` gives them, of a horse that is one."""
    one = {
        "speed": 1.85,
        "froude": 0.25,
        "lag": 0.25,
        "two_peaked": 1.0,
        "counts": {"fore": True, "hind": True},
    }
    one |= {"duty_fore": 0.62, "duty_hind": 0.62, "peak_fore": 6.2, "peak_hind": 4.8}
    return one | changes


def test_a_horse_meets_the_judges_and_what_slips_does_not_count():
    trot = figures(froude=1.0, lag=0.49, duty_fore=0.39, duty_hind=0.38, peak_fore=11.5, peak_hind=10.0)
    rows = judge.verdicts([figures(), trot])
    assert {row[5] for row in rows if row[4] != "-" and row[3] != "none"} == {"met"}
    reported = {row[0]: row[5] for row in judge.verdicts([figures(stride_over_hip=1.573), trot])}
    assert reported["stride_over_hip"] == "off by +10%"
    assert reported["walk_to_trot"] == "off by +186%"  # the first gait that is trot-like, at 1 for 0.35
    slipping = figures(counts={"fore": True, "hind": False})
    verdict = {row[0]: row[5] for row in judge.verdicts([slipping])}
    assert verdict["walk: lag"] == verdict["walk: peak_hind"] == "does not count"
    assert verdict["walk: peak_fore"] == "met"
    assert judge.verdicts([figures(peak_fore=9.0)])[4][5] == "missed"
    assert judge.verdicts([{"speed": 1.0, "froude": 0.1, "fell": 1.0}]) == []


def test_of_all_policies_there_are_means_and_intervals():
    base = dict.fromkeys(judge.SHOWN, 0.5)
    base |= {"slip_fore": 0.01, "slip_hind": 0.01, "stances_per_turn_fore": 1.0, "stances_per_turn_hind": 1.0}
    each = [[figures(**{**base, "lag": lag, "duty_fore": duty})] for lag, duty in ((0.01, 0.6), (0.49, 0.64))]
    (one,) = judge.of_all([*each, [{"speed": 1.85, "froude": 0.25, "fell": 1.0}]])
    assert min(one["lag"], 0.5 - one["lag"]) < 1e-9  # between just before and just after, not a quarter
    assert one["duty_fore"] == pytest.approx(0.62)
    assert one["fell"] == pytest.approx((0.5 + 0.5 + 1.0) / 3)
    assert one["counts"] == {"fore": True, "hind": True}
    assert "0.620 [" in judge.table_of("all", [one])


def test_the_command_writes_figures_a_table_and_pictures(tmp_path, capsys):
    judge.main(["reference", "--froude", "0.25", "--episodes", "3", "--out", str(tmp_path)])
    (one,) = json.loads((tmp_path / "figures.json").read_text())["figures"]["reference"]
    assert one["fell"] == 0.0
    assert one["reached"] == pytest.approx(1.853, rel=0.1)
    assert len(one["curves"]["fore"]) == 101
    share = one["mean_fore"] * one["duty_fore"] + one["mean_hind"] * one["duty_hind"]
    assert 2 * share == pytest.approx(9.81, rel=0.02)  # in the mean the legs bear the weight
    assert "| walk: lag |" in (tmp_path / "table.md").read_text()
    braking, propulsion = (
        sum(one[f"{name}_{pair}"] * one[f"duty_{pair}"] for pair in ("fore", "hind"))
        for name in ("braking", "propulsion")
    )
    assert braking == pytest.approx(propulsion, rel=0.1)  # for the speed stays
    rate = reference_gaits(np.array([one["speed"]]))[0, 0]
    assert one["stride_over_hip"] == pytest.approx(2 * np.pi * one["reached"] / rate / 1.4, rel=0.03)
    assert {leg for leg, _, _ in one["footfall"]} == {0, 1, 2, 3}
    on_the_ground = sum(ended - began for _, began, ended in one["footfall"])
    duty = 2 * (one["duty_fore"] + one["duty_hind"])  # of all legs; two strides, but for stances cut off
    assert 0.5 * duty < on_the_ground / max(ended for *_, ended in one["footfall"]) <= 1.1 * duty
    assert (tmp_path / "forces.png").stat().st_size > 5000
    assert (tmp_path / "footfall.png").stat().st_size > 5000
    assert (tmp_path / "speeds.png").stat().st_size > 5000
    capsys.readouterr()


def test_bad_arguments(tmp_path):
    with pytest.raises(ParameterError, match="policies: expected at least one"):
        judge.main(["--out", str(tmp_path)])
    with pytest.raises(HoofEnvError, match="policy: expected"):
        judge.main(["canter", "--episodes", "2", "--out", str(tmp_path)])
    with pytest.raises(ParameterError, match="--episodes: expected a whole number, 1 or more, got 0"):
        judge.main(["reference", "--episodes", "0", "--out", str(tmp_path)])
    with pytest.raises(ParameterError, match=r"--froude: expected a finite number in \(0, inf\], got -1"):
        judge.main(["reference", "--froude", "-1", "--out", str(tmp_path)])


def test_a_policy_that_stands_nowhere_has_a_table_and_no_pictures(tmp_path, capsys):
    judge.main(["reference", "--froude", "9", "--episodes", "2", "--out", str(tmp_path)])
    assert "no pictures: the first policy falls at every speed" in capsys.readouterr().out
    (one,) = json.loads((tmp_path / "figures.json").read_text())["figures"]["reference"]
    assert one["fell"] == 1.0
    assert "| fell | 1 |" in (tmp_path / "table.md").read_text()
    assert not list(tmp_path.glob("*.png"))
