"""The map of gaits over speed: what counts, what is better, where it changes, and that searches go on."""

import json
import shutil

import numpy as np
import pytest
from foreign import CUT, FOREIGN

from agents import gait_change as page
from agents import gait_map
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.tasks.horse_gaits import NAMES, horse_gaits


def row(froude, kind, lag, work=1.0, seed=0, **changed):
    """A kept gait that counts."""
    figures = {
        "reached": gait_map.speed_of(froude), "fell": 0.0, "speed_ratio": 1.0, "slip_fore": 0.05,
        "slip_hind": 0.05, "stances_per_turn_fore": 1.0, "stances_per_turn_hind": 1.0,
        "stride_over_hip": gait_map.stride_at(froude), "duty_fore": 0.5, "duty_hind": 0.5, "lag": lag,
        "transport": work, "peak": 1.0, "loading": 30.0,
    } | changed  # fmt: skip
    place = {"froude": froude, "seed": seed, "kind": kind, "objective": "work"}
    return place | figures | {"wall_s": 1.0} | dict.fromkeys(NAMES, 0.0)


def test_the_given_stride_is_the_published_one():
    assert gait_map.stride_at(1.0) == pytest.approx(1.66)
    assert gait_map.stride_at(0.5) == pytest.approx(1.43, abs=0.005)


@pytest.mark.parametrize(
    ("changed", "counts"),
    [
        ({}, True),
        ({"lag": 0.15}, False),
        ({"fell": 0.2}, False),
        ({"slip_hind": 0.12}, False),
        ({"speed_ratio": 0.8}, False),
        ({"stances_per_turn_fore": 1.2}, False),
        ({"stride_over_hip": 2.2}, False),
        ({"peak": None, "slip_fore": None}, False),
    ],
)
def test_a_gait_counts_by_the_rules_of_the_judges(changed, counts):
    assert gait_map.stands_of(row(0.5, "walk", 0.25) | changed) is counts


def test_a_lag_of_nearly_half_a_stride_is_a_trots():
    assert gait_map.stands_of(row(0.5, "trot", 0.48))
    assert not gait_map.stands_of(row(0.5, "walk", 0.48))


def test_the_better_gait_changes_where_the_other_spares_more():
    rows = []
    for froude, walk, trot in ((0.2, 0.5, 0.8), (0.35, 0.7, 0.9), (0.45, 1.0, 1.01), (0.6, 1.5, 1.0)):
        rows += [row(froude, "walk", 0.25, walk), row(froude, "trot", 0.0, trot)]
    assert [page.better_of(rows, froude, "work") for froude in (0.2, 0.45, 0.6, 0.8)] == [
        "walk", "equal", "trot", "none"
    ]  # fmt: skip
    assert page.changes_of(rows, "work") == [(0.35, 0.6, "walk", "trot")]
    assert page.changes_of(rows, "peak") == []
    (jump,) = page.jumps_of(rows, "work")
    assert jump == pytest.approx((0.45, 0.6, 0.25, 0.0))
    assert page.as_horses(rows, "work")
    assert not page.as_horses(rows, "peak")
    # A walk that does not count is none
    rows[0]["slip_fore"] = 0.2
    assert page.better_of(rows, 0.2, "work") == "trot"


def test_seeds_that_disagree_are_a_null_result():
    rows = []
    for seed in (0, 1):
        for froude, walk, trot in ((0.2, 0.5, 0.8), (0.35, 0.7, 0.9), (0.6, 1.5, 1.0)):
            rows += [row(froude, "walk", 0.25, walk, seed), row(froude, "trot", 0.0, trot, seed)]
    assert "by mixture, work over all seeds, and by mixture, work in each seed" in page.told(rows)
    assert "null" not in page.told(rows)
    assert page.agreed(rows, "work") == {"walk": [0.2, 0.35], "trot": [0.6]}
    rows[0]["transport"] = 1.2
    assert "by mixture, work over all seeds, and by nothing in each seed alone. Seeds differ" in page.told(
        rows
    )
    assert page.agreed(rows, "work") == {"walk": [0.35], "trot": [0.6]}


def test_only_seeds_with_both_gaits_are_compared():
    rows = [row(0.2, "walk", 0.25), row(0.2, "trot", 0.0), row(0.2, "walk", 0.25, seed=1)]
    rows.append(row(0.35, "trot", 0.0, seed=0))
    assert page.compared(rows) == rows[:2]


def test_a_gait_that_was_found_for_something_else_is_compared_as_well():
    rows = [row(0.2, "walk", 0.25, 0.9), row(0.2, "walk", 0.25, 0.8) | {"objective": "peak"}]
    assert page.best_of(rows, 0.2, "walk", "work")["transport"] == 0.8
    assert page.best_of(rows, 0.2, "trot", "work") is None


def test_speeds_are_searched_from_their_neighbours():
    for kind, begin in gait_map.KINDS.items():
        order = gait_map.order_of(kind)
        assert order[0] == (begin, None)
        assert sorted(froude for froude, _ in order) == sorted(gait_map.FROUDES)
        done = {begin}
        for froude, neighbour in order[1:]:
            assert neighbour in done
            done.add(froude)


