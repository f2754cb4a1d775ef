"""A canter with a free footfall: what is asked of it, and what counts."""

import json

import numpy as np
import pytest
from foreign import CUT, FOREIGN

from agents import canter
from hoof_env.errors import DataFileError, ParameterError

FOUND = {
    "seed": 0, "starts": canter.CHECKED, "gait": [0.0] * 16, "shifts": [-0.08, -0.09], "fell": 0.0,
    "speed_ratio": 1.0, "slip_fore": 0.05, "slip_hind": 0.05, "stances_per_turn_fore": 1.0,
    "stances_per_turn_hind": 1.0, "stride_over_hip": 1.9, "duty_fore": 0.4, "duty_hind": 0.35,
    "transport": 1.0, "touch_right_hind": 0.27, "touch_left_fore": 0.28, "touch_right_fore": 0.55,
    "peak_left_fore": 1.2, "peak_right_fore": 1.0,
}  # fmt: skip


def test_shifts_move_left_and_right_legs_apart():
    (action,) = canter.actions_of(np.array([[0.125, -0.05]]))
    assert action.reshape(4, 4)[:, 0] == pytest.approx([0.5, -0.5, -0.2, 0.2])
    assert not action.reshape(4, 4)[:, 1:].any()


def test_a_landing_costs_by_its_distance_around_the_stride():
    touches = {f"touch_{leg}": np.array([0.27, 0.33, 0.99]) for leg in ("right_hind", "left_fore")}
    figures = touches | {"touch_right_fore": np.array([0.55, 0.55, 0.55]), "fell": np.zeros(3)}
    cost = canter.missed_footfall(figures)
    assert cost[0] == 0.0
    assert cost[1] == pytest.approx(2 / (1 + 1 / 20))
    # From 0.99 it is 0.26 to the next stride's 0.25, not 0.69
    far = 0.26 / canter.SCALE
    assert cost[2] == pytest.approx(2 * far / (1 + far / 20))


def test_peaks_judge_only_what_is_a_canter(tmp_path, capsys):
    outside = FOUND | {"seed": 1, "touch_right_fore": 0.74}
    falling = FOUND | {"seed": 2, "fell": 0.3}
    path = tmp_path / "found.json"
    path.write_text(json.dumps({"found": [FOUND, outside, falling]}))
    canter.main(["--seeds", "3", "--found", str(path), "--out", str(tmp_path)])
    text = (tmp_path / "canter.md").read_text()
    assert "| peak lead fore [N/kg] | 8.34 to 11.14 | 9.8: met | 9.8: does not count |" in text
    assert "Of 3 searches 1 ended in a canter that counts" in text
    assert "0.74: searched, outside" in text
    capsys.readouterr()


def args_of(tmp_path, path):
    return ["--seeds", "1", "--found", str(path), "--out", str(tmp_path / "out")]


@pytest.mark.parametrize(
    "content",
    [
        CUT,
        *FOREIGN,
        json.dumps({"found": [FOUND | {"gait": [0.0] * 15}]}),
        json.dumps({"found": [FOUND | {"fell": None}]}),
        json.dumps({"found": [{name: value for name, value in FOUND.items() if name != "touch_left_fore"}]}),
    ],
)
def test_other_files_are_refused_and_left_alone(content, tmp_path, monkeypatch):
    monkeypatch.setattr(canter, "search", lambda *_: pytest.fail("was searched"))
    path = tmp_path / "found.json"
    path.write_text(content)
    with pytest.raises(DataFileError, match=r"found\.json: expected canters that agents\.canter found: "):
        canter.main(args_of(tmp_path, path))
    assert path.read_text() == content
    assert not (tmp_path / "out" / "canter.md").exists()


def test_a_committed_page_is_not_replaced_by_a_page_of_another_file(tmp_path, monkeypatch):
    monkeypatch.setattr(canter, "search", lambda *_: pytest.fail("was searched"))
    with pytest.raises(ParameterError, match=r"--found: expected a file that exists, got .*missing\.json"):
        canter.main(args_of(tmp_path, tmp_path / "missing.json"))
    path = tmp_path / "found.json"
    path.write_text(json.dumps({"found": [FOUND]}))
    before = (canter.EVIDENCE / "canter.md").read_text()
    with pytest.raises(ParameterError, match=r"--out: expected another folder for the page of .*found\.json"):
        canter.main(["--seeds", "1", "--found", str(path)])
    assert (canter.EVIDENCE / "canter.md").read_text() == before


def test_a_search_says_how_much_there_is_to_do_and_what_is_found_is_kept_at_once(
    tmp_path, monkeypatch, capsys
):
    def search(seed, length):
        if seed == 2:
            raise KeyboardInterrupt
        return FOUND | {"seed": seed}

    monkeypatch.setattr(canter, "search", search)
    path = tmp_path / "canter" / "found.json"
    path.parent.mkdir()
    path.write_text(json.dumps({"found": [FOUND]}))
    with pytest.raises(KeyboardInterrupt):
        canter.main(["--seeds", "4", "--generations", "7", "--out", str(tmp_path)])
    assert [one["seed"] for one in json.loads(path.read_text())["found"]] == [0, 1]
    said = capsys.readouterr().out
    assert "has 1 of 4 searches" in said
    assert "3 searches to do, of 7 generations each" in said
