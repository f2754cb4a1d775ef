"""`hoof-env average`: mean and standard deviation of stances that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env import cli
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.lab.average import average, report
from hoof_env.lab.compare import compare
from hoof_env.lab.read import ForceRecord
from tests.lab.made import strides

PEAKS = (700.0, 760.0, 800.0)


def trial(path, peak, contact, limb="left", weight=None):
    """Two half sines, of that height and length."""
    time = np.arange(4000) / 1000
    phase = (time - 0.4) % 2.0 / contact
    up = np.where(phase < 1, peak * np.sin(np.pi * phase), 0.0)
    forward = np.where(phase < 1, -0.15 * peak * np.sin(2 * np.pi * phase), 0.0)
    if path is None:
        return ForceRecord("x", time, {limb: np.column_stack([forward, up])}, "N", weight)
    names = f"time [s],{limb}_force_x [N],{limb}_force_y [N]"
    np.savetxt(path, np.column_stack([time, forward, up]), "%.6f", ",", header=names, comments="")
    return path


def test_the_mean_of_half_sines_is_a_half_sine(tmp_path, capsys):
    """Whatever their lengths are; threshold 0, so that they are whole."""
    files = [str(trial(tmp_path / f"{k}.csv", peak, 0.4 + 0.1 * k)) for k, peak in enumerate(PEAKS)]
    out = tmp_path / "new" / "mean.csv"
    assert cli.main(["average", *files, "--out", str(out), "--threshold", "0"]) == 0
    said = capsys.readouterr().out
    assert "| left | 3 | 6 |" in said
    assert "101 rows" in said
    assert "warning" not in said
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="", replace_space=" ")
    assert table.dtype.names == (
        "stance [%]", "left_force_x_mean [N]", "left_force_x_sd [N]", "left_force_y_mean [N]",
        "left_force_y_sd [N]", "left_stances",
    )  # fmt: skip
    part = np.linspace(0, 1, 101)
    np.testing.assert_allclose(table["stance [%]"], 100 * part)
    sines = np.sin(np.pi * part)
    spread = np.std(np.repeat(PEAKS, 2), ddof=1)
    np.testing.assert_allclose(table["left_force_y_mean [N]"], np.mean(PEAKS) * sines, atol=12)
    np.testing.assert_allclose(table["left_force_y_mean [N]"][50], np.mean(PEAKS), rtol=1e-3)
    np.testing.assert_allclose(table["left_force_y_sd [N]"][50], spread, rtol=1e-3)
    np.testing.assert_allclose(
        table["left_force_x_mean [N]"], -0.15 * np.mean(PEAKS) * np.sin(2 * np.pi * part), atol=4
    )
    assert (table["left_stances"] == 6).all()
    assert cli.main(["average", *files, "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_body_weights_and_points():
    found = average([trial(None, 700, 0.5, weight=1000.0)], units="BW", points=11)
    assert found.limbs["left"].mean.shape == (11, 2)
    assert found.limbs["left"].mean[:, 1].max() == pytest.approx(0.7, rel=1e-3)


def added(record, size):
    """The record with a force in addition, a number or shape (n,)."""
    record.limbs = {
        limb: force + np.column_stack([0 * record.time, 0 * record.time + size])
        for limb, force in record.limbs.items()
    }
    return record


def ramp(low, high):
    record = strides(seconds=12.0)
    return added(record, np.linspace(low, high, len(record.time)))


@pytest.mark.parametrize(("low", "high", "stances", "words"), [
    (0, 60, 4, "no stance is found from 4.001 to 12 s, 20.1 times the duration of one: the force"),
    (45, 0, 5, "no stance is found from 0 to 6.699 s"),
    (-60, 0, 12, "the force in swing drifts from -55 to -5 N; subtract it, or raise --threshold"),
    (0, 18, 12, "the force in swing drifts from 1.5 to 16.5 N"),
    (15, 15, 12, "the force in swing is 15 N instead of 0; subtract it"),
])  # fmt: skip
def test_a_baseline_that_is_not_zero_is_reported(low, high, stances, words):
    """A ramp passes the threshold of 20 N: from there on stances run into each other."""
    found = average([ramp(low, high)])
    assert found.limbs["left"].stances == stances
    assert any(f"left: {words}" in text for text in found.warnings)
    warnings = compare(strides(seconds=12.0), ramp(low, high)).warnings
    assert any(f"left: B: {words}" in text for text in warnings)


@pytest.mark.parametrize("size", [0.0, 8.0, -8.0])
def test_a_small_offset_gives_no_warning(size):
    assert average([added(strides(), size)]).warnings == []


def test_the_threshold_helps_against_a_baseline():
    found = average([ramp(0, 60)], threshold=100.0)
    assert found.limbs["left"].stances == 12


def odd():
    """Twelve stances of 0.4 s, of which one lacks its middle and three run into each other as one."""
    record = strides(seconds=12.0)
    time, force = record.time, record.limbs["left"]
    force[(time > 4.3) & (time < 4.45)] = 0
    force[(time > 6.6) & (time < 7.35), 1] = 300
    return record


def test_stances_of_odd_length_are_reported_and_may_be_left_out():
    found = average([odd()])
    assert (found.limbs["left"].stances, found.limbs["right"].stances) == (11, 11)
    (said,) = found.warnings
    assert said.startswith("left: 2 of 11 stances differ from the median duration, 395 ms, by more than 25 %")
    assert "--drop odd leaves them out: 248 ms at 4.45 s of 1.csv, 1395 ms at 6.303 s" in said
    dropped = average([odd()], drop=["odd"])
    left = dropped.limbs["left"]
    assert (left.stances, left.dropped, left.cut) == (9, 2, 0)
    assert left.contact.std() < 0.002
    assert left.mean[:, 1].max() == pytest.approx(900, rel=1e-3)
    assert "Stances dropped: left 2, right 0." in report(dropped)
    assert average([strides(seconds=12.0)]).warnings == []


def test_what_the_ends_cut_off_is_counted():
    """From 0.5 s on, within the first stance of left."""
    record = strides(seconds=4.5)
    record.time = record.time[500:]
    record.limbs = {limb: force[500:] for limb, force in record.limbs.items()}
    found = average([record])
    assert {limb: stance.cut for limb, stance in found.limbs.items()} == {"left": 2, "right": 0}
    assert "Stances cut off by the ends of records: left 2, right 0." in report(found)


def test_the_first_stance_of_an_episode_is_reported_and_may_be_left_out():
    episode = strides(seconds=12.0)
    episode.own = True
    episode.limbs["left"][episode.time < 1.0] *= 2  # a start that differs
    found = average([episode, strides(seconds=12.0)])
    words = (
        "left: 1 of 24 stances are the first of an episode, which depends on its start; --drop first leaves"
    )
    assert words in found.warnings[0]
    assert found.limbs["left"].sd.max() > 100
    dropped = average([episode, strides(seconds=12.0)], drop=["first"])
    assert dropped.warnings == []
    assert (dropped.limbs["left"].stances, dropped.limbs["left"].dropped) == (22, 2)
    assert dropped.limbs["left"].sd.max() < 1e-6


def test_the_command_leaves_out(tmp_path, capsys):
    record = odd()
    columns = [record.time, *(force[:, 1] for force in record.limbs.values())]
    head = "time [s],left_force_y [N],right_force_y [N]"
    path, out = tmp_path / "x.csv", tmp_path / "y.csv"
    np.savetxt(path, np.column_stack(columns), "%.6g", ",", header=head, comments="")
    assert cli.main(["average", str(path), "--out", str(out), "--drop", "first", "odd"]) == 0
    assert "Stances dropped: left 3, right 1." in capsys.readouterr().out
    assert cli.main(["average", str(path), "--out", str(tmp_path / "z.csv"), "--drop", "last"]) == 2
    assert "drop: expected one of first, odd, got 'last'" in capsys.readouterr().err
    assert not (tmp_path / "z.csv").exists()


def test_nothing_is_left_is_an_error():
    short = strides(seconds=1.3)
    with pytest.raises(DataFileError, match=r"drop: expected stances of 1\.csv besides the dropped ones"):
        average([short], drop=["first"])


def test_missing_parts_are_reported():
    found = average([trial(None, 700, 0.5), trial(None, 10, 0.5), trial(None, 700, 0.5, "right")])
    assert [found.limbs[limb].trials for limb in ("left", "right")] == [1, 1]
    assert any("left: expected a whole stance above 20 N, found none" in one for one in found.warnings)
    assert "x: has no right" in found.warnings


@pytest.mark.parametrize("points", [10**9, 10**21])
def test_a_number_of_points_beyond_memory_is_refused(points):
    with pytest.raises(ParameterError, match=rf"points: expected at most 100000, got {points}"):
        average([trial(None, 700, 0.5)], points=points)


def test_an_error_of_many_files_names_some():
    with pytest.raises(DataFileError, match=r"; and 35 more$") as caught:
        average([trial(None, 10, 0.5)] * 40)
    assert str(caught.value).count("expected a whole stance") == 5
