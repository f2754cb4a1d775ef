"""Files that `hoof-env compare` reads: what a laboratory may write, what is refused, and in which words."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from hoof_env import cli, records
from hoof_env.lab.compare import compare
from hoof_env.lab.read import read_record
from hoof_env.tasks.horse_gaits import LEGS


@pytest.fixture(scope="module")
def files(of_horse, tmp_path_factory):
    """A record of ours, and the same as a laboratory might have it: 240 Hz, kN, what the limb does to the
    plate, 5 % larger, from 0.4 s on, decimal commas."""
    record, about = of_horse
    folder = tmp_path_factory.mktemp("compare")
    ours = records.write(record, about, folder / "ours.csv")
    time = np.arange(0.4, record["time"][-1], 1 / 240)
    table = {"Seconds": time - 0.4}
    for leg, short in zip(LEGS, ("LF", "RF", "LH", "RH"), strict=True):
        for axis, name in (("x", "Fx"), ("y", "Fz")):
            force = np.interp(time, record["time"], record[f"{leg}_force_{axis}"])
            table[f"{short}_{name} (kN)"] = -1.05e-3 * force
    theirs = folder / "theirs.csv"
    rows = [
        ";".join(f"{value:.6f}".replace(".", ",") for value in row)
        for row in zip(*table.values(), strict=True)
    ]
    theirs.write_text("\n".join([";".join(table), *rows]) + "\n", encoding="utf-8")
    return ours, theirs


MAP = ["time=Seconds"] + [
    f"{leg}_force_{axis}={short}_{name}"
    for leg, short in zip(LEGS, ("LF", "RF", "LH", "RH"), strict=True)
    for axis, name in (("x", "Fx"), ("y", "Fz"))
]


def test_a_laboratory_s_record_with_another_rate_sign_and_unit(files, tmp_path, capsys):
    pytest.importorskip("matplotlib", reason='pip install "hoof-env[lab]"')
    ours, theirs = map(str, files)
    out = tmp_path / "new" / "both.png"
    assert cli.main(["compare", ours, theirs, "--map-b", *MAP, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "B  theirs.csv: 240 Hz, kN" in said
    assert "are turned round" in said
    assert "times of B +0.400 s" in said
    assert all(f"| {leg} | vertical |" in said for leg in LEGS)
    assert out.read_bytes().startswith(b"\x89PNG")
    mapping = dict(pair.split("=") for pair in MAP)
    found = compare(read_record(files[0]), read_record(files[1], mapping))
    for errors in found.limbs.values():
        vertical = errors.forces["vertical"]
        assert vertical.r > 0.998
        assert vertical.peak_error == pytest.approx(0.05 * vertical.peak, rel=0.1)
        assert vertical.impulse_error == pytest.approx(0.05 * vertical.impulse, rel=0.1)
        assert abs(errors.contact_error) < 0.01


def test_every_format_says_the_same(of_horse, tmp_path):
    pytest.importorskip("pyarrow")
    pytest.importorskip("ezc3d")
    record, about = of_horse
    first, *others = (
        read_record(records.write(record, about, tmp_path / f"x{suffix}")) for suffix in records.WRITERS
    )
    for other in others:
        for errors in compare(first, other).limbs.values():
            assert errors.forces["vertical"].rmse < 1e-3
            assert errors.forces["fore-aft"].rmse < 1e-3


STEADY = "time [s],force_x [N],force_y [N]\n0,1,2\n"
BROKEN = {
    "none.csv": (None, "expected a file, found none"),
    "empty.csv": ("", "expected two rows of numbers or more, found fewer"),
    "head.csv": ("time [s],force_y [N]\n", "expected two rows of numbers or more, found fewer"),
    "words.csv": (STEADY + "1,x,2\n", "line 3: expected numbers, got 'x'"),
    "short.csv": (STEADY + "1,2\n", "line 3: expected numbers, got 2 cells under 3"),
    "nan.csv": (STEADY + "1,2,nan\n", "force_y: expected finite numbers, got nan"),
    "twice.csv": ("time,force_y,force_y\n0,1,2\n1,2,3\n", "expected names that differ"),
    "uneven.csv": (STEADY + "1,1,2\n3,1,2\n", "times that increase evenly"),
    "unitless.csv": ("time,force_x,force_y\n0,1,2\n1,1,2\n", "units: expected one of N, kN, N/kg, BW"),
    "pounds.csv": ("time,force_x [lbf],force_y [lbf]\n0,1,2\n1,1,2\n", "which says lbf"),
    "names.csv": ("t,Fx,Fz\n0,1,2\n1,1,2\n", "expected columns of names.csv for time, force_x and force_y"),
    "timeless.csv": ("force_x [N],force_y [N]\n1,2\n1,2\n", "expected a column of timeless.csv for time"),
    "hours.csv": ("time [h],force_x [N],force_y [N]\n0,1,2\n1,1,2\n", "in s or ms, got h"),
    "gap.csv": (STEADY + "".join(f"0.0{k},1,2\n" for k in (1, 2, 4, 5)), "of 0.02 behind 0.02 in row 3"),
    "rows.mot": ("x\nnRows=3\nendheader\ntime ground_force_vy\n0 1\n1 1\n", "expected 3 rows, as its"),
    "columns.mot": ("x\nnColumns=3\nendheader\ntime ground_force_vy\n0 1\n1 1\n", "expected 3 columns, as"),
    "row.mot": ("x\nendheader\ntime a ground_force_vy\n0 1 2\n1 1\n", "got 2 cells under 3 names"),
    "headless.mot": ("time\tground_force_vy\n0\t1\n", "expected a line endheader"),
    "bytes.parquet": ("not a table", "cannot read it"),
    "bytes.c3d": ("not a c3d", "cannot read it"),
    "other.xlsx": ("", "expected a file that ends in .c3d, .csv"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_record_is_one_line_and_leaves_no_picture(name, files, tmp_path, capsys):
    content, words = BROKEN[name]
    if name.endswith(".c3d"):
        pytest.importorskip("ezc3d")
    if content is not None:
        (tmp_path / name).write_text(content, encoding="utf-8")
    out = tmp_path / "x.png"
    assert cli.main(["compare", str(files[0]), str(tmp_path / name), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not out.exists()


WRONG = [
    (["--units-b", "lb"], "units: expected one of"),
    (["--reverse-b", "z"], "reverse: expected one of"),
    (["--map-b", "left_fore=tail"], "map: expected a limb of ours.csv"),
    (["--map-b", "left_fore_force_y=Fz"], "map: expected a column of ours.csv"),
    (["--map-b", "force_x=left_fore_force_x"], "map: expected force_y beside"),
    (["--map-b", "x"], "--map-b: expected a JSON object or key=value"),
    (["--threshold", "-1"], "threshold: expected"),
    (["--threshold", "1e5"], "expected a whole stance above 100000 N, found none"),
    (["--rate-b", "0"], "rate: expected"),
    (["--rate-b", "1e9"], "rate: expected at most 20000000 samples"),
    (["--mass-b", "-3"], "mass: expected"),
    (["--align", "best"], "align: expected one of"),
    (["--units", "lb"], "units: expected one of"),
    (["--out", "x.jpg"], "out: expected a file that ends in .pdf, .png, .svg"),
]


@pytest.mark.parametrize(("options", "words"), WRONG)
def test_a_wrong_option_is_one_line(options, words, files, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["compare", str(files[0]), str(files[0]), *options]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_missing_packages_are_named(files, capsys, monkeypatch, tmp_path):
    (tmp_path / "x.parquet").touch()
    for package, file, words in (
        ("matplotlib", files[0], 'pictures need matplotlib: pip install "hoof-env[lab]"'),
        ("pyarrow", tmp_path / "x.parquet", 'Parquet needs pyarrow: pip install "hoof-env[export]"'),
    ):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, package, None)
            out = str(tmp_path / "x.png")
            assert cli.main(["compare", str(files[0]), str(file), "--out", out]) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1


def test_a_record_without_time_takes_a_rate_and_milliseconds_are_known(tmp_path):
    rows = "".join(f"{k},0,{k}\n" for k in range(11))
    (tmp_path / "a.csv").write_text("time [ms],force_x [N],force_y [N]\n" + rows)
    assert read_record(tmp_path / "a.csv").rate == pytest.approx(1000.0)
    assert read_record(tmp_path / "a.csv", rate=50.0).rate == pytest.approx(50.0)


LENIENT = {
    "words.csv": "time [s],event,force_x [N],force_y [N]\n0,on,1,2\n1,,1,2\n",
    "empty.csv": "time [s],force_x [N],force_y [N],note,\n0,1,2,,\n1,1,2,,\n",
    "twice.csv": "x,x,time [s],force_x [N],force_y [N]\n7,7,0,1,2\n7,7,1,1,2\n",
    "units.csv": "time,force_x,force_y\ns,N,N\n0,1,2\n1,1,2\n",
    "brackets.tsv": "time\tforce_x\tforce_y\n[ms]\t[N]\t[N]\n0\t1\t2\n1000\t1\t2\n",
    "blanks.txt": "time force_x [N]  force_y (N)\n 0  1 2\n 1  1 2\n",
    "blanks.mot": "x\nnRows=2\nendheader\n time   ground_force_vx ground_force_vy\n  0 1  2\n1 1 2\n",
}


@pytest.mark.parametrize("name", LENIENT)
def test_what_is_not_needed_may_be_as_it_likes(name, tmp_path):
    (tmp_path / name).write_text(LENIENT[name], encoding="utf-8")
    found = read_record(tmp_path / name)
    assert (found.unit, found.rate) == ("N", 1.0)
    np.testing.assert_array_equal(found.limbs["leg"], [[1.0, 2.0]] * 2)


def test_a_minus_turns_a_column_and_a_limb_can_be_renamed(tmp_path):
    (tmp_path / "a.csv").write_text("time,lf_force_x [N],lf_force_y [N]\n0,1,2\n1,1,2\n")
    found = read_record(tmp_path / "a.csv", {"left_fore": "lf"})
    np.testing.assert_array_equal(found.limbs["left_fore"], [[1.0, 2.0]] * 2)
    mapping = {"left_fore_force_x": "-lf_force_x", "left_fore_force_y": "lf_force_y"}
    found = read_record(tmp_path / "a.csv", mapping)
    np.testing.assert_array_equal(found.limbs["left_fore"], [[-1.0, 2.0]] * 2)


@pytest.mark.parametrize(
    ("reverse", "signs"), [("none", (1, 1)), ("x", (-1, 1)), ("y", (1, -1)), ("auto", (1, 1))]
)
def test_components_are_reversed_on_demand(reverse, signs, tmp_path):
    (tmp_path / "a.csv").write_text("time,force_x [N],force_y [N]\n0,1,2\n1,1,2\n")
    found = read_record(tmp_path / "a.csv", reverse=reverse)
    np.testing.assert_array_equal(found.limbs["leg"], [np.multiply([1.0, 2.0], signs)] * 2)
