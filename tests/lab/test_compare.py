"""`hoof-env compare`: errors that were put into a record are found, whatever its rate, signs and units."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hoof_env.constants import GRAVITY
from hoof_env.lab.compare import THRESHOLD, compare
from hoof_env.lab.picture import draw, report
from hoof_env.lab.read import read_record
from tests.lab.made import CONTACT, HIGHEST, PERIOD, strides


def rise(scale=1.0, contact=CONTACT):
    """How long a half sine takes to the threshold of a stance [s]."""
    return contact / np.pi * np.arcsin(THRESHOLD / (HIGHEST * scale))


def test_a_record_is_like_itself():
    found = compare(strides(), strides())
    assert (found.shift, found.unit, found.rate) == (0.0, "N", 1000.0)
    for errors in found.limbs.values():
        assert errors.pairs >= 4
        vertical = errors.forces["vertical"]
        assert (vertical.rmse, vertical.peak_error, vertical.impulse_error) == (0.0, 0.0, 0.0)
        assert vertical.r == pytest.approx(1.0)
        assert errors.contact == pytest.approx(CONTACT, abs=0.01)
        assert (errors.contact_error, errors.touchdown_error, errors.peak_time_error) == (0.0, 0.0, 0.0)


@settings(max_examples=20, deadline=None)
@given(
    rate=st.sampled_from([200.0, 240.0, 500.0, 960.0, 2000.0]),
    scale=st.floats(0.6, 1.6),
    late=st.floats(-0.25, 0.25),
    longer=st.floats(-0.06, 0.06),
)
@example(rate=2000.0, scale=0.609375, late=0.0, longer=0.03125)
def test_errors_that_are_put_in_are_found(rate, scale, late, longer):
    """Closed form: a half sine of length T and height P has the impulse 2 P T / pi."""
    other = strides(rate, scale, 0.3 + late, CONTACT + longer)
    found = compare(strides(), other)
    step, later = 1 / rate + 1e-3, rise(scale, CONTACT + longer) - rise()
    for errors in found.limbs.values():
        vertical = errors.forces["vertical"]
        assert vertical.peak == pytest.approx(HIGHEST, rel=1e-3)
        assert vertical.peak_error == pytest.approx((scale - 1) * HIGHEST, abs=0.005 * HIGHEST)
        impulse = 2 / np.pi * HIGHEST * (scale * (CONTACT + longer) - CONTACT)
        assert vertical.impulse_error == pytest.approx(impulse, abs=0.01 * HIGHEST * CONTACT)
        braking = 0.2 * HIGHEST / np.pi * (scale * (CONTACT + longer) - CONTACT)
        assert errors.forces["braking"].impulse_error == pytest.approx(braking, abs=0.01 * HIGHEST * CONTACT)
        assert errors.contact_error == pytest.approx(longer - 2 * later, abs=3 * step)
        assert errors.peak_time_error == pytest.approx(longer / 2 - later, abs=3 * step)
        off = errors.touchdown_error - found.shift - late - later
        assert abs(off - PERIOD * round(off / PERIOD)) < 3 * step  # strides repeat


@pytest.mark.parametrize(
    ("unit", "by"),
    [("kN", 1e-3), ("N/kg", 1 / 60), ("BW", 1 / (60 * GRAVITY)), ("%BW", 100 / (60 * GRAVITY))],
)
def test_units_are_changed_by_the_weight(unit, by):
    plain = strides(weight=60 * GRAVITY)
    other = strides(scale=by, unit=unit, weight=60 * GRAVITY)
    for units, size in (("N", HIGHEST), ("BW", HIGHEST / (60 * GRAVITY))):
        vertical = compare(plain, other, units=units).limbs["left"].forces["vertical"]
        assert vertical.peak == pytest.approx(size, rel=1e-3)
        assert vertical.peak_error == pytest.approx(0, abs=1e-9 * HIGHEST)


def test_records_without_a_weight_are_compared_where_they_can_be():
    assert (
        compare(strides(unit="BW", scale=1 / HIGHEST), strides(unit="N/kg", scale=9.8 / HIGHEST)).unit == "BW"
    )


def test_strides_of_another_pace_are_paired_in_order():
    slow = strides()
    quick = strides()
    quick.time = quick.time * 0.9
    errors = compare(slow, quick).limbs["left"]
    assert errors.pairs >= 3
    assert errors.contact_error == pytest.approx(-0.1 * CONTACT, abs=0.005)
    assert errors.touchdown_spread > 0.05
    assert errors.forces["vertical"].r > 0.9


def test_the_times_of_the_files_are_kept_on_demand():
    late = strides(begin=0.35)
    assert compare(strides(), late, "none").limbs["left"].touchdown_error == pytest.approx(0.05, abs=0.002)
    assert compare(strides(), late, "shift").limbs["left"].touchdown_error == pytest.approx(0.0, abs=0.002)
    assert compare(strides(), late, "none").limbs["left"].forces["vertical"].rmse > 50


def test_opposite_fore_aft_forces_are_reported():
    other = strides()
    other.limbs = {limb: force * [-1, 1] for limb, force in other.limbs.items()}
    assert "warning: left: fore-aft forces point opposite ways; --reverse-b x" in report(
        compare(strides(), other)
    )
    assert "opposite" not in report(compare(strides(), strides()))


def idle(record, limb="right"):
    """The record with a limb that is not loaded."""
    record.limbs[limb] = 0 * record.limbs[limb]
    return record


def test_a_limb_that_is_not_compared_is_named_with_the_reason():
    found = compare(strides(), idle(strides()))
    assert list(found.limbs) == ["left"]
    said = report(found)
    assert "| right | not compared | 0 |" in said
    assert re.search(r"warning: right .*B .*20 N", said)
    more, fewer = strides(), strides()
    del fewer.limbs["right"]
    assert "warning: right is not compared: only A has it" in report(compare(more, fewer))
    assert "warning: right is not compared: only B has it" in report(compare(fewer, more))
    assert "warning" not in report(compare(strides(), strides()))


def noisy(record, size, seed=0):
    random = np.random.default_rng(seed)
    record.limbs = {
        limb: force + random.normal(0, size, force.shape) for limb, force in record.limbs.items()
    }  # fmt: skip
    return record


@pytest.mark.parametrize("size", [8.0, 15.0])
def test_noise_makes_no_stances(size):
    """The threshold is a little above the noise, so that swing has bursts above it all the time."""
    found = compare(strides(), noisy(strides(), size))
    assert found.warnings == []
    for errors in found.limbs.values():
        assert errors.pairs >= 4
        assert abs(errors.contact_error) < 0.02
        assert errors.touchdown_spread < 0.01
        assert errors.forces["vertical"].r > 0.99


def test_stances_that_one_record_lacks_are_reported():
    step = strides()
    extra = strides()
    time = extra.time
    extra.limbs["left"][(time > 2.85) & (time < 3.0)] = [0.0, 300.0]  # in the swing of left
    said = report(compare(step, extra))
    assert re.search(r"warning: left: A .*5 .*B 6 .*5", said)
    assert "warning: right" not in said


def uneven():
    """Six strides of other sizes, so that the shift is known and not up to whole strides alone."""
    record = strides(seconds=6.0)
    size = np.take([0.7, 1.0, 0.4, 1.3, 0.6, 1.2, 0.5], np.floor(record.time + 0.7).astype(int))
    record.limbs = {limb: force * size[:, None] for limb, force in record.limbs.items()}
    return record


@pytest.mark.parametrize("missed", [1, 2, 3])
def test_a_missed_step_leaves_the_other_pairs_where_they_are(missed):
    other, begin = uneven(), 0.3 + missed
    other.limbs["left"][(other.time >= begin) & (other.time <= begin + CONTACT)] = 0.0
    for pair in ((uneven(), other), (other, uneven())):
        found = compare(*pair)
        assert (found.shift, found.limbs["left"].pairs) == (0.0, 5)
        assert found.limbs["left"].touchdown_spread < 0.001
        assert found.limbs["left"].forces["vertical"].rmse < 1e-6


def test_touchdowns_that_scatter_are_reported():
    quick = strides()
    quick.time = quick.time * 0.8
    assert "left: touchdowns scatter by" in report(compare(strides(), quick))


def test_a_record_without_fore_aft_force_is_not_scored_for_it(tmp_path):
    pytest.importorskip("matplotlib", reason='pip install "hoof-env[lab]"')
    time = strides().time
    rows = [f"{t:.3f},{fz:.4f}" for t, fz in zip(time, strides().limbs["left"][:, 1], strict=True)]
    (tmp_path / "b.csv").write_text("\n".join(["time [s],left_force_y [N]", *rows]))
    for mapping in (None, {"left_force_y": "left_force_y"}):
        b = read_record(tmp_path / "b.csv", mapping)
        assert np.isnan(b.limbs["left"][:, 0]).all()
        found = compare(strides(), b)
        assert list(found.limbs["left"].forces) == ["vertical"]
        assert found.limbs["left"].forces["vertical"].rmse < 0.01
        said = report(found)
        assert "no fore-aft force of left" in said
        assert "braking" not in said
        assert draw(found, tmp_path / "x.svg").read_text().count("fore-aft") == 0


def test_each_record_s_threshold_is_by_its_own_weight_and_is_printed():
    heavy, light = strides(weight=6000.0), strides(weight=500.0)
    found = compare(heavy, light, units="BW", threshold=60.0)
    assert found.levels == (60 / 6000, 60 / 500)
    assert "Stances are above 0.01 BW in A and 0.12 BW in B." in report(found)
    assert "Stances are above 20 N." in report(compare(heavy, light))
    assert (
        compare(heavy, light, threshold=300.0).limbs["left"].contact
        < compare(heavy, light).limbs["left"].contact
    )


def test_without_a_weight_the_threshold_is_a_part_of_it():
    known, unknown = (
        strides(unit="BW", scale=1 / HIGHEST, weight=900.0),
        strides(unit="BW", scale=1 / HIGHEST),
    )
    assert compare(known, unknown).levels == (0.01, 0.01)


def as_file(path, record, left=(1, 1), right=(1, 1)):
    """The record as a text file whose components of each limb are multiplied by signs."""
    table = {"time [s]": record.time}
    for limb, signs in (("left", left), ("right", right)):
        for axis, (name, sign) in enumerate(zip("xy", signs, strict=True)):
            table[f"{limb}_force_{name} [N]"] = sign * record.limbs[limb][:, axis]
    np.savetxt(path, np.column_stack([*table.values()]), "%.6g", ",", header=",".join(table), comments="")
    return path


def test_a_plate_upside_down_turns_its_own_limb_alone(tmp_path):
    larger = strides()
    larger.limbs["right"] = larger.limbs["right"] * 3  # its sum decides of all limbs together
    found = read_record(as_file(tmp_path / "x.csv", larger, right=(-1, -1)))
    assert found.turned == ("right",)
    for limb, force in larger.limbs.items():
        np.testing.assert_allclose(found.limbs[limb], force, atol=1e-2)
    said = report(compare(strides(), found))
    assert re.search("forces of right .*turned", said)
    drifting = idle(strides())
    drifting.limbs["right"] = drifting.limbs["right"] - [0.0, 10.0]
    assert read_record(as_file(tmp_path / "y.csv", drifting)).turned == ()


@pytest.mark.parametrize(("of_a", "of_b", "remedy"), [
    ((1, 1), (-1, 1), "--reverse-b x turns B"),
    ((1, 1), (1, -1), "--reverse-b y turns B"),
    ((1, -1), (1, 1), "--reverse-a y turns A"),
    ((-1, -1), (1, -1), "--reverse-b y turns B"),
])  # fmt: skip
def test_the_remedy_for_opposite_forces_remedies(of_a, of_b, remedy, tmp_path):
    a = as_file(tmp_path / "a.csv", strides(), of_a, of_a)
    b = as_file(tmp_path / "b.csv", strides(), of_b, of_b)
    said = report(compare(read_record(a), read_record(b)))
    assert f"left: fore-aft forces point opposite ways; {remedy}" in said
    which, how = remedy[10], remedy[12]
    cured = compare(
        read_record(a, reverse=how if which == "a" else "auto"),
        read_record(b, reverse=how if which == "b" else "auto"),
    )
    assert cured.limbs["left"].forces["fore-aft"].r > 0.99


def test_the_remedy_for_one_of_several_limbs_is_a_minus(tmp_path):
    b = read_record(as_file(tmp_path / "b.csv", strides(), right=(1, -1)))
    assert "a minus before the column of right_force_x in --map-b turns B" in report(compare(strides(), b))
