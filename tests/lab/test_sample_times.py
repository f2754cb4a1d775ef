"""Times of records: rounded times, times in other units, and the clock of the file."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest

from hoof_env.lab.compare import compare
from hoof_env.lab.picture import report
from hoof_env.lab.read import read_record
from tests.lab.made import force, table


@pytest.mark.parametrize(("rate", "decimals"), [
    (600, 4), (1200, 4), (1200, 5), (240, 3), (960, 3), (1200, 3), (1500, 3), (60, 2), (119.88, 4),
])  # fmt: skip
def test_times_that_are_rounded_are_even(rate, decimals, tmp_path):
    time = 0.5 + np.arange(round(3 * rate)) / rate
    found = read_record(table(tmp_path / "x.csv", np.round(time, decimals), time))
    assert found.rate == pytest.approx(rate, rel=2e-4)
    np.testing.assert_allclose(found.time, time, atol=0.6 * 10.0**-decimals)
    whole = read_record(table(tmp_path / "y.csv", time, form="%.12g"))
    errors = compare(whole, found, "none").limbs["left"]
    assert errors.forces["vertical"].rmse < 5000 * 0.6 * 10.0**-decimals


def test_times_with_six_digits_are_even(tmp_path):
    """As "%.6g" writes them: with fewer decimals from 10 s on."""
    time = 8.0 + np.arange(3000) / 600
    found = read_record(table(tmp_path / "x.csv", time, form="%.6g"))
    assert found.rate == pytest.approx(600)


def test_a_round_time_at_the_end_does_not_count_as_a_coarse_digit(tmp_path):
    time = np.round(np.arange(601) / 60, 3)  # the last is 10
    assert read_record(table(tmp_path / "x.csv", time)).rate == pytest.approx(60)


LATE = 0.5 + np.arange(300) / 100


@pytest.mark.parametrize(("name", "scale"), [
    ("time [s]", 1), ("time", 1), ("time (ms)", 1000), ("time", 1000), ("Time [sec]", 1),
])  # fmt: skip
def test_a_rate_keeps_the_time_at_which_a_file_starts(name, scale, tmp_path):
    found = read_record(table(tmp_path / "x.csv", scale * LATE, LATE, name), rate=100)
    assert found.notes == ()
    np.testing.assert_allclose(found.time, LATE)


def test_a_rate_that_does_not_fit_the_times_is_reported(tmp_path):
    path = table(tmp_path / "x.csv", LATE)
    found = read_record(path, rate=50)
    assert found.time[0] == 0.5
    assert "times of time imply 100 Hz, not the given 50 Hz" in found.notes[0]
    found = read_record(table(tmp_path / "y.csv", 100 * LATE, LATE, "time"), rate=100)
    assert (found.time[0], len(found.notes)) == (0.0, 1)
    assert "fit 100 Hz in no unit of time; the record begins at 0 s" in found.notes[0]


EPOCH = 1_700_000_000


@pytest.mark.parametrize("start", [0, EPOCH])
@pytest.mark.parametrize(("unit", "per_second"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_unit_is_found_and_reported(unit, per_second, start, tmp_path):
    """Counts of ns since 1970 are rounded to 256 ns in doubles."""
    count = start * per_second + LATE * per_second
    found = read_record(table(tmp_path / "x.csv", count, LATE, "time", "%.0f"))
    np.testing.assert_allclose(found.time, start + LATE, atol=1e-6)
    assert f"in s they imply {100 / per_second:g} Hz, so they are read in {unit}, 100 Hz" in found.notes[0]
    truth = read_record(table(tmp_path / "y.csv", LATE))
    said = report(compare(truth, found))
    assert "warning: x.csv: times of time have no unit; in s they imply" in said
    assert "write time [s] above them, and if they count samples, give the rate (--rate-b)" in said
    assert read_record(tmp_path / "x.csv", rate=100).time[0] == pytest.approx(start + 0.5)
    named = read_record(table(tmp_path / "z.csv", count, LATE, f"time [{unit}]", "%.0f"))
    np.testing.assert_allclose(named.time, start + LATE, atol=1e-6)
    assert named.notes == ()


def test_days_of_a_spreadsheet_are_found(tmp_path):
    found = read_record(table(tmp_path / "x.csv", 45000.5 + LATE / 86400, LATE, "time", "%.11f"))
    assert found.rate == pytest.approx(100, rel=1e-3)
    assert "so they are read in d, 100 Hz" in found.notes[0]


def test_steps_of_one_may_count_samples(tmp_path):
    found = read_record(table(tmp_path / "x.csv", np.arange(300), LATE, "time"))
    assert "imply 1 Hz, implausible for a force plate; if they are in ms, write time [ms]" in found.notes[0]
    assert "count samples, give the rate" in found.notes[0]


DAY = datetime(2024, 2, 28, 23, 59, 58)
"""Two seconds before midnight."""

CLOCKS = {
    "2024-02-28T23:59:58.500": lambda t: (DAY + timedelta(seconds=t)).isoformat(timespec="milliseconds"),
    "with a zone": lambda t: (DAY + timedelta(seconds=t)).isoformat(timespec="microseconds") + "+01:00",
    "with Z": lambda t: f"{(DAY + timedelta(seconds=t)).isoformat(' ', timespec='milliseconds')}Z",
    "28.02.2024": lambda t: (DAY + timedelta(seconds=t)).strftime("%d.%m.%Y %H:%M:%S.%f"),
    "02/28/2024": lambda t: (DAY + timedelta(seconds=t)).strftime("%m/%d/%Y %H:%M:%S.%f"),
    "23:59:58.500": lambda t: (DAY + timedelta(seconds=t)).strftime("%H:%M:%S.%f")[:-3],
    "11:59:58.500 PM": lambda t: (DAY + timedelta(seconds=t)).strftime("%I:%M:%S.%f %p"),
    "0:00:00.500": lambda t: f"0:00:{t:06.3f}",
    "1:00.500": lambda t: f"1:{t:06.3f}",
    "0 days 00:00:00.500000": lambda t: f"0 days 00:00:{t:09.6f}",
}


@pytest.mark.parametrize("said", CLOCKS.values(), ids=CLOCKS)
def test_durations_and_times_of_day_are_read(said, tmp_path):
    rows = [f"{said(t)},{x:.6f},{y:.6f}" for t, (x, y) in zip(LATE, force(LATE), strict=True)]
    (tmp_path / "x.csv").write_text("\n".join(["time,left_force_x [N],left_force_y [N]", *rows]))
    found = read_record(tmp_path / "x.csv")
    first = said(0.5)
    start = 0.5 if first[0] == "0" and first[1] in ": " else 60.5 if first[:2] == "1:" else 86398.5
    np.testing.assert_allclose(found.time, start + np.arange(300) / 100, atol=1e-9)
    dated = "2024" in said(0.5)
    assert found.notes == (("time: times are counted from midnight of 2024-02-28",) if dated else ())


def clocks(arrow):
    """Columns of times in the types of Parquet, and their first time [s]."""
    ns = np.round(LATE * 1e9).astype(np.int64)
    for unit, per in (("ns", 1), ("us", 1000), ("ms", 1_000_000)):
        yield arrow.array(ns // per, arrow.duration(unit)), 0.5
        yield arrow.array((EPOCH * 10**9 + ns) // per, arrow.timestamp(unit)), EPOCH % 86400 + 0.5
    yield arrow.array(EPOCH * 10**9 + ns, arrow.timestamp("ns", tz="UTC")), EPOCH % 86400 + 0.5
    yield arrow.array(ns, arrow.time64("ns")), 0.5


def test_times_of_parquet_are_read(tmp_path):
    arrow = pytest.importorskip("pyarrow", reason='pip install "hoof-env[export]"')
    from pyarrow import parquet

    for column, start in clocks(arrow):
        rows = {"time": column, "left_force_x": force(LATE)[:, 0], "left_force_y": force(LATE)[:, 1]}
        parquet.write_table(arrow.table(rows), tmp_path / "x.parquet")
        found = read_record(tmp_path / "x.parquet", unit="N")
        np.testing.assert_allclose(found.time, start + np.arange(300) / 100, atol=1e-6)


def test_shift_and_span_are_of_the_clocks_of_the_files(tmp_path):
    a = read_record(table(tmp_path / "a.csv", np.arange(300) / 100))
    b = read_record(table(tmp_path / "b.csv", LATE))
    for align in ("none", "shift", "stances"):
        found = compare(a, b, align)
        assert found.limbs["left"].forces["vertical"].rmse < 1e-9
        assert found.shift == pytest.approx(0.0)
    moved = read_record(table(tmp_path / "c.csv", LATE + 10.0, LATE))
    assert compare(a, moved).shift == pytest.approx(-10.0)
    assert "left, 10.5 to 13.49 s" in report(compare(a, moved))


def test_records_between_each_other_s_samples_are_compared_at_the_same_times(tmp_path):
    fine = np.arange(3000) / 1000
    a = read_record(table(tmp_path / "a.csv", fine))
    b = read_record(table(tmp_path / "b.csv", fine + 0.2345))
    assert compare(a, b, "none").limbs["left"].forces["vertical"].rmse < 0.5
