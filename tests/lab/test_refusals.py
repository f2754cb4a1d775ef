"""Bad records of laboratories, by the words of each error: files that are read (`FILES`), options of commands
(`OPTIONS`), calls that compare, average and write (`CALLS`), missing packages (`MISSING`)."""

from __future__ import annotations

import re
import sys

import gymnasium as gym
import numpy as np
import pytest

from hoof_env import cli, records
from hoof_env.commands.lab import ComparisonArgs
from hoof_env.errors import DataFileError, MissingExtraError, ParameterError
from hoof_env.lab.average import average
from hoof_env.lab.c3d import write_c3d
from hoof_env.lab.columns import parse_mapping
from hoof_env.lab.compare import compare
from hoof_env.lab.forces import in_units, limbs_of
from hoof_env.lab.opensim import check_bodies
from hoof_env.lab.reactions import JointReactions
from hoof_env.lab.read import read_record
from tests.lab.made import BOTH, OFFSETS, ROWS, TIME, UP, changed, plate, strides, table, text

STEADY = "time [s],force_x [N],force_y [N]\n0,1,2\n"
NAMED = "time [s],left_force_x [N],left_force_y [N]\n"

NEXUS = (
    "Devices\n1000\n,,Plate 1,,Plate 2,\nFrame,Sub Frame,Fx,Fz,Fx,Fz\n,,N,N,N,N\n"
    + text(np.column_stack([np.arange(300), 0 * TIME, BOTH, -0.5 * BOTH]))
    + "\nTrajectories\n100\n,,trunk\nFrame,Sub Frame,X\n,,mm\n1,0,3.5\n"
)
"""Names that repeat for each plate, as Vicon Nexus writes them, with another table below."""


def cut(part):
    """A c3d file of which a part is there."""

    def write(path):
        content = plate(path).read_bytes()
        path.write_bytes(content[: int(part * len(content))])

    return write


def lacks(missing, rate, decimals):
    """A text in which a sample is left out."""
    times = np.delete(np.round(np.arange(900) / rate, decimals), missing)
    return lambda path: table(path, times)


def twice(path):
    """Two plates."""
    return plate(path, offsets=OFFSETS)


def of_plate(group, name, value):
    """A plate's file with another value of a parameter."""
    return lambda path: changed(plate(path), group, name, value)


