"""The page of the horse's gaits beside living horses: what it counts, and that it is written whole."""

import json

import pytest
from foreign import CUT, FOREIGN

from agents import kinematic_page as page
from hoof_env.errors import DataFileError
from hoof_env.tasks.horse_gaits import kinematic_speeds

SEARCH = {
    "lag": 0.25, "duty_fore": 0.62, "duty_hind": 0.62, "dip_fore": 0.3, "stride_over_hip": 1.3, "fell": 0.0,
    "slip_fore": 0.01, "slip_hind": 0.02, "peak": 0.7, "transport": 0.9, "loading": 15.0, "return": 300.0,
    "wall_s": 60.0,
}  # fmt: skip


def test_searched_rows_are_counted_inside_of_their_bars():
    found = page.search_rows(
        {
            "walk at 0.2 by force, seed 0, best": SEARCH,
            "walk at 0.2 by work, seed 0, best": SEARCH | {"lag": 0.1, "dip_fore": 0.01},
        }
    )
    assert [row[1] for row in found] == ["5 of 5", "3 of 5"]


def test_a_search_that_ends_in_a_fall_has_no_figures():
    nothing = {name: float("nan") for name in SEARCH} | {"fell": 1.0, "return": 3.0, "wall_s": 60.0}
    (row,) = page.search_rows({"walk at 0.2 by force, seed 0, best": page.without_nan(nothing)})
    assert row[1:] == ["0 of 5", "1.000", "-", "-", "-", "-", "3", "60"]


def test_what_is_searched_with_is_neither_met_nor_missed():
    rows = [
        ["walk: lag", "0.25", "0.2 to 0.3", "0.1: missed by -50%", "0.25: searched, inside"],
        ["walk: duty_fore", "0.62", "0.58 to 1", "0.6: met", "0.5: searched, outside"],
        ["walk: peak_fore", "6.2", "4.96 to 7.44", "7: met", "8.2: missed by +10%"],
        ["walk: peak_hind", "4.8", "3.84 to 5.76", "7: missed by +22%", "5: met"],
    ]
    walk = {"name": "kinematic-walk", "fell": 0.002, "slip_fore": 0.05, "slip_hind": 0.03}
    told = page.summary(rows, [walk], 1000)
    assert "1 are inside of their bars and 1 outside" in told
    assert "kinematic-walk 2;" in told
    assert "1 are met: walk: peak_hind; 1 are missed" in told
    assert "walk: peak_fore (missed by +10%)" in told


def test_the_page_is_written_with_its_figures_and_pictures(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(page, "PREDICTED", (0.25,))
    searches = tmp_path / "found.json"
    searches.write_text(json.dumps({"searches": {"walk at 0.2 by force, seed 0, best": SEARCH}}))
    page.main([str(searches), "--episodes", "4", "--out", str(tmp_path)])
    text = (tmp_path / "horse_gaits.md").read_text()
    assert "| walk at 0.2 by force, seed 0, best | 5 of 5 |" in text
    assert f"| {page.BY_WORK} | 1.60 |" in text
    for name in kinematic_speeds():
        assert f"| {name} | {kinematic_speeds()[name]:.2f} |" in text
    assert "nan" not in text
    folder = tmp_path / "horse_gaits"
    assert set(json.loads((folder / "figures.json").read_text())["families"]) == {
        "predicted", "trot-like", "kinematic", page.BY_WORK, "from any phase"
    }  # fmt: skip
    assert (folder / "forces.png").stat().st_size > 5000
    # Written again from what it keeps, it lists the same searches
    page.main([str(folder / "searches.json"), "--episodes", "4", "--out", str(tmp_path)])
    again = (tmp_path / "horse_gaits.md").read_text()
    assert again[again.index("## By criterion") :] == text[text.index("## By criterion") :]
    page.main([str(folder / "searches.json"), "--no-play", "--out", str(tmp_path)])
    capsys.readouterr()


@pytest.mark.parametrize("content", [CUT, *FOREIGN, '{"families": {"predicted": [{"speed": 1.0}]}}'])
def test_other_files_of_figures_are_refused_and_left_alone(content, tmp_path):
    searches, folder = tmp_path / "found.json", tmp_path / "horse_gaits"
    searches.write_text(json.dumps({"searches": {"walk at 0.2 by force, seed 0, best": SEARCH}}))
    folder.mkdir()
    (folder / "figures.json").write_text(content)
    with pytest.raises(DataFileError, match=r"figures\.json: expected figures .*agents\.kinematic_page kept"):
        page.main([str(searches), "--no-play", "--out", str(tmp_path)])
    assert [*folder.iterdir()] == [folder / "figures.json"]
