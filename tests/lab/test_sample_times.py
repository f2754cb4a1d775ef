"""Times of records: rounded ones, those of other units, and the clock of the file."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env.lab.compare import compare
from hoof_env.lab.picture import report
from hoof_env.lab.read import read_record
from tests.lab.made import table


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


def test_a_round_time_at_the_end_is_no_coarse_digit(tmp_path):
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


def test_a_rate_that_does_not_fit_the_times_is_said(tmp_path):
    path = table(tmp_path / "x.csv", LATE)
    found = read_record(path, rate=50)
    assert found.time[0] == 0.5
    assert "times of time imply 100 Hz, not the given 50 Hz" in found.notes[0]
    found = read_record(table(tmp_path / "y.csv", 100 * LATE, LATE, "time"), rate=100)
    assert (found.time[0], len(found.notes)) == (0.0, 1)
    assert "fit 100 Hz neither in s nor in ms; the record begins at 0 s" in found.notes[0]


def test_milliseconds_without_a_unit_are_said_with_the_remedy(tmp_path):
    found = read_record(table(tmp_path / "x.csv", 1000 * LATE, LATE, "time"))
    assert "imply 0.1 Hz; if they are in ms, write time [ms] above them, or give the rate" in found.notes[0]
    truth = read_record(table(tmp_path / "y.csv", LATE))
    said = report(compare(truth, found))
    assert "warning: x.csv: times of time have no unit; read as s they imply 0.1" in said
    assert "or give the rate (--rate-b)" in said
    assert read_record(tmp_path / "x.csv", rate=100).time[0] == pytest.approx(0.5)


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
