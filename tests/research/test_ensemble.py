"""Collecting an ensemble: small collections at a loose bar, kills, processes, and bad input."""

import json
import os
import shutil
from dataclasses import replace
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest

from hoof_env.errors import HoofEnvError
from hoof_env.leg.geometry import read_preset
from research.identify import ensemble as command
from research.identify.command import load_start
from research.identify.confirm import confirm
from research.identify.ensemble import Aim, Attempt, Task, attempt, collect, distance, judge
from research.identify.leg import encode, to_preset
from research.identify.objective import Objective
from research.identify.resume import open_state
from research.identify.search import LegProblem
from tests.legs import FIRST_FIT
from tests.research.commands import kill_when, refusal

CHOICE, X = load_start(FIRST_FIT, 1.5)
AIM = Aim(LegProblem(CHOICE), 20.0, False, steps=1)


@pytest.fixture(scope="module")
def entered():
    """The preset's leg, brought within the bar."""
    return attempt(Task(0, 0, 0, X), AIM)


@pytest.fixture(scope="module")
def start(entered):
    return tuple(AIM.problem.outward(np.array(entered.y), 801).tolist())


def silent(line):
    pass


def gather(out, start, aim=AIM, resume=False, workers=1, size=3):
    state = open_state(out, {"a": 1}, resume=resume, product="ensemble.json")
    with patch.object(command, "ROUND", 4):
        return collect(start, aim, state, silent, size=size, attempts=3, seed=3, workers=workers)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("whole")


@pytest.fixture(scope="module")
def whole(start, folder):
    return gather(folder, start)


# --- attempts --------------------------------------------------------------------------------------------


def assert_within(made):
    objective, x = Objective(CHOICE, samples=2001), AIM.problem.outward(np.array(made.y), 801)
    assert np.abs(objective.rows(x)).max() <= AIM.bar
    assert objective.plausibility(x) == {}


def test_a_start_comes_within_the_bar_and_a_push_stays_there_and_goes_its_way(entered):
    assert_within(entered)
    direction = np.zeros(24)
    direction[5] = 1.0
    task = Task(1, 0, 0, entered.y, tuple(direction))
    pushed = attempt(task, replace(AIM, steps=4))
    assert_within(pushed)
    assert pushed.y[5] > entered.y[5] + 0.001
    assert attempt(task, replace(AIM, steps=4)) == pushed
    stays = attempt(task, replace(AIM, bar=0.5 * entered.merit))  # no leg near it is within that bar
    assert stays.y == entered.y


def test_the_verdict_is_that_of_the_full_system():
    made = Attempt("0", tuple(AIM.problem.inward(np.array(X), 801).tolist()), 0.0)
    _, judged = judge(made, AIM)
    verdict = confirm(read_preset(FIRST_FIT))
    assert judged.errors == pytest.approx(verdict.errors, rel=1e-4)
    assert set(judged.reasons) >= {f"{n} ({s})" for n, s in verdict.untrue if s == "exact"}
    short = Objective(CHOICE, samples=2001).plausibility(np.array(X))
    assert judged.short == pytest.approx(short, rel=1e-3, abs=1e-4)
    assert set(short) <= set(judged.reasons)
    _, strict = judge(made, replace(AIM, bar=0.01, both=True))
    assert [reason.split(" error")[0] for reason in strict.reasons[:2]] == ["exact", "paper"]


# --- collections -----------------------------------------------------------------------------------------


def test_members_meet_the_bar_are_different_and_begin_with_the_start(whole):
    assert len(whole.members) == 3
    assert not any(whole.verdicts[one.id].reasons for one in whole.members)
    assert whole.members[0].id == "0000-00"
    gaps = [distance(a, b) for i, a in enumerate(whole.members) for b in whole.members[:i]]
    assert min(gaps) > 1e-4
    assert len(whole.attempts) == 5  # a round is made whole
    refused = [name for name, verdict in whole.verdicts.items() if verdict.reasons]
    fit = [one for one in whole.attempts if one.id not in refused]
    assert distance(*whole.members[:2]) == max(distance(whole.members[0], one) for one in fit)


