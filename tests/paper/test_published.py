import json
from importlib import resources

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.paper.rows import load_published, parse_bar


@pytest.fixture(scope="module")
def published():
    return load_published()


@pytest.mark.parametrize(
    ("text", "unit", "limit", "measure"),
    [
        ("0.005 s", "s", 0.005, "s"),
        ("1 deg", "deg", 1.0, "deg"),
        ("2 %", "N", 2.0, "%"),
        ("1 point", "%", 1.0, "point"),
        ("0.01", "-", 0.01, ""),
        ("reported", "deg", None, "deg"),
    ],
)
def test_a_bar_is_read_with_its_measure(text, unit, limit, measure):
    bar = parse_bar(text, unit)
    assert (bar.limit, bar.measure) == (limit, measure)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("2%", "N"),  # no blank
        ("2 %", "s"),  # measure of another unit
        ("1 deg", "s"),
        ("0.01", "N"),
        ("-1 deg", "deg"),
        ("1e-3 s", "s"),
        ("about 1 deg", "deg"),
        ("1 deg or so", "deg"),
        ("", "-"),
        (None, "-"),
        (2, "-"),
        ("1 m", "m"),
    ],
)
def test_anything_else_is_refused(text, unit):
    with pytest.raises(ParameterError, match=r"bar: expected|unit: expected"):
        parse_bar(text, unit)


@given(st.floats(0.1, 1e4), st.floats(-50, 50))
def test_a_relative_error_is_a_percentage_of_the_published_value(published, percent):
    bar = parse_bar("2 %", "N")
    assert bar.error(published * (1 + percent / 100), published) == pytest.approx(percent, abs=1e-9)


def test_a_bar_accepts_its_own_limit_and_nothing_beyond():
    bar = parse_bar("1 deg", "deg")
    assert bar.holds(-1.0) is True
    assert bar.holds(1.0) is True
    assert bar.holds(1.0001) is False
    assert bar.holds(None) is False
    assert parse_bar("reported", "deg").holds(100.0) is None


def test_the_printed_numbers_are_consistent_as_far_as_the_paper_is(published):
    value = {row.id: row.value for row in published.rows}
    for gait in ("walk", "run"):
        elastic, inelastic = value[f"{gait}.peak_elastic"], value[f"{gait}.peak_inelastic"]
        assert 100 * (inelastic - elastic) / inelastic == pytest.approx(value[f"{gait}.reduction"], abs=0.005)
        stance = value[f"{gait}.contact_end"] - value[f"{gait}.contact_start"]
        assert stance == pytest.approx(value[f"{gait}.duty"], abs=1e-12)
    # 'angular variation', 'approximately 2.5 times'
    run_change = value["run.angle_liftoff"] - value["run.angle_contact"]
    assert run_change == pytest.approx(value["run.angle_variation"], abs=0.1)
    ratio = value["run.angle_variation"] / value["walk.angle_variation"]
    assert ratio == pytest.approx(value["ratio.angle_variation"], abs=0.05)


def test_only_the_angle_at_walking_lift_off_is_read_otherwise_than_printed(published):
    assert [row.id for row in published.rows if row.value != row.printed] == ["walk.angle_liftoff"]
    row = published.row("walk.angle_liftoff")
    assert (row.printed, row.value) == (-20.9, 20.9)


def test_the_baumgarte_parameter_is_the_printed_square_root(published):
    assert published.parameters["baumgarte_beta"] ** 2 == pytest.approx(
        2 * published.parameters["baumgarte_alpha"]
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data["rows"][0].update(bar="some"),
        lambda data: data.pop("rows"),
        lambda data: data["rows"][3].pop("unit"),
        lambda data: data["rows"].append(data["rows"][0]),
        lambda data: data["rows"][6].update(condition="viscous"),
    ],
)
def test_a_file_that_is_not_whole_is_refused_by_name(tmp_path, change):
    whole = resources.files("hoof_env.paper").joinpath("published.json").read_text(encoding="utf-8")
    change(content := json.loads(whole))
    file = tmp_path / "mine.json"
    file.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(DataFileError, match=r"mine\.json"):
        load_published(file)


def test_a_file_that_is_missing_or_not_json_is_refused_by_name(tmp_path):
    (tmp_path / "text.json").write_text("{", encoding="utf-8")
    for name in ("none.json", "text.json"):
        with pytest.raises(DataFileError, match=name):
            load_published(tmp_path / name)
