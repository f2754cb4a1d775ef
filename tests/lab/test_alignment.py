"""Alignment of two records: every stride that both have is compared, and what is left out is said."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env.lab.compare import compare
from hoof_env.lab.picture import report
from hoof_env.lab.read import ForceRecord

RATE = 500


def steps(
    strides=10, varies=0.02, jitter=0.0, change=None, low=0.0, high=np.inf, clock=0.0, noise=0.0, period=1.0
):
    """Half sine waves in half of each stride, of heights and periods that vary; `change` acts on time,
    touchdowns and force. A part of the record from `low` to `high` [s], by a clock that is `clock` ahead."""
    random = np.random.default_rng(1)
    periods = period * (1 + jitter * random.standard_normal(strides))
    heights = 800 * (1 + varies * random.standard_normal(strides))
    touch = 0.1 + np.append(0.0, np.cumsum(periods))
    time = np.arange(round(touch[-1] * RATE)) / RATE
    up = np.zeros_like(time)
    for begin, long, height in zip(touch, periods, heights, strict=False):
        up += (
            height * np.sin(np.pi * (time - begin) / (0.5 * long)) * (abs(time - begin - long / 4) < long / 4)
        )
    if change:
        change(time, touch, up)
    up += np.random.default_rng(2).normal(0, noise, up.shape) if noise else 0.0
    kept = (time >= low) & (time < high)
    force = np.column_stack([0 * up, up])[kept]
    return ForceRecord("x.csv", time[kept] + clock, {"left": force}, "N", 600.0)


def higher(first, last=None):
    """Half again as high, from one stride to another."""

    def change(time, touch, up):
        up[(time >= touch[first]) & (time < touch[(first if last is None else last) + 1])] *= 1.5

    return change


def spike(time, touch, up):
    up[np.searchsorted(time, touch[1] + 0.25)] += 4000.0


def joined(time, touch, up):
    """Two stances that run into each other."""
    between = (time > touch[4] + 0.1) & (time < touch[5] + 0.3)
    up[between] = np.maximum(up[between], 400.0)


FAULTS = {f"stride {k} half again as high": higher(k) for k in (0, 1, 4, 8, 9)} | {
    "the second half": higher(5, 9),
    "a spike": spike,
}


@pytest.mark.parametrize("jitter", [0.0, 0.03])
@pytest.mark.parametrize("varies", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("change", FAULTS.values(), ids=FAULTS)
def test_a_faulty_stride_is_compared_and_not_shifted_out(change, varies, jitter):
    a, b = steps(varies=varies, jitter=jitter), steps(varies=varies, jitter=jitter, change=change)
    errors = compare(a, b).limbs["left"]
    assert (errors.pairs, errors.stances) == (10, (10, 10))
    own = [record.limbs["left"][:, 1] for record in (a, b)]
    touch = np.flatnonzero((own[0][1:] > 0) & (own[0][:-1] == 0))
    peaks = [[stride.max() for stride in np.split(force, touch)[1:]] for force in own]
    assert errors.forces["vertical"].peak_error == pytest.approx(
        np.mean(peaks[1]) - np.mean(peaks[0]), abs=0.5
    )


@pytest.mark.parametrize("strides", [2, 3, 4])
def test_of_few_strides_all_are_compared(strides):
    for k in range(strides):
        a, b = steps(strides, jitter=0.02), steps(strides, jitter=0.02, change=higher(k), noise=3.0)
        assert compare(a, b).limbs["left"].pairs == strides


def test_stances_that_one_record_joins_are_reported():
    found = compare(steps(), steps(change=joined))
    assert found.limbs["left"].stances == (10, 9)
    assert "A has 10 whole stances and B 9" in " ".join(found.warnings)
    assert "Whole stances that are not compared: left 1 of 10 in A." in report(found)


@pytest.mark.parametrize(("low", "high"), [(2.27, 8.0), (0.0, 4.5), (5.6, 99.0)])
def test_an_excerpt_is_found_at_its_place(low, high):
    found = compare(steps(), steps(low=low, high=high, clock=3.0, noise=2.0))
    assert found.shift == pytest.approx(-3.0, abs=0.01)
    assert found.warnings == []
    assert f"left {10 - found.limbs['left'].pairs} of 10 in A." in report(found)


@pytest.mark.parametrize("jitter", [0.0, 0.03])
def test_records_that_began_at_different_times_are_laid_on_each_other(jitter):
    """Each has two strides that the other lacks."""
    found = compare(
        steps(varies=0.1, jitter=jitter, high=8.0),
        steps(varies=0.1, jitter=jitter, low=2.27, noise=3, clock=5.0),
    )
    assert found.shift == pytest.approx(-5.0, abs=0.01)
    assert found.limbs["left"].pairs == 5
    assert "left: 2 of 7 stances are not compared" in " ".join(found.warnings)
    assert "left 3 of 8 in A and 2 of 7 in B." in report(found)


@pytest.mark.parametrize(("one", "other"), [(0.70, 1.09), (1.09, 0.70), (1.0, 1.3)])
def test_strides_of_another_pace_are_all_paired(one, other):
    errors = compare(steps(4, period=one), steps(4, period=other)).limbs["left"]
    assert (errors.pairs, errors.stances) == (4, (4, 4))
    assert errors.contact_error == pytest.approx((other - one) / 2, abs=0.01)
    more = compare(steps(6, period=one), steps(4, period=other))
    assert more.limbs["left"].pairs == 4
    assert "left 2 of 6 in A." in report(more)


def test_the_next_stance_does_not_stand_in_for_a_missing_one():
    """A ends before the stance that B, which starts later, has first."""
    a, b = steps(4, varies=0.0, high=2.9), steps(6, varies=0.0, low=2.4)
    with pytest.raises(ValueError, match="found none with align='none'"):
        compare(a, b, "none")
    a, b = steps(4, varies=0.0, high=3.9), steps(6, varies=0.0, low=2.4)
    errors = compare(a, b, "none").limbs["left"]
    assert (errors.pairs, errors.touchdown_error) == (1, 0.0)
    assert errors.forces["vertical"].rmse < 1e-9
    said = " ".join(compare(a, b, "none").warnings)
    assert "left: 2 of 3 stances are not compared" in said
    assert "--align stances" in said
