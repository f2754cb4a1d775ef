"""The page of what stock PPO's first gradients show: what it plays, and that it is written whole."""

import json

import numpy as np
import pytest
from foreign import CUT, FOREIGN

from agents import horse_learning as page
from hoof_env.errors import DataFileError
from hoof_env.evaluation.episodes import make_rows

ZERO = {"return": [10.0, 20.0, 30.0], "failed": [1.0, 0.0, 1.0]}


def figures(**changed):
    """Return figures of three episodes."""
    ones = {name: [0.0, 0.0, 0.0] for name in page.KEPT} | ZERO | changed
    return {name: np.array(values) for name, values in ones.items()}


def test_differences_from_the_zero_action_are_paired():
    told = page.summary(figures(**{"return": [13.0, 23.0, 33.0], "failed": [0.0, 0.0, 1.0]}), figures())
    assert told["return over zero"] == [3.0, 0.0]
    assert told["failed over zero"] == pytest.approx([-1 / 3, 1 / 3])
    assert page.interval([3.0, 1.0]) == "+3.0 [1.0, 5.0]"


def test_cranks_follow_the_error_of_the_speed():
    envs = make_rows(page.BEFORE, 3)
    seen, _ = envs.reset(seed=0)
    raw = envs.raw_observation()
    error = np.asarray(raw["forward speed"]) - raw["commanded speed"]
    actions, _ = page.CrankFeedback(envs, 0.4).predict(seen)
    assert actions[:, ::4] == pytest.approx(np.repeat(0.4 * error[:, None], 4, 1), abs=1e-5)
    assert not np.delete(actions, np.s_[::4], axis=1).any()


def test_the_weights_of_the_study_are_those_of_the_id_as_it_was():
    assert make_rows(page.BEFORE, 1).weights == page.WEIGHTS
    now = make_rows(page.ENV_ID, 1).weights
    assert now == pytest.approx({name: weight / 50 for name, weight in page.WEIGHTS.items()})


def test_learners_and_blind_twins_are_trained_and_played(capsys):
    case = page.Case(1, 1, env_kwargs={"episode_seconds": 0.4})
    found = page.learn(case, 100, 3)
    assert found["steps"] == 100
    for kind in ("seeds", "blind"):
        (one,) = found[kind]
        assert np.isfinite(one["return"])
        assert one["return"] - found["zero"]["return"] == pytest.approx(one["return over zero"][0])
    capsys.readouterr()


def test_the_page_is_written_with_what_was_measured(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(page, "GAINS", (0.0, 0.4))
    monkeypatch.setattr(page, "SAMPLES", 1)
    few = ["--no-train", "--starts", "3", "--probed", "2", "--rows", "3", "--recorded", "40"]
    page.main([*few, "--out", str(tmp_path)])
    text = (tmp_path / "horse_learning.md").read_text()
    for name in page.REWARDS:
        assert f"| {name} |" in text
    assert "nan" not in text
    kept = json.loads((tmp_path / "horse_learning" / "figures.json").read_text())
    zero = kept["gains"][0]
    assert zero["return over zero"] == [0.0, 0.0]
    assert set(kept["commits"]) == {"gains", "signal", "steps"}
    assert "to measure: gains, signal, steps" in capsys.readouterr().out
    before = (tmp_path / "horse_learning" / "figures.json").read_text()
    monkeypatch.setattr(page, "measure_gains", lambda starts: pytest.fail("measured again"))
    monkeypatch.setattr(page.results, "commit_of_code", lambda: "0123456789ab")
    page.main([*few, "--out", str(tmp_path)])
    assert (tmp_path / "horse_learning" / "figures.json").read_text() == before
    assert "to measure: nothing" in capsys.readouterr().out
    # The commit of the page is that of the figures, and not of its writing
    assert "0123456789ab" not in (tmp_path / "horse_learning.md").read_text()
    less = {name: value for name, value in kept.items() if name != "steps"}
    (tmp_path / "horse_learning" / "figures.json").write_text(json.dumps(less))
    page.main([*few, "--out", str(tmp_path)])
    text = (tmp_path / "horse_learning.md").read_text()
    assert f"`{kept['commits']['gains']}` (gains, signal), `0123456789ab` (steps)" in text
    capsys.readouterr()


def test_a_file_of_one_commit_says_so_of_all_figures():
    of_file = page.figures_of_file({"gains": [], "steps": [], "versions": {"commit": "abc"}})
    assert page.commits_of(of_file) == "commit `abc`"


@pytest.mark.parametrize("content", [CUT, *FOREIGN, '{"gains": [{"gain": 0.0}]}', '{"rows": []}'])
def test_other_files_are_refused_and_left_alone(content, tmp_path, monkeypatch):
    for name in ("learn", "measure_gains"):
        monkeypatch.setattr(page, name, lambda *_: pytest.fail("was measured"))
    path = tmp_path / "horse_learning" / "figures.json"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(DataFileError, match=r"figures\.json: expected figures that agents\.horse_learning"):
        page.main(["--out", str(tmp_path)])
    assert path.read_text() == content
    assert not (tmp_path / "horse_learning.md").exists()


def test_zero_gain_is_the_zero_action():
    one, other = (
        page.played(make, 3, page.BEFORE)
        for make in (page.zero_action, lambda envs: page.CrankFeedback(envs, 0.0))
    )
    for name, values in one.items():
        assert np.array_equal(values, other[name])