FILES = [
    ("none.csv", None, {}, DataFileError, "expected .*found none"),
    ("empty.csv", "", {}, DataFileError, "expected two rows .*found fewer"),
    ("head.csv", "time [s],force_y [N]\n", {}, DataFileError, "expected two rows .*found"),
    ("words.csv", STEADY + "1,x,2\n", {}, DataFileError, "line 3: expected numbers, got 'x'"),
    ("short.csv", STEADY + "1,2\n", {}, DataFileError, "line 3: expected numbers, got 2 cells under 3"),
    ("nan.csv", STEADY + "1,2,nan\n", {}, DataFileError, "force_y: expected .*got nan"),
    ("twice.csv", "time,force_y,force_y\n0,1,2\n1,2,3\n", {}, DataFileError, "expected names that differ"),
    ("uneven.csv", STEADY + "1,1,2\n3,1,2\n", {}, DataFileError, "expected evenly spaced times"),
    ("unitless.csv", "time,force_x,force_y\n0,1,2\n1,1,2\n", {}, ParameterError,
     "units: expected .*N, kN, N/kg, BW"),
    ("pounds.csv", "time,force_x [lbf],force_y [lbf]\n0,1,2\n1,1,2\n", {}, ParameterError, "which says lbf"),
    ("names.csv", "t,Fx,Fz\n0,1,2\n1,1,2\n", {}, ParameterError,
     "expected columns of names.csv for time, force_x and force_y"),
    ("timeless.csv", "force_x [N],force_y [N]\n1,2\n1,2\n", {}, ParameterError,
     "expected a column of timeless.csv for time"),
    ("frames.csv", "time [frames],force_x [N],force_y [N]\n0,1,2\n1,1,2\n", {}, ParameterError,
     r"in s, ms, us, ns, min, h or d, got frames; .* give the rate \(--rate-a, --rate-b\)"),
    ("gap.csv", STEADY + "".join(f"0.0{k},1,2\n" for k in (1, 2, 4, 5)), {}, DataFileError,
     "of 0.02 after 0.02 in row 3"),
    ("blanks.mot", "x\nendheader\ntime left fore_force_vy\n0 1\n1 1\n", {}, DataFileError,
     "line 4: .* 2 cells under 3 names in line 3; names with blanks in them need tabs between"),
    ("cut.csv", STEADY + "0.1,1,2\n0.2,1", {}, DataFileError,
     "line 4: expected numbers, got 2 cells under 3 names in line 1; is the file cut off there"),
    *(
        (f"nameless.{suffix}", above + text(ROWS, "\t"), {}, ParameterError,
         rf"a line of names above the numbers of nameless.{suffix}, which begin in line {line}, found none; "
         r"columns may be named by number, as time=#1 force_y=#3 \(--map-a, --map-b\), of #1, #2, #3")
        for suffix, above, line in (
            ("csv", "", 1), ("txt", "lab X\ntrial 3\n\n", 4), ("mot", "x\nnRows=300\nendheader\n", 4),
        )
    ),
    ("load.csv", NAMED + text(ROWS[:60]) + "0.6,nan,nan\n" + text(ROWS[61:]), {}, DataFileError,
     "left_force_y: .* got nan in line 62, under load .1 such values.; --gaps-a=line or --gaps-b=line lays"),
    ("start.csv", NAMED + text(ROWS[:36]) + "".join(f"{t},,\n" for t in TIME[36:46]) + text(ROWS[46:]), {},
     DataFileError, "left_force_y: .* got nan in line 38, under load"),
    ("none.txt", NAMED + "".join(f"{t},1,NA\n" for t in TIME), {}, DataFileError,
     "left_force_y: expected numbers, got none from line 2 on; name another column by --map-a"),
    ("when.csv", NAMED + text(ROWS[:60]) + ",0,0\n" + text(ROWS[61:]), {}, DataFileError,
     "time: expected finite numbers, got nan in line 62; .* give their rate"),
    ("clock.csv", NAMED + "".join(f"0:00:{t:05.2f},0,1\n" for t in TIME) + "later,0,1\n", {}, DataFileError,
     "time: line 302: expected a time as '0:00:00.00', got 'later'; .* give their rate"),
    ("row.mot", "x\nendheader\ntime a ground_force_vy\n0 1 2\n1 1\n", {}, DataFileError,
     "got 2 cells under 3 names"),
    ("headless.mot", "time\tground_force_vy\n0\t1\n", {}, DataFileError, "expected a line endheader"),
    ("bytes.parquet", "not a table", {}, DataFileError, "expected a .parquet .*read, cannot"),
    ("bytes.c3d", "not a c3d", {}, DataFileError, "cannot read it"),
    ("other.xlsx", "", {}, ParameterError, "expected .*.c3d, .csv"),
    # texts in the layouts of laboratories
    ("garbage.csv", NAMED + text(ROWS[:50]) + "no numbers\n" + text(ROWS[50:]), {}, DataFileError,
     "line 52: expected numbers"),
    ("both.txt", "time\tleft_force_y [N]\n0.1\t1,234\n0.2\t987.5\n", {}, DataFileError,
     "'1,234' beside numbers with decimal"),
    ("thousands.txt", "time\tleft_force_y [N]\n0,1\t980\n0,2\t1,020\n0,3\t990\n", {}, DataFileError,
     "line 3: expected numbers, got '1,020' beside whole numbers .*thousands"),
    ("zeros.csv", NAMED + "0,\0,1\n", {}, DataFileError, "found bytes 0 in line 2; save .*UTF-8"),
    ("nexus.csv", NEXUS, {"mapping": {"force_y": "Fz"}, "rate": 100}, DataFileError,
     r"names in line 4: .*got 'Fz' 2 times; choose Fz#1 \(Plate 1\), Fz#2 \(Plate 2\)"),
    ("opposite.csv", "time,p-1 [N],p-2 [N]\n" + text(np.column_stack([TIME, UP, -UP])),
     {"mapping": {"left_force_y": "p-1+p-2"}}, ParameterError,
     "for left, got p-1 upward and p-2 downward; a minus before"),
    ("axes.csv", NAMED.replace("_y", "_z") + text(ROWS),
     {"mapping": {"force_y": "left_force_z"}, "up": "z"}, ParameterError,
     r"up, forward: expected .*columns of axes\.csv"),
    # a sample is missing
    *(
        ("missing.csv", lacks(missing, rate, decimals), {}, DataFileError,
         rf"of {int(2000 / rate) / 1000}\d* after .*in row {missing}; .*\(--rate-a, --rate-b\)")
        for missing in (1, 200, 450, 898)
        for rate, decimals in ((600, 4), (1000, 3), (100, 2), (960, 6))
    ),
    # force plates
    *(
        ("cut.c3d", cut(part), {}, DataFileError,
         "frames, .*header says, found .*: .*cut off")
        for part in (0.6, 0.95)
    ),
    ("volts.c3d", of_plate("ANALOG", "UNITS", ["V"] * 6), {}, ParameterError,
     "volts.c3d, .*V; name .*--units-a"),
    ("mixed.c3d", of_plate("ANALOG", "UNITS", ["N", "N", "kN", "V", "V", "V"]), {}, ParameterError,
     "mixed.c3d, .*N and kN; name .*--units-a"),
    ("plates.c3d", of_plate("FORCE_PLATFORM", "USED", [0]), {}, DataFileError, "found no force plates"),
    *(
        ("corners.c3d", of_plate("FORCE_PLATFORM", "CORNERS", corners), {}, DataFileError,
         r"plate_1: expected forces, .*FORCE_PLATFORM:CORNERS")
        for corners in (np.zeros((3, 4, 1)), np.full((3, 4, 1), np.nan))
    ),
    ("scale.c3d", of_plate("ANALOG", "GEN_SCALE", [0.0]), {}, DataFileError,
     "plate_1: expected forces, .*ANALOG:GEN_SCALE"),
    ("type.c3d", of_plate("FORCE_PLATFORM", "TYPE", [6]), {}, DataFileError,
     r"cannot read it \(ezc3d says: Type 6 is not supported yet\)"),
    ("forward.c3d", plate, {"forward": "z"}, ParameterError,
     r"forward: expected another axis than upward \(z\)"),
    ("minus.c3d", twice, {"mapping": {"left": "plate_1-plate_2"}}, ParameterError,
     r"map: expected a limb of minus\.c3d .*, got left=plate_1-plate_2"),
    ("once.c3d", twice, {"mapping": {"left": "plate_1", "right": "plate_1"}}, ParameterError,
     r"expected plate_1 of once\.c3d once, got .*left .*right"),
]  # fmt: skip
"""File, its content or what writes it, arguments of `read_record`, class and words of the error."""


