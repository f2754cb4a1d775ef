"""Collecting an ensemble: small collections at a loose bar, kills, processes, and bad input."""

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest

from hoof_env.errors import DataFileError, HoofEnvError, OutputError, ParameterError
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import read_preset
from research.identify import ensemble_attempt, ensemble_command, ensemble_search
from research.identify.candidate import Choice, to_preset
from research.identify.collect import main
from research.identify.command import load_start
from research.identify.confirm import confirm
from research.identify.ensemble import load_ensemble
from research.identify.ensemble_attempt import PHASE, Aim, Attempt, Task, attempt, judge
from research.identify.ensemble_command import ensemble, load_starts
from research.identify.ensemble_search import Start, collect, distance
from research.identify.objective import Objective
from research.identify.records import Result, Standing
from research.identify.state import open_state
from research.identify.targets import load_targets

PRESET = "first_fit"
AIM = Aim(load_targets(), "walks", 20.0, False, steps=1)


@pytest.fixture(scope="module")
def preset():
    return Start(PRESET, *load_start(PRESET, load_ground(PRESET).exponent))


@pytest.fixture(scope="module")
def entered(preset):
    """The preset's leg, brought within the bar."""
    return attempt(Task(0, 0, 0, "0000-00", PRESET, preset.choice.to_dict(), preset.x), AIM)


@pytest.fixture(scope="module")
def start(preset, entered):
    return Start(PRESET, preset.choice, tuple(entered.x(AIM).tolist()))


def silent(line):
    pass


def gather(out, starts, aim=AIM, resume=False, workers=1, size=3):
    state = open_state(out, {"a": 1}, "digest", resume=resume, kind="collection")
    with patch.object(ensemble_search, "ROUND", 4):
        return collect(starts, aim, state, silent, size=size, attempts=3, seed=3, workers=workers)


def plain(attempts):
    """Without wall times and verdicts."""
    return [replace(one, seconds=0.0, errors={}, short={}, untrue=()) for one in attempts]


def same(one, other):
    return replace(one, seconds=0.0) == replace(other, seconds=0.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("whole")


@pytest.fixture(scope="module")
def whole(start, folder):
    return gather(folder, [start])


# --- attempts --------------------------------------------------------------------------------------------


def test_a_start_comes_within_the_bar_and_a_push_stays_there_and_goes_its_way(entered):
    rows, short = measure(entered)
    assert np.abs(rows).max() <= AIM.bar
    assert short.max() == 0
    direction = np.zeros(24)
    direction[5] = 1.0
    task = Task(1, 0, 0, entered.id, PRESET, entered.choice, entered.y, tuple(direction))
    pushed = attempt(task, replace(AIM, steps=4))
    rows, short = measure(pushed)
    assert np.abs(rows).max() <= AIM.bar
    assert short.max() == 0
    assert pushed.y[5] > entered.y[5] + 0.001
    assert same(attempt(task, replace(AIM, steps=4)), pushed)
    stays = attempt(task, replace(AIM, bar=0.5 * entered.merit))  # no leg near it is within that bar
    assert stays.y == entered.y


def measure(made):
    objective = Objective(Choice.from_dict(made.choice), samples=2001)
    x = made.x(AIM)
    return objective.rows(x), objective.plausibility(x)


def test_the_verdict_is_that_of_the_full_system(preset):
    choice = preset.choice.to_dict()
    y = AIM.problem().inward(choice, np.array(preset.x), PHASE)
    judged = judge(Attempt("0", "0", PRESET, choice, tuple(y.tolist()), 0.0, 0, 0.0, {}, {}), AIM)
    verdict = confirm(read_preset(PRESET), AIM.targets, "walks")
    worst = max(
        abs(row["error"]) / verdict.reproduction.published.row(row["id"]).bar.limit
        for row in verdict.reproduction.rows
        if row["solver"] == "exact" and not row["spared"]
    )
    assert judged.errors["exact"] == pytest.approx(worst, rel=1e-4)
    assert judged.untrue == tuple(f"{n} ({s})" for n, s in verdict.untrue if s == "exact")
    objective = Objective(preset.choice, samples=2001)
    short = dict(zip(objective.demands, objective.plausibility(np.array(preset.x)).tolist(), strict=True))
    assert judged.short == pytest.approx({k: v for k, v in short.items() if v > 0}, rel=1e-3, abs=1e-4)


def test_a_member_meets_the_bar_in_the_solvers_that_count_without_exception():
    made = Attempt("0", "0", "s", {}, (), 0.5, 0, 0.0, {"exact": 0.9, "paper": 1.2}, {})
    one = replace(AIM, bar=1.0)
    assert made.holds(one)
    assert not made.holds(replace(one, both=True))
    assert not made.holds(replace(one, bar=0.8))
    assert not replace(made, short={"sole_long": 0.1}).holds(one)
    assert not replace(made, untrue=("walk.order (exact)",)).holds(one)
    assert not replace(made, errors={}).holds(one)


# --- collections -----------------------------------------------------------------------------------------


def test_members_meet_the_bar_are_different_and_begin_with_the_start(whole):
    assert len(whole.members) == 3
    assert all(one.holds(AIM) for one in whole.members)
    assert whole.members[0].id == "0000-00"
    gaps = [distance(a, b) for i, a in enumerate(whole.members) for b in whole.members[:i]]
    assert min(gaps) > 1e-4
    assert len(whole.attempts) == 5  # a round is made whole
    spread = max(distance(whole.members[0], one) for one in whole.attempts if one not in whole.refused)
    assert distance(*whole.members[:2]) == spread


def test_the_number_of_processes_changes_nothing(start, whole, tmp_path):
    other = gather(tmp_path, [start], workers=2, size=1)
    assert same(other.members[0], whole.members[0])
    assert plain(other.attempts) == plain(whole.attempts)


SCRIPT = """
import sys
from pathlib import Path
from test_ensemble_search import *
if __name__ == "__main__":
    choice, x = json.loads(Path(sys.argv[2]).read_text())
    gather(Path(sys.argv[1]), [Start(PRESET, Choice.from_dict(choice), tuple(x))])
"""


def test_a_collection_that_was_killed_goes_on_to_the_same_members(start, whole, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    leg = tmp_path / "leg.json"
    leg.write_text(json.dumps([start.choice.to_dict(), start.x]))
    path = os.pathsep.join([os.path.dirname(__file__), *sys.path])
    process = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "out"), str(leg)], env={**os.environ, "PYTHONPATH": path}
    )
    state, deadline = tmp_path / "out" / "state", time.monotonic() + 300
    while len(list(state.glob("attempt-0001-*.json"))) < 2:
        assert process.poll() is None, "ended before it was killed"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.kill()
    process.wait()
    kept = {file: file.read_bytes() for file in state.glob("attempt-*.json")}
    assert len(kept) < len(whole.attempts)
    resumed = gather(tmp_path / "out", [start], resume=True)
    assert all(map(same, resumed.members, whole.members))
    assert plain(resumed.attempts) == plain(whole.attempts)
    judged = {one.id for one in (*resumed.members, *resumed.refused)}
    assert all(f.read_bytes() == c for f, c in kept.items() if f.stem.removeprefix("attempt-") not in judged)


