"""`hoof-env average`: mean and standard deviation of stances that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env import cli
from hoof_env.errors import ParameterError
from hoof_env.lab.average import average
from hoof_env.lab.read import ForceRecord

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


def test_what_is_missing_is_said():
    found = average([trial(None, 700, 0.5), trial(None, 10, 0.5), trial(None, 700, 0.5, "right")])
    assert [found.limbs[limb].trials for limb in ("left", "right")] == [1, 1]
    assert any("left: expected a whole stance above 20 N, found none" in one for one in found.warnings)
    assert "x: has no right" in found.warnings


@pytest.mark.parametrize("points", [10**9, 10**21])
def test_a_number_of_points_beyond_memory_is_refused(points):
    with pytest.raises(ParameterError, match=rf"points: expected at most 100000, got {points}"):
        average([trial(None, 700, 0.5)], points=points)