def has(package):
    """The test is skipped where an optional package is missing."""
    pytest.importorskip(package, reason='pip install "hoof-env[lab]"')


@pytest.mark.parametrize(
    ("name", "content", "arguments", "error", "words"),
    FILES,
    ids=[f"{row[0]}-{row[4]}"[:60] for row in FILES],
)
def test_files(name, content, arguments, error, words, tmp_path, capsys):
    """Each error is one line; the command that compares says the same and leaves no picture."""
    if name.endswith(".c3d"):
        has("ezc3d")
    if name.endswith(".parquet"):
        has("pyarrow")
    path = tmp_path / name
    if callable(content):
        content(path)
    elif content is not None:
        path.write_text(content, encoding="utf-8")
    with pytest.raises(error, match=words) as caught:
        read_record(path, **arguments)
    said = str(caught.value)
    assert "\n" not in said
    assert name in said
    if not arguments:
        has("matplotlib")
        good, out = table(tmp_path / "good.csv", TIME), tmp_path / "x.png"
        assert cli.main(["compare", str(good), str(path), "--out", str(out)]) == 2
        assert capsys.readouterr().err == f"hoof-env: error: {said}\n"
        assert not out.exists()


OPTIONS = [
    (["compare", "a.csv", "a.csv", *options], words)
    for options, words in (
        (["--units-b", "lb"], "units: expected one of"),
        (["--reverse-b", "z"], "reverse: expected one of"),
        (["--map-b", "left_fore=tail"], "map: expected a limb .*.csv"),
        (["--map-b", "left_fore_force_y=Fz"], "map: expected a column .*.csv"),
        (["--map-b", "force_x=left_force_x"], "map: expected force_y beside"),
        (["--map-b", "x"], "--map-b: expected a JSON .*key=value"),
        (["--threshold", "-1"], "threshold: expected"),
        (["--threshold", "1e5"], "expected .*stance above 100000 N, found none"),
        (["--rate-b", "0"], "rate: expected"),
        (["--rate-b", "1e9"], "rate: expected .*20000000 samples"),
        (["--mass-b", "-3"], "mass: expected"),
        (["--align", "best"], "align: expected one of"),
        (["--units", "lb"], "units: expected one of"),
        (["--out", "x.jpg"], "out: expected .*.pdf, .png, .svg"),
    )
] + [
    (["average", "a.csv", "--out", "x.csv", "--forward", "w"],
     "forward: expected .*-x, -y, -z, auto, x, y, z, got 'w'"),
    (["average", "b.csv", "--out", "x.csv"], "b.csv, .*none; name .*--units-in\n"),
    (["average", "a.csv", "--out", "x.txt"], "out: expected .*.csv"),
    (["average", "a.csv", "--out", "b.csv"], "'b.csv' exists already; name .*add --overwrite"),
]  # fmt: skip
"""Command line and words."""


