"""Files that `hoof-env compare` reads: what a laboratory may write, what is refused, and in which words."""

from __future__ import annotations

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