def test_what_counts_less_costs_more():
    gait = horse_gaits()["kinematic-walk"].to_array()
    rig = gait_map.Rig(8, num_threads=1)
    figures = rig.play(np.array([gait, gait]), 1.59, 0, 4, 4.0, 1.5)
    walk, trot = (gait_map.costs_of(figures, kind, "peak", 0.18)[0] for kind in ("walk", "trot"))
    assert walk < trot
    free = gait_map.costs_of(figures, gait_map.FREE, "peak", 0.18)[0]
    assert free <= walk


def test_a_search_goes_on_where_it_stopped_and_its_page_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(gait_map, "FROUDES", (0.2, 0.8))
    monkeypatch.setattr(page, "FROUDES", (0.2, 0.8))
    monkeypatch.setattr(gait_map, "SECONDS", 2.4)
    tiny = gait_map.Effort(16, 1, 1, 1), gait_map.Effort(8, 1, 1, 1)
    path = tmp_path / "found.json"
    found = gait_map.search_all(path, 1, *tiny)
    assert len(found.rows) == 2 * 3 * len(gait_map.OBJECTIVES)
    text = path.read_text()
    capsys.readouterr()
    again = gait_map.search_all(path, 1, *tiny)
    assert capsys.readouterr().out == f"{path}: has 6 of 6 searches\n"
    assert path.read_text() == text
    assert again.rows == found.rows
    # What is left out is found again, to the bit but for the time that it took
    kept = [one for one in found.rows if (one["froude"], one["kind"]) != (0.8, "walk")]
    short = gait_map.Map(tmp_path / "short.json")
    short.about = found.about
    short.keep(kept)
    whole = gait_map.search_all(tmp_path / "short.json", 1, *tiny)
    assert "short.json: has 5 of 6 searches\n1 searches to do, about " in capsys.readouterr().out
    anew = [one | {"wall_s": 0} for one in whole.rows if (one["froude"], one["kind"]) == (0.8, "walk")]
    assert anew == [
        one | {"wall_s": 0} for one in found.rows if (one["froude"], one["kind"]) == (0.8, "walk")
    ]
    page.write(found, page.Herd(tmp_path / "agents.json"), tmp_path)
    written = (tmp_path / "gait_change.md").read_text()
    assert "| 0.8 | trot (" in written
    assert "nan" not in written
    assert (tmp_path / "gait_change" / "map.png").stat().st_size > 5000


def file_with(*rows, **changes):
    """Content of a file with some gaits."""
    content = {"versions": {"commit": "1"}, "columns": [*rows[0]], "rows": [[*one.values()] for one in rows]}
    return json.dumps(content | changes)


GAITS = row(0.2, "walk", 0.25), row(0.2, "trot", 0.0)


@pytest.mark.parametrize(
    "content",
    [
        CUT,
        *FOREIGN,
        file_with(*GAITS, columns=["froude"]),
        file_with(*GAITS, versions=3),
        file_with(GAITS[0] | {"kind": "gallop"}),
        file_with(GAITS[0] | {"peak": "high"}),
        file_with({name: value for name, value in GAITS[0].items() if name != "rate"}),
        file_with(GAITS[0]),
    ],
)
@pytest.mark.parametrize("search", ["--search", "--no-search"])
def test_other_files_are_refused_and_left_alone(content, search, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(page, "search_all", lambda path, seeds: gait_map.Map(path))
    path = tmp_path / "found.json"
    path.write_text(content)
    with pytest.raises(DataFileError, match=r"found\.json: expected "):
        page.main([search, "--found", str(path), "--out", str(tmp_path / "out")])
    assert path.read_text() == content
    assert not (tmp_path / "out" / "gait_change.md").exists()


def test_a_committed_page_is_not_replaced_by_a_page_of_another_file(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "search_all", lambda *_: pytest.fail("was searched"))
    before = (page.EVIDENCE / "gait_change.md").read_text()
    for search in ("--search", "--no-search"):
        with pytest.raises(ParameterError, match="--found: expected a file that exists, got 'missing'"):
            page.main([search, "--found", "missing"])
    path = tmp_path / "found.json"
    path.write_text(file_with(*GAITS))
    with pytest.raises(ParameterError, match=r"--out: expected another folder"):
        page.main(["--no-search", "--found", str(path)])
    with pytest.raises(DataFileError, match="expected walks and trots of one seed and speed, got 0 gaits"):
        page.main(["--no-search", "--out", str(tmp_path / "empty")])
    assert (page.EVIDENCE / "gait_change.md").read_text() == before


def test_the_committed_page_is_written_from_the_committed_file(tmp_path, capsys):
    folder = tmp_path / "gait_change"
    folder.mkdir()
    for name in ("searches.json", "agents.json"):
        shutil.copy(page.EVIDENCE / "gait_change" / name, folder)
    page.main(["--no-search", "--out", str(tmp_path)])
    lines = [(place / "gait_change.md").read_text().splitlines()[4:] for place in (page.EVIDENCE, tmp_path)]
    assert lines[0] == lines[1]
    capsys.readouterr()
