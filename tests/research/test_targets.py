import json
from importlib import resources

import pytest

from hoof_env.errors import DataFileError
from hoof_env.paper.rows import load_published
from research.identify.targets import load_targets


@pytest.fixture
def rows():
    text = resources.files("hoof_env.paper").joinpath("published.json").read_text(encoding="utf-8")
    return {row["id"]: row for row in json.loads(text)["rows"]}


def written(folder, rows):
    path = folder / "targets.json"
    path.write_text(json.dumps({"rows": list(rows.values()) if isinstance(rows, dict) else rows}))
    return path


def test_the_papers_own_numbers_are_the_default():
    assert load_targets() == load_published().rows


def test_a_file_of_the_same_rows_is_the_same_target(tmp_path, rows):
    assert load_targets(written(tmp_path, rows)) == load_targets()
    rows["walk.contact_start"]["published"] = 0.27
    assert load_targets(str(written(tmp_path, rows)))[0].value == 0.27


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is damaged; expected JSON with a list 'rows'"),
        ("[]", "list 'rows' of at least one row"),
        ("{}", "list 'rows' of at least one row"),
        ('{"rows": []}', "list 'rows' of at least one row"),
        ('{"rows": {}}', "list 'rows' of at least one row"),
        ('{"rows": [7]}', r"row 1 \(without id\): expected an object"),
        ('{"rows": [{"id": "walk.duty"}]}', r"row 1 \(walk.duty\): expected also gait"),
    ],
)
def test_a_file_without_rows_is_named(tmp_path, content, message):
    path = tmp_path / "empty.json"
    path.write_text(content)
    with pytest.raises(DataFileError, match=message) as error:
        load_targets(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataFileError, match=r"cannot read .*nowhere\.json"):
        load_targets(tmp_path / "nowhere.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"id": "walk.speed"}, r"id: expected one of walk\.contact_start, .*got 'walk\.speed'"),
        ({"published": float("nan")}, "published: expected a finite number"),
        ({"published": "0.2"}, "published: expected a finite number"),
        ({"bar": "about 2 %"}, "bar: expected 'reported' or a number"),
        ({"bar": "0 s"}, "bar: expected more than 0"),
        ({"unit": "deg", "bar": "1 deg"}, "unit: expected 's', got 'deg'"),
        ({"id": ["walk.duty"]}, r"id: expected a string, got \['walk\.duty'\]"),
        ({"unit": ["s"]}, r"unit: expected a string, got \['s'\]"),
        ({"quantity": 3}, "quantity: expected a string, got 3"),
        ({"published": 1.1}, "published: expected an instant from 0 to 1 s, got 1.1"),
        ({"gait": "run"}, "gait: expected 'walk', got 'run'"),
        ({"condition": "elastic"}, "condition: expected None, got 'elastic'"),
    ],
)
def test_a_wrong_row_is_named_with_what_was_expected(tmp_path, rows, change, message):
    rows["walk.contact_start"].update(change)
    with pytest.raises(DataFileError, match=rf"targets\.json: row 1 \(\S*walk\.[a-z_]+\S*\): {message}"):
        load_targets(written(tmp_path, rows))


def test_a_repeated_row_is_named(tmp_path, rows):
    twice = [*rows.values(), rows["run.duty"]]
    with pytest.raises(DataFileError, match=r"row 25 \(run\.duty\): id: expected every id once"):
        load_targets(written(tmp_path, twice))


@pytest.mark.parametrize(
    ("row", "value", "message"),
    [
        ("walk.contact_end", 0.267, r"walk\.contact_end: expected later than walk\.contact_start, 0\.267 s"),
        ("run.contact_start", 0.5, r"run\.contact_end: expected later"),
        ("walk.mean_elastic", 176.0, r"walk\.mean_elastic: expected at most walk\.peak_elastic, 175\.34 N"),
        ("run.mean_inelastic", 9000.0, r"run\.mean_inelastic: expected at most"),
        ("walk.duty", 0.323, r"walk\.duty: got 0\.323 .*leave 0\.292 to 0\.312"),
        ("run.duty", 0.249, r"run\.duty: got 0\.249 .*leave 0\.26 to 0\.28"),
        ("walk.reduction", 64.0, r"walk\.reduction: got 64 .*walk\.peak_elastic and walk\.peak_inelastic"),
        ("run.reduction", 30.0, r"run\.reduction: got 30"),
        ("run.angle_variation", 68.0, r"run\.angle_variation: got 68 .*leave 62\.88 to 66\.88"),
        ("walk.peak_elastic", -1.0, r"published: expected a force above 0 N, got -1"),
    ],
)
def test_rows_that_contradict_each_other_are_named(tmp_path, rows, row, value, message):
    rows[row]["published"] = value
    with pytest.raises(DataFileError, match=message):
        load_targets(written(tmp_path, rows))


@pytest.mark.parametrize(("row", "value"), [("walk.duty", 0.321), ("run.angle_variation", 67.8)])
def test_what_the_bars_allow_is_no_contradiction(tmp_path, rows, row, value):
    rows[row]["published"] = value
    load_targets(written(tmp_path, rows))


def test_rows_without_a_bar_contradict_nothing_but_one_must_have_a_bar(tmp_path, rows):
    rows["walk.duty"] |= {"published": 0.9, "bar": "reported"}
    load_targets(written(tmp_path, rows))
    for row in rows.values():
        row["bar"] = "reported"
    with pytest.raises(DataFileError, match="every bar is 'reported'"):
        load_targets(written(tmp_path, rows))