def test_a_leg_that_the_full_system_refuses_is_replaced(start, whole, folder, tmp_path, monkeypatch):
    refused = whole.members[1].id
    shutil.copytree(folder / "state", tmp_path / "state")
    file = tmp_path / "state" / f"attempt-{refused}.json"
    data = json.loads(file.read_text())
    data["attempt"] |= {"errors": {}, "short": {}}  # as before its verdict
    file.write_text(json.dumps(data))

    def strict(made, aim):
        judged = judge(made, aim)
        return replace(judged, untrue=("it",)) if made.id == refused else judged

    monkeypatch.setattr(ensemble_search, "judge", strict)
    other = gather(tmp_path, [start], resume=True)
    assert len(other.members) == 3
    assert refused in [one.id for one in other.refused]
    assert refused not in [one.id for one in other.members]


# --- bad input -------------------------------------------------------------------------------------------


def test_no_leg_within_the_bar_says_how_far_the_nearest_is(start, tmp_path, monkeypatch):
    monkeypatch.setattr(ensemble_attempt, "TRIES", 1)
    with pytest.raises(
        HoofEnvError, match=r"no start comes within 0\.01 bars without a shortage, the nearest has \d+\.\d+"
    ):
        gather(tmp_path, [start], replace(AIM, bar=0.01))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "damaged; delete it to repeat the attempt"),
        ('{"problem": "digest"}', "damaged; delete it to repeat the attempt"),
        ('{"problem": "other", "attempt": {}}', "belongs to another collection"),
    ],
)
def test_a_damaged_attempt_or_one_of_another_collection_is_named(start, tmp_path, content, message):
    open_state(tmp_path, {"a": 1}, "digest", resume=False)
    file = tmp_path / "state" / "attempt-0000-00.json"
    file.write_text(content)
    with pytest.raises(DataFileError, match=rf"attempt-0000-00\.json.*{message}"):
        gather(tmp_path, [start], resume=True)
    assert file.read_text() == content


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--preset", "STUCK"], "dyad 1 (C-B-P"),
        (["--preset", "nobody"], "preset: expected one of"),
        (["--starts", "cold"], "start cold: expected a preset or the folder of a search"),
        (["--starts", PRESET], "starts: expected different legs, got one twice"),
        (["--starts", "EMPTY"], "expected the folder of a search with a leg within 1.5 bars"),
        (["--preset", "STIFF"], "expected a ground with the paper's stiffness, 20000 N/m^n, got 30000"),
        (["--bar", "0"], "bar: expected"),
        (["--size", "0"], "size: expected"),
        (["--workers", "0"], "workers: expected"),
        (["--resume"], "holds no collection to resume"),
    ],
)
def test_bad_input_is_one_line_before_anything_is_written(tmp_path, capsys, arguments, message):
    stuck = read_preset(PRESET)
    stuck["geometry"]["lengths"]["CB"] = 0.05
    (tmp_path / "stuck.json").write_text(json.dumps(stuck))
    (tmp_path / "empty").mkdir()
    stiff = {**read_preset(PRESET), "ground": {"stiffness": 3e4}}
    (tmp_path / "stiff.json").write_text(json.dumps(stiff))
    names = {
        "STIFF": str(tmp_path / "stiff.json"),
        "STUCK": str(tmp_path / "stuck.json"),
        "EMPTY": str(tmp_path / "empty"),
    }
    given = [names.get(a, a) for a in arguments]
    if "--preset" not in given:
        given += ["--preset", PRESET]
    assert main(["--out", str(tmp_path / "out"), *given]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert message in error
    assert not (tmp_path / "out").exists()


# --- the command -----------------------------------------------------------------------------------------


def test_the_command_writes_an_ensemble_says_how_it_was_found_and_overwrites_nothing(
    start, tmp_path, monkeypatch
):
    monkeypatch.setattr(ensemble_command, "Aim", partial(Aim, steps=1))
    out, lines = tmp_path / "out", []
    preset = tmp_path / "leg.json"
    preset.write_text(json.dumps(to_preset(start.x, start.choice, "a test", "leg")))
    options = {"preset": str(preset), "size": 2, "bar": 20.0, "attempts": 1, "workers": 1}
    (path,) = ensemble(out, lines.append, **options)
    found = load_ensemble(path)
    assert len(found.members) == 2
    assert found.bar["exact"] <= 20.0
    assert all(text in found.provenance for text in ("Identified, not published", "leg (", "seed 0"))
    assert any(line.startswith("2 of 2 members; largest error ") for line in lines)
    assert next(line.split()[0] for line in lines if "[m]" in line and "%" in line) == "OP"
    members = json.loads(path.read_text())["members"]
    assert members[0]["found"] == {"attempt": "0000-00", "start": "leg"}
    before = path.read_bytes()
    with pytest.raises(OutputError, match="already holds a search or what one found"):
        ensemble(out, silent, **options)
    with pytest.raises(DataFileError, match="another collection: seed is 0 there and 1 here"):
        ensemble(out, silent, **options, seed=1, resume=True)
    assert path.read_bytes() == before
    ensemble(out, silent, **options, resume=True)
    assert path.read_bytes() == before


def test_starts_may_come_from_a_search_the_best_of_each_of_its_own_starts(start, tmp_path):
    state = open_state(tmp_path / "search", {}, "digest", resume=False)
    standing = Standing(22, 22, "walk.duty", 0.5, 0.0)
    jobs = [("a", 5, 9), ("a", 4, 8), ("b", 6, 60), ("c", 60, 60), ("d", 5, None)]
    for number, (root, exact, full) in enumerate(jobs):
        x = [*start.x[:-1], number / 100]
        state.finish(
            Result(f"000-0{number}", "p", "given", root, start.choice.to_dict(), 0.0, 0, 0, 0.0, "", x, 0.0,
                   float(exact), full and float(full), standing, None, False)
        )  # fmt: skip
    aim, exponent = replace(AIM, bar=10.0), start.choice.exponent
    for folder in (tmp_path / "search", tmp_path / "search" / "state"):
        legs = load_starts([PRESET, str(folder)], aim, exponent)
        assert [leg.name for leg in legs] == [PRESET, "search, start a", "search, start b"]
        assert legs[1].x[-1] == 0.01
    assert len(load_starts([PRESET, str(tmp_path / "search")], replace(aim, both=True), exponent)) == 2
    with pytest.raises(DataFileError, match="within 15 bars on ground with exponent 2"):
        load_starts([str(tmp_path / "search")], aim, 2.0)
    (tmp_path / "search" / "state" / "job-000-00.json").write_text("{}")
    with pytest.raises(DataFileError, match=r"job-000-00\.json is damaged"):
        load_starts([str(tmp_path / "search")], aim, exponent)
    with pytest.raises(ParameterError, match="got one twice"):
        load_starts([PRESET, PRESET], aim, exponent)