def test_the_number_of_processes_changes_nothing(start, whole, tmp_path):
    other = gather(tmp_path, start, workers=2, size=1)
    assert other.members[0] == whole.members[0]
    assert other.attempts == whole.attempts


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups")
def test_a_collection_that_was_killed_goes_on_to_the_same_members(start, whole, tmp_path):
    code = ("from pathlib import Path", f"gather(Path({str(tmp_path)!r}), {start!r})")
    kept = kill_when(code, "test_ensemble", tmp_path, "state/job-0001-*.json", 2)
    assert len(kept) < len(whole.attempts) - 1
    assert gather(tmp_path, start, resume=True) == whole
    assert all(file.read_bytes() == content for file, content in kept.items())


def test_a_leg_that_the_full_system_refuses_is_replaced(start, whole, folder, tmp_path, monkeypatch):
    refused = whole.members[1].id
    shutil.copytree(folder / "state", tmp_path / "state")

    def strict(made, aim):
        name, verdict = judge(made, aim)
        return name, replace(verdict, reasons=("it",)) if name == refused else verdict

    monkeypatch.setattr(command, "judge", strict)
    other = gather(tmp_path, start, resume=True)
    assert len(other.members) == 3
    assert other.verdicts[refused].reasons == ("it",)
    assert refused not in [one.id for one in other.members]


# --- bad input -------------------------------------------------------------------------------------------


def test_no_leg_within_the_bar_says_how_far_the_nearest_is(start, tmp_path, monkeypatch):
    monkeypatch.setattr(command, "TRIES", 1)
    with pytest.raises(HoofEnvError, match=r"the start does not come within 0\.01 bars .* it has \d+\.\d+"):
        gather(tmp_path, start, replace(AIM, bar=0.01))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--preset", "STUCK"], "dyad 1 (C-B-P"),
        (["--preset", "nobody"], "preset: expected one of"),
        (["--preset", "STIFF"], "expected a ground with the paper's stiffness, 20000 N/m^n, got 30000"),
        (["--bar", "0"], "bar: expected"),
        (["--size", "0"], "size: expected"),
        (["--workers", "0"], "workers: expected"),
        (["--resume"], "holds no search to resume"),
    ],
)
def test_bad_input_is_one_line_before_anything_is_written(tmp_path, capsys, arguments, message):
    stuck = read_preset(FIRST_FIT)
    stuck["geometry"]["lengths"]["CB"] = 0.05
    files = {"STUCK": stuck, "STIFF": {**read_preset(FIRST_FIT), "ground": {"stiffness": 3e4}}}
    for name, content in files.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    given = [str(tmp_path / f"{a}.json") if a in files else a for a in arguments]
    if "--preset" not in given:
        given += ["--preset", FIRST_FIT]
    assert message in refusal(command.main, ["--out", tmp_path / "out", *given], capsys)
    assert not (tmp_path / "out").exists()


# --- the command -----------------------------------------------------------------------------------------


def test_the_command_writes_an_ensemble_says_how_it_was_found_and_overwrites_nothing(
    start, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(command, "Aim", partial(Aim, steps=1))
    out, preset = tmp_path / "out", tmp_path / "leg.json"
    preset.write_text(json.dumps(to_preset(np.array(start), CHOICE, "a test")))
    given = ["--out", str(out), "--preset", str(preset), "--size", "2", "--bar", "20", "--attempts", "1"]
    given += ["--workers", "1"]
    assert command.main(given) == 0
    assert "2 of 2 members; largest errors {" in capsys.readouterr().out
    path = out / "ensemble.json"
    data, before = json.loads(path.read_text()), path.read_bytes()
    assert data["bar"]["exact"] <= 20.0
    assert all(text in data["provenance"] for text in ("Identified, not published", "leg (", "seed 0"))
    assert data["members"][0]["found"]["attempt"] == "0000-00"
    for member in data["members"]:
        preset = {"provenance": "a test", "ground": data["ground"], "gaits": member["gaits"]}
        encode({**preset, "geometry": member["geometry"]})
    for more, message in (
        ([], "already holds a search or what one found"),
        (["--seed", "1", "--resume"], "another search: seed is 0 there and 1 here"),
    ):
        assert message in refusal(command.main, [*given, *more], capsys)
    assert command.main([*given, "--resume"]) == 0
    assert path.read_bytes() == before