@pytest.mark.parametrize(("command", "words"), OPTIONS, ids=[" ".join(row[0][1:])[:60] for row in OPTIONS])
def test_options(command, words, tmp_path, capsys, monkeypatch):
    """Each is one line, and no file is written or changed."""
    has("matplotlib")
    monkeypatch.chdir(tmp_path)
    table(tmp_path / "a.csv", TIME)
    (tmp_path / "b.csv").write_text("time,left_force_y\n0,1\n1,2\n")
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert cli.main(command) == 2
    said = capsys.readouterr().err
    assert re.search(words, said), said
    assert said.count("\n") == 1
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def changed_limbs(change, names=("left", "right")):
    """A record whose forces are changed by a function."""
    record = strides()
    record.limbs = {name: change(force) for name, force in zip(names, record.limbs.values(), strict=True)}
    return record


def part_of(path, low, high):
    """Read a record from a time to another [s]."""
    return read_record(table(path, np.arange(round(100 * low), round(100 * high) + 1) / 100))


def apart(path):
    """Compare a record with one that begins when it has ended."""
    late = 0.5 + TIME
    a, c = table(path / "a.csv", TIME), table(path / "c.csv", late + 10.0, late)
    return compare(read_record(a), read_record(c), "none")


WEIGHED = {"unit": "BW", "scale": 1 / 900}
LONG = {name: np.zeros(70_000) for name in ("time", "force_x", "force_y")}


def mean(*trials, **arguments):
    return lambda _: average(list(trials), **arguments)


def pair(a, b, *arguments, **more):
    return lambda _: compare(a, b, *arguments, **more)


