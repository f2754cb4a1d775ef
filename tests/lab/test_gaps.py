"""Values that are missing: in swing they are 0, under load an option says what they are."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env import cli
from hoof_env.errors import DataFileError
from hoof_env.lab.read import read_record
from tests.lab.made import BOTH, FORWARD, ROWS, TIME, UP

SWING = UP == 0
WORDS = ("", "nan", "NaN", "NA", "n/a", "#N/A", "null", "-", ".", "-nan(ind)", "1.#QNAN", "-1.#IND00")


def lacking(path, gone, word="", columns=(1, 2), between=","):
    """A text file in which values are missing; `gone` is a mask of rows."""
    lines = [between.join(("time [s]", "left_force_x [N]", "left_force_y [N]"))]
    for row, missing in zip(ROWS, gone, strict=True):
        cells = [f"{value:.6f}" for value in row]
        if missing:
            cells = [word if k in columns else cell for k, cell in enumerate(cells)]
        lines.append(between.join(cells))
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("between", [",", "\t", ";"])
@pytest.mark.parametrize("word", WORDS)
def test_swing_without_values_is_without_force(word, between, tmp_path):
    found = read_record(lacking(tmp_path / "x.csv", SWING, word, between=between))
    np.testing.assert_allclose(found.limbs["left"], BOTH, atol=1e-5)
    assert len(found.notes) == 1
    words = (
        f"left_force_y, left_force_x: {SWING.sum()} of 300 values are missing in swing, the first in line 2"
    )
    assert found.notes[0].startswith(words)


@pytest.mark.parametrize("mark", ["-9999", "-999.000", "99999", "999", "-9.999e3"])
def test_marks_of_missing_values_are_reported(mark, tmp_path):
    """In swing, where a peak would be one of 9999 N, or all of the limb would be turned."""
    found = read_record(lacking(tmp_path / "x.csv", SWING, mark))
    np.testing.assert_allclose(found.limbs["left"], BOTH, atol=1e-5)
    words = f"left_force_y, left_force_x: {SWING.sum()} of 300 values are {float(mark):.9g}, taken as missing"
    assert words in found.notes
    gone = np.zeros(300, bool)
    gone[60:63] = True
    path = lacking(tmp_path / "y.csv", gone, "-9999")
    with pytest.raises(DataFileError, match=r"left_force_y: .* line 62, under load .*--gaps-a=line"):
        read_record(path)
    np.testing.assert_allclose(read_record(path, gaps="line").limbs["left"], BOTH, atol=8.0)


def test_forces_of_the_size_of_a_mark_are_forces(tmp_path):
    """Whole numbers go through 999 N in small steps, or stay there."""
    up = np.round(1100 * np.clip(np.sin(2 * np.pi * TIME), 0, None))
    at = np.flatnonzero(up > 900)
    up[at[0]] = up[at[-1]] = 999
    for values in (up, np.minimum(up, 999.0)):
        rows = np.column_stack([TIME, FORWARD, values])
        head = "time [s],left_force_x [N],left_force_y [N]"
        np.savetxt(tmp_path / "x.csv", rows, "%.6g", ",", header=head, comments="")
        found = read_record(tmp_path / "x.csv")
        np.testing.assert_allclose(found.limbs["left"][:, 1], values)
        assert 999 in values
        assert not [note for note in found.notes if "missing" in note]


def test_short_gaps_in_swing_are_without_force(tmp_path):
    gone = np.zeros(300, bool)
    gone[[0, 1, 10, 299]] = True
    found = read_record(lacking(tmp_path / "x.csv", gone))
    np.testing.assert_allclose(found.limbs["left"], BOTH, atol=1e-5)


def test_values_of_parquet_and_opensim_may_be_missing(tmp_path):
    lines = ["x", "nRows=300", "endheader", "time\tground_force_vx\tground_force_vy"]
    lines += [f"{t}\t{x if y else ''}\t{y if y else ''}" for t, x, y in ROWS]
    (tmp_path / "x.mot").write_text("\n".join(lines))
    np.testing.assert_allclose(read_record(tmp_path / "x.mot").limbs["leg"], BOTH, atol=1e-9)
    arrow = pytest.importorskip("pyarrow", reason='pip install "hoof-env[export]"')
    from pyarrow import parquet

    up = [None if swing else y for swing, y in zip(SWING, UP, strict=True)]
    parquet.write_table(
        arrow.table({"time": TIME, "force_x": FORWARD, "force_y": up}), tmp_path / "x.parquet"
    )
    found = read_record(tmp_path / "x.parquet", unit="N")
    np.testing.assert_allclose(found.limbs["leg"], BOTH, atol=1e-9)


def test_under_load_the_option_fills(tmp_path):
    gone = np.zeros(300, bool)
    gone[60:63] = True
    path = lacking(tmp_path / "x.csv", gone)
    lines = read_record(path, gaps="line")
    np.testing.assert_allclose(lines.limbs["left"], BOTH, atol=8.0)
    assert "3 of 300 values are missing, the first in line 62, and lie on lines" in lines.notes[0]
    zeros = read_record(path, gaps="zero")
    assert (zeros.limbs["left"][60:63] == 0).all()
    assert "--gaps-a=line" in zeros.notes[0]


def test_commands_have_the_option(tmp_path, capsys):
    gone = np.zeros(300, bool)
    gone[60] = True
    path, out = str(lacking(tmp_path / "x.csv", gone)), str(tmp_path / "y.csv")
    assert cli.main(["average", path, "--out", out]) == 2
    assert "--gaps=line lays lines over gaps" in capsys.readouterr().err
    assert not (tmp_path / "y.csv").exists()
    assert cli.main(["average", path, "--out", out, "--gaps", "line"]) == 0
    pytest.importorskip("matplotlib", reason='pip install "hoof-env[lab]"')
    picture = ["--out", str(tmp_path / "x.png")]
    assert cli.main(["compare", path, path, *picture, "--gaps-a", "line"]) == 2
    assert cli.main(["compare", path, path, *picture, "--gaps-a", "line", "--gaps-b", "zero"]) == 0


def test_a_fore_aft_force_without_values_is_left_out(tmp_path):
    found = read_record(lacking(tmp_path / "x.csv", np.ones(300, bool), columns=(1,)))
    assert np.isnan(found.limbs["left"][:, 0]).all()
    assert found.notes == ("left_force_x: no values, so left has no fore-aft force",)


def test_a_column_of_two_limbs_is_reported(tmp_path):
    path = lacking(tmp_path / "x.csv", np.zeros(300, bool))
    found = read_record(path, {"l_force_y": "left_force_y", "r_force_y": "left_force_y"})
    assert found.notes[0].startswith("left_force_y is the vertical force of l and of r")


@pytest.mark.parametrize("word", ["", "NA"])
@pytest.mark.parametrize("between", [",", ";", "\t"])
def test_rows_without_any_value_are_samples(between, word, tmp_path):
    """Without times a row that was skipped would bring stances together."""
    lines = [between.join((word, word) if y == 0 else (f"{x}", f"{y}")) for x, y in BOTH]
    (tmp_path / "x.csv").write_text("\n".join([f"force_x [N]{between}force_y [N]", *lines]))
    found = read_record(tmp_path / "x.csv", rate=100.0)
    np.testing.assert_allclose(found.limbs["leg"], BOTH, atol=1e-9)
    assert "missing in swing, the first in line 2" in found.notes[0]


def test_rows_of_separators_beside_times_do_not_count_as_samples(tmp_path):
    lines = [f"{t},{x},{y}" for t, x, y in ROWS]
    lines[100:100] = [",,", ",,"]
    (tmp_path / "x.csv").write_text("\n".join(["time [s],force_x [N],force_y [N]", ",,", *lines, ",,"]))
    found = read_record(tmp_path / "x.csv")
    np.testing.assert_allclose(found.limbs["leg"], BOTH, atol=1e-9)
    assert found.notes == ()
