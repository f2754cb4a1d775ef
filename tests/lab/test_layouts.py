"""Text files as programs of laboratories write them: each has the same forces, and all are found."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env import cli
from hoof_env.lab.columns import parse_mapping
from hoof_env.lab.compare import compare
from hoof_env.lab.read import read_record
from tests.lab.made import BOTH, ROWS, TIME, UP, text

COLUMNS = {"force_x": "Fx", "force_y": "Fz"}
OURS = "time [s],left_force_x [N],left_force_y [N]\n"


def written(path, head, rows=ROWS, between=",", comma=False, encoding="utf-8"):
    path.write_bytes((head + text(rows, between, comma)).encode(encoding))
    return path


BIOWARE = (
    "BioWare\nDevice:\tX\tX\nSamples (#):\t300\t300\nRate (Hz):\t100.0\t100.0\nFile Information\n"
    "Date\tJan 01, 2000\nName\t\nabs time (s)\tFx\tFz\n\tN\tN\n"
)
MATRIX = "Kistler\nDate\t12.03.2020\nPlates\t2\t2\n1\t2\t3\n4\t5\t6\n\ntime\tFx\tFz\ns\tN\tN\n"
LAYOUTS = {
    "mark.csv": ((OURS,), {"encoding": "utf-16"}, {}),
    "codepage.csv": (("knee [°],time [s],left_force_x [N],left_force_y [N]\n", ROWS[:, [1, 0, 1, 2]]),
                     {"encoding": "cp1252"}, {}),
    "comments.csv": (("# laboratory X\n# trial 3\n" + OURS,), {}, {}),
    "numpy.csv": (("# " + OURS,), {}, {}),
    "percent.txt": (("% laboratory\n%\ntime left_force_x left_force_y\ns N N\n",), {"between": " "}, {}),
    "bioware.txt": ((BIOWARE,), {"between": "\t"}, COLUMNS | {"time": "abs time"}),
    "matrix.txt": ((MATRIX,), {"between": "\t"}, COLUMNS),
    "german.csv": (("Messung;1\nProbe;2;3\n\nZeit [s];Fx [N];Fz [N]\n",), {"between": ";", "comma": True},
                   COLUMNS | {"time": "Zeit"}),
    "tabs.txt": (("time\tFx\tFz\ns\tN\tN\n",), {"between": "\t", "comma": True}, COLUMNS),
    "blanks.txt": (("time Fx Fz\ns N N\n",), {"between": "  ", "comma": True}, COLUMNS),
    "mixed.txt": (("time [s], left_force_x [N], left_force_y [N]\n",), {"between": " "}, {}),
    "words.csv": (("Time (Seconds),left_force_x (Newton),left_force_y (nt)\n",), {}, {}),
    "ms.csv": (("time (msec),left_force_x (N),left_force_y (N)\n", ROWS * [1000, 1, 1]), {}, {}),
    "blank.mot": (("x\nnRows=300\nnColumns=3\nendheader\n\ntime ground_force_vx ground_force_vy\n",),
                  {"between": "\t"}, {}),
    "rows.mot": (("x\nnRows=299\nnColumns=9\nendheader\ntime\tground_force_vx\tground_force_vy\n",),
                 {"between": "\t"}, {}),
    "more.mot": (("x\nnRows=1000\nendheader\ntime ground_force_vx ground_force_vy\n",), {"between": " "}, {}),
    "simm.sto": (("x\ndatacolumns 4\ndatarows 7\nendheader\ntime ground_force_vx ground_force_vy\n",),
                 {"between": " "}, {}),
    "names.mot": (("x\nendheader\ntime\tleft fore ground_force_vx\tleft fore ground_force_vy\tknee angle\n",
                   np.column_stack([ROWS, UP])), {"between": "\t"}, {}),
    "names.csv": (("time [s],left fore force_x [N],left fore force y [N]\n",), {},
                  {"left_fore_force_x": "left fore force_x", "left_fore_force_y": "left fore force y"}),
    "nameless.csv": (("lab X\ntrial 3\n",), {}, {"time": "#1", "force_x": "#2", "force_y": "#3"}),
    "nameless.mot": (("x\nendheader\n",), {"between": "\t"},
                     {"time": "#1", "force_x": "#2", "force_y": "#3"}),
    "old.mot": (("name x\ndatarows 300\nendheader\n\n\ntime ground_force1_vx ground_force1_vy\n",),
                {"between": " "}, {}),
}  # fmt: skip


STALE = {
    "rows.mot": [
        "its header says nRows=299, the file has 300 rows, which are read",
        "its header says nColumns=9, the file has 3 columns, which are read; if it is cut off, copy it again",
    ],
    "more.mot": [
        "its header says nRows=1000, the file has 300 rows, which are read; if it is cut off, copy it again"
    ],
    "simm.sto": [
        "its header says datarows=7, the file has 300 rows, which are read",
        "its header says datacolumns=4, the file has 3 columns, which are read; if it is cut off, "
        "copy it again",
    ],
}
"""Notes on counts in headers."""


@pytest.mark.parametrize("weight", ["0", "-5", "nan", "heavy", "inf"])
def test_a_bad_weight_is_reported_and_not_used(weight, tmp_path):
    head = f"x\nweight_n={weight}\nendheader\ntime ground_force_vx ground_force_vy\n"
    found = read_record(written(tmp_path / "x.mot", head, between=" "))
    assert found.weight is None
    assert found.notes == (
        f"weight_n: expected a weight in N, got {weight}; --mass-a or --mass-b gives the mass",
    )


@pytest.mark.parametrize("name", LAYOUTS)
def test_names_and_numbers_are_found_in_every_layout(name, tmp_path):
    arguments, options, mapping = LAYOUTS[name]
    unit = "N" if name.startswith("nameless") else "auto"
    found = read_record(written(tmp_path / name, *arguments, **options), mapping, unit)
    assert (found.unit, found.rate) == ("N", pytest.approx(100.0))
    assert [*found.notes] == STALE.get(name, [])
    (force,) = found.limbs.values()
    np.testing.assert_allclose(force, BOTH, atol=1e-5)


def test_names_that_repeat_for_each_plate_are_chosen(tmp_path):
    """As Vicon Nexus writes them, with another table below."""
    head = "Devices\n1000\n,,Plate 1,,Plate 2,\nFrame,Sub Frame,Fx,Fz,Fx,Fz\n,,N,N,N,N\n"
    rows = np.column_stack([np.arange(300), 0 * TIME, BOTH, -0.5 * BOTH])
    path = written(tmp_path / "x.csv", head, rows)
    with path.open("a") as file:
        file.write("\nTrajectories\n100\n,,trunk\nFrame,Sub Frame,X\n,,mm\n1,0,3.5\n")
    found = read_record(
        path,
        {"left_force_x": "Fx#1", "left_force_y": "Fz#1", "right_force_x": "#5", "right_force_y": "#6"},
        rate=100,
    )
    np.testing.assert_allclose(found.limbs["left"], BOTH, atol=1e-5)
    np.testing.assert_allclose(found.limbs["right"], 0.5 * BOTH, atol=1e-5)
    assert found.turned == ("right",)
    assert found.notes == ("line 307: another table begins there, which is not read",)


def two(path):
    return written(
        path,
        "time [s],L_force_x [N],L_force_y [N],R_force_x [N],R_force_y [N]\n",
        np.column_stack([TIME, BOTH, 0.5 * BOTH]),
    )


@pytest.mark.parametrize(("mapping", "sizes", "left_out"), [
    ({"L": "R"}, {"L": 0.5}, "L of the file is left out, because L=R gives its name to another"),
    ({"R": "L"}, {"R": 1.0}, "R of the file is left out, because R=L gives its name to another"),
    ({"L": "R", "R": "L"}, {"R": 1.0, "L": 0.5}, ""),
    ({"L": "R", "x": "L"}, {"x": 1.0, "L": 0.5}, ""),
    ({"both": "L+R"}, {"both": 1.5}, ""),
    ({"both_force_x": "#2+#4", "both_force_y": "L_force_y + R_force_y"}, {"both": 1.5}, ""),
    ({"less_force_x": "L_force_x-R_force_x", "less_force_y": "L_force_y-R_force_y"}, {"less": 0.5}, ""),
])  # fmt: skip
def test_a_rename_is_the_rename(mapping, sizes, left_out, tmp_path):
    found = read_record(two(tmp_path / "x.csv"), mapping)
    assert list(found.limbs) == list(sizes)
    for limb, size in sizes.items():
        np.testing.assert_allclose(found.limbs[limb], size * BOTH, atol=1e-5)
    assert [note[: len(left_out)] for note in found.notes] == ([left_out] if left_out else [])


def test_a_limb_beside_itself_under_another_name_is_not_like_itself(tmp_path):
    path = two(tmp_path / "x.csv")
    found = compare(read_record(path), read_record(path, {"L": "R"}))
    assert found.limbs["L"].forces["vertical"].peak_error == pytest.approx(-380, abs=2)


def test_columns_that_point_opposite_ways_are_not_added(tmp_path):
    path = written(tmp_path / "x.csv", "time,p-1 [N],p-2 [N]\n", np.column_stack([TIME, UP, -UP]))
    found = read_record(path, {"left_force_y": "p-1-p-2"})
    np.testing.assert_allclose(found.limbs["left"][:, 1], 2 * UP, atol=1e-5)


def test_limbs_of_the_file_may_have_any_name(tmp_path, capsys):
    assert parse_mapping("--map-b", ["1=l", "time=abs time", '{"a b": "c"}']) == {
        "1": "l", "time": "abs time", "a b": "c"
    }  # fmt: skip
    pytest.importorskip("matplotlib", reason='pip install "hoof-env[lab]"')
    a = written(tmp_path / "a.mot", "x\nendheader\ntime 1_ground_force_vx 1_ground_force_vy\n", between=" ")
    b = written(tmp_path / "b.mot", "x\nendheader\ntime ground_force_l_vx ground_force_l_vy\n", between=" ")
    out = str(tmp_path / "x.png")
    assert cli.main(["compare", str(a), str(b), "--map-b", "1=l", "--out", out]) == 0
    assert "| 1 | vertical | 3 | 0.0 |" in capsys.readouterr().out


def test_travel_backward_in_a_text_is_reported(tmp_path):
    found = read_record(written(tmp_path / "x.csv", OURS, ROWS * [1, -1, 1]))
    assert found.notes[0].startswith("left: propulsion before braking")
    head = "time [s],a [N],b [N]\n"
    found = read_record(
        written(tmp_path / "y.csv", head, ROWS * [1, -1, 1]), {"force_x": "a", "force_y": "b"}
    )
    assert "a minus before the column of force_x in --map-a or --map-b says so" in found.notes[0]
    assert read_record(tmp_path / "y.csv", {"force_x": "-a", "force_y": "b"}).notes == ()
