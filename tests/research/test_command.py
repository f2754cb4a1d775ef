"""`python -m research.identify` as a user meets it."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from hoof_env.leg.geometry import load_geometry, read_preset
from research.identify.__main__ import main
from tests.legs import FIRST_FIT
from tests.research.commands import refusal, wait_for_end, wait_until

COMMAND = [sys.executable, "-m", "research.identify"]


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    """The folder of a small search and what it said."""
    out = tmp_path_factory.mktemp("new") / "folder"
    done = subprocess.run(
        [*COMMAND, "--out", str(out), "--budget", "200"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return out, done


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_a_search_writes_a_preset_and_how_good_it_is(searched):
    out, done = searched
    assert {path.name for path in out.iterdir()} == {"identified.json", "identify.json", "state"}
    assert done.stderr == ""
    *jobs, verdict, preset, report = done.stdout.splitlines()
    assert all(line.startswith("job 0") for line in jobs)
    assert len(jobs) == len(list((out / "state").glob("job-*.json")))
    assert "the bar is not met, missing: " in verdict
    assert [preset, report] == [f"{out / name}.json written" for name in ("identified", "identify")]
    assert "seed 0" in load_geometry(out / "identified.json").provenance
    data = json.loads((out / "identify.json").read_text(encoding="utf-8"))
    assert data["reached"] is False
    assert (len(data["rows"]), len(data["jobs"])) == (72, len(jobs))
    missing = [row["id"] for row in data["rows"] if row["within_bar"] is False]
    assert {name for name, _ in data["outside"]} <= set(missing)


def test_a_finished_search_is_neither_begun_anew_nor_mixed_with_another(searched, capsys, tmp_path):
    out, _ = searched
    before = contents(out)
    preset = tmp_path / "other.json"
    moved = read_preset(FIRST_FIT)
    moved["geometry"]["hip_height"] += 0.001
    preset.write_text(json.dumps(moved))
    for arguments, message in [
        ([], "already holds a search"),
        (["--resume", "--seed", "1"], "seed is 0 there and 1 here"),
        (["--resume", "--budget", "300"], "budget is 200 there and 300 here"),
        (["--resume", "--start", str(preset)], "start is 'first_fit ("),
    ]:
        options = arguments if "--budget" in arguments else [*arguments, "--budget", "200"]
        assert message in refusal(main, ["--out", out, *options], capsys)
    assert contents(out) == before


def test_a_finished_search_resumes_to_the_same_files(searched, capsys):
    out, _ = searched
    before = contents(out)
    assert main(["--out", str(out), "--budget", "200", "--resume"]) == 0
    assert contents(out) == before


def test_a_leg_found_alone_is_not_written_over(tmp_path, capsys):
    (tmp_path / "identified.json").write_text("mine")
    assert "already holds a search" in refusal(main, ["--out", tmp_path, "--budget", "200"], capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["identified.json"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--start", "STUCK"], "stuck.json: dyad 1 (C-B-P"),
        (["--start", "nobody"], "start nobody: preset: expected one of identified"),
        (["--start", "GROUND"], "ground.json: preset"),
        (["--start", "GAITLESS"], "gait: expected one of walk, got 'run'"),
        (["--start", "SLOW"], "run.crank_speed: expected the paper's 6.283185 rad/s, got 3.0"),
        (["--workers", "0"], "workers: expected a finite number in [1, 1024], got 0"),
        (["--budget", "0"], "budget: expected"),
        (["--seed", "-1"], "seed: expected"),
        (["--resume"], "holds no search to resume"),
    ],
)
def test_bad_input_is_one_line_before_anything_is_written(tmp_path, capsys, arguments, message):
    stuck, gaitless, slow = read_preset(FIRST_FIT), read_preset(FIRST_FIT), read_preset(FIRST_FIT)
    stuck["geometry"]["lengths"]["CB"] = 0.05
    del gaitless["gaits"]["run"]
    slow["gaits"]["run"]["crank_speed"] = 3.0
    ground = {**read_preset(FIRST_FIT), "ground": {"exponent": -1}}
    files = {"GROUND": ground, "STUCK": stuck, "GAITLESS": gaitless, "SLOW": slow}
    for name, content in files.items():
        (tmp_path / f"{name.lower()}.json").write_text(json.dumps(content))
    given = [str(tmp_path / f"{a.lower()}.json") if a in files else a for a in arguments]
    out = tmp_path / "out"
    assert message in refusal(main, ["--out", out, *given], capsys)
    assert not out.exists()


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    assert "cannot write to" in refusal(main, ["--out", tmp_path / "file"], capsys)
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("name", ["cma", "scipy", "tqdm"])
def test_a_missing_extra_is_named_with_the_way_out(tmp_path, capsys, monkeypatch, name):
    monkeypatch.setitem(sys.modules, name, None)
    error = refusal(main, ["--out", tmp_path / "out"], capsys)
    assert f'identify needs {name}: pip install "hoof-env[identify]"' in error
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups")
def test_an_interrupt_keeps_the_search_and_says_how_to_go_on(tmp_path):
    out = tmp_path / "out"
    process = subprocess.Popen(
        [*COMMAND, "--out", str(out)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    wait_until((out / "state" / "problem.json").exists, process)
    time.sleep(2.0)  # its workers start
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does, to all of them
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 130, errors
    assert errors == "interrupted; the same command goes on with --resume\n"
    wait_for_end(process)