CALLS = [
    # comparing
    (apart, ParameterError, "overlap, got 0 to 2.99 s .*.csv and 10.5 to 13.49 s of c.csv"),
    *(
        (lambda path, low=low, high=high: compare(part_of(path / "a.csv", 0, 2.99),
                                                  part_of(path / "b.csv", low, high)),
         DataFileError, f"whole stance above 20 N, found none: .*cut off by {where}")
        for low, high, where in (
            (0.0, 0.6, r"the end \(0.6 s\)"), (0.5, 1.2, r"the start \(0.5 s\)"),
            (0.5, 0.8, r"both ends of the record \(0.5 and 0.8 s\)"),
        )
    ),
    (pair(strides(), strides(unit="BW")), ParameterError,
     r"mass-b: expected the mass \[kg\].*compare N with BW"),
    (pair(strides(), strides(scale=0.0)), DataFileError,
     "'0.csv': expected .*stance above 20 N, found none: the h"),
    (pair(strides(), changed_limbs(lambda force: force + np.array([0.0, 30.0]))), DataFileError,
     "hardly falls below 30 N; subtract the plate's offset, or raise"),
    (pair(strides(), changed_limbs(np.copy, ("plate_1", "plate_2"))), ParameterError,
     "has left, right, .*has plate_1, plate_2; name .*in"),
    (pair(strides(), strides(), "best"), ParameterError, "align: expected one of"),
    (pair(strides(**WEIGHED, weight=900.0), strides(**WEIGHED), threshold=50.0), ParameterError,
     r"mass-b: expected the mass \[kg\] .*to know 50 N in body weights"),
    (pair(strides(**WEIGHED), strides(**WEIGHED, weight=900.0), threshold=50.0), ParameterError,
     "mass-a: expected"),
    # averaging
    (mean(strides(), units="BW"), ParameterError,
     r"mass: expected the mass \[kg\] .*animal of 1\.csv, .*N in BW"),
    (mean(strides(scale=0.01)), DataFileError,
     "0.01.csv: left: expected .*stance above 20 N, found none: the highest"),
    (mean(strides(), points=1), ParameterError, "points: expected .*2 or more"),
    (mean(), ParameterError, "records: expected .*got none"),
    # columns, units, bodies, writing
    *(
        (lambda _, items=items: parse_mapping("--map-b", items), ParameterError,
         f"--map-b: expected .*{words}")
        for items, words in (
            (["=x"], "key=value"), (["a=1", "a=2"], "a once, got a=1 and a=2"), (["{x"], "JSON"),
        )
    ),
    (lambda _: in_units({}, {"weight_n": 1.0, "units": {}}, "lb"), ParameterError,
     "units: expected .*BW, N"),
    (lambda _: limbs_of(["time"]), ParameterError, "expected a column force_y, got time"),
    *(
        (lambda _, bodies=bodies: check_bodies(bodies, [""]), ParameterError, "bodies: expected leg=BODY")
        for bodies in ({"tail": "x"}, {"leg": ""}, {"leg": 3})
    ),
    (lambda path: write_c3d(LONG, {}, path / "long.c3d"), ParameterError,
     "at most 65535 frames .*c3d, got 70000"),
    (lambda _: JointReactions(gym.make("hoof_env/HorseLegFixed-v0", solver="paper")), ParameterError,
     "reactions: expected an environment with solver"),
]  # fmt: skip
"""Call with a folder, class and words of the error."""


@pytest.mark.parametrize(("call", "error", "words"), CALLS, ids=[row[2][:60] for row in CALLS])
def test_calls(call, error, words, tmp_path):
    with pytest.raises(error, match=words):
        call(tmp_path)
    assert not list(tmp_path.glob("*.c3d"))


MISSING = [
    ("ezc3d", lambda path: records.export_episode(path / "y.c3d", "run", "asked for by none"),
     r'c3d needs ezc3d: pip install "hoof-env\[lab\]"'),
    ("ezc3d", lambda path: read_record(path / "x.c3d"), r'c3d needs ezc3d: pip install "hoof-env\[lab\]"'),
    ("pyarrow", lambda path: read_record(path / "x.parquet"),
     r'Parquet needs pyarrow: pip install "hoof-env\[export\]"'),
    ("matplotlib", lambda path: cli.compare(ComparisonArgs(path / "a.csv", path / "b.csv", path / "x.png")),
     r'pictures need matplotlib: pip install "hoof-env\[lab\]"'),
]  # fmt: skip
"""Package, call with a folder, words."""


@pytest.mark.parametrize(("package", "call", "words"), MISSING)
def test_missing_packages(package, call, words, tmp_path, monkeypatch):
    """Named with the extra that has them, before anything is read or played."""
    monkeypatch.setitem(sys.modules, package, None)
    for name in ("x.c3d", "x.parquet"):
        (tmp_path / name).touch()
    with pytest.raises(MissingExtraError, match=words) as caught:
        call(tmp_path)
    assert "\n" not in str(caught.value)
