"""The benchmarks run without peers, write their files, and their arithmetic is right."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import compare, compare_first, speed, threads
from benchmarks.history import keep, read
from benchmarks.machine import compiled_for, vector_bits
from benchmarks.rounds import interleave, spread
from benchmarks.speed import Case, speed_table
from scripts.environments import Environment, NoEnvironment


def test_quick_mode_runs_without_peers_and_writes_its_files(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)  # as if they were not installed
    monkeypatch.setitem(sys.modules, "exudyn", None)
    speed.main(["--quick", "--rounds", "2", "--out", str(tmp_path)])
    bits = vector_bits()
    own = tmp_path / f"{bits}-bits"
    assert {path.name for path in own.iterdir()} == {"speed.json", "speed.md"}
    result = json.loads((own / "speed.json").read_text())
    assert result["machine"]["processor"]
    assert result["machine"]["compiled for"] == f"{compiled_for()}, vectors of {bits} bits"
    assert {case["group"] for case in result["cases"]} == {"leg", "horse"}
    assert all(case["rate"]["min"] > 0 and not case["ratios"] for case in result["cases"])
    assert result["notes"] == ["MuJoCo is left out", "Exudyn is left out"]
    assert {case["bits"] for case in result["cases"]} == {bits}
    page = (own / "speed.md").read_text()
    assert "leg, one" in page
    assert f"vectors of {bits} bits" in page
    late = speed.page(result | {"start": dict.fromkeys(speed.START_BARS, 0.4)})
    assert "| import hoof_env | 0.40 | under 0.3: not met |" in late
    assert "| 0.40 | under 2: met |" in late
    assert f"[{bits}-bits, speed]({bits}-bits/speed.md)" in (tmp_path / "speed.md").read_text()
    assert read(tmp_path) == []  # numbers of a smoke test mean nothing
    assert "leg, one" in capsys.readouterr().out


def test_ratios_are_taken_within_a_round():
    """The peer is ten times slower in every other round: each round has a ratio of its own."""
    slow = iter(np.tile([1.0, 10.0], 50))
    found = [
        Case("leg, MuJoCo ALL", "leg", lambda: 2.0 * next(slow), 100),
        Case("leg, one", "leg", lambda: 1.0, 100, "", 2.0, 30.0),
    ]
    rows = {row["name"]: row for row in speed.compare(found, 10)}
    assert rows["leg, one"]["ratios"]["ALL"] == spread(np.array([20.0, 2.0] * 5))
    table = speed_table(list(rows.values()))
    assert "2: met" in table
    assert "30: not met" in table


def test_a_run_leaves_the_figures_of_others(tmp_path):
    ratio = {"median": 66.666, "q1": 65.0, "q3": 70.0}
    for bits, name, date in ((512, "znver5", "2026-11-22"), (256, "haswell", "2026-11-23")):
        machine = {
            "date": date,
            "commit": "abc",
            "compiled for": name,
            "processor": "EPYC",
            "system": "Linux",
        }
        rows = [("leg, one", "MuJoCo ALL", ratio, 35), ("no bar", "", ratio, None), ("no ratio", "", None, 1)]
        keep(tmp_path, machine, bits, rows)
    assert [row["bits"] for row in read(tmp_path)] == ["512", "256"]
    table = [line for line in (tmp_path / "speed.md").read_text().splitlines() if line.startswith("| leg")]
    assert [line.split(" | ")[2:7] for line in table] == [
        ["512", "66.7 (65 to 70)", "35: met", "2026-11-22", "abc"],
        ["256", "66.7 (65 to 70)", "35: met", "2026-11-23", "abc"],
    ]


def test_every_case_runs_once_a_round_in_changing_order():
    seen = []
    runs = {name: (lambda name=name: seen.append(name) or 1.0) for name in "abc"}
    interleave(runs, 20)
    rounds = [tuple(seen[k : k + 3]) for k in range(0, len(seen), 3)]
    assert len(rounds) == 21
    assert all(sorted(r) == ["a", "b", "c"] for r in rounds)
    assert len(set(rounds)) > 3


def test_a_comparison_takes_its_ratios_within_a_round(tmp_path, monkeypatch):
    """The work tree takes twice the time of the base in every round; both are slower in some."""
    pace = {"base": iter([9.0, 1.0, 10.0, 1.0]), "now": iter([9.0, 2.0, 20.0, 2.0])}
    monkeypatch.setattr(compare, "run_cases", lambda tree, python: {"one leg": next(pace[tree.name])})
    sides = [(tmp_path / name, "python") for name in ("base", "now")]
    assert compare.compare(*sides, 3) == {"one leg": [0.5] * 3}


def test_a_process_times_every_case_of_its_own_package(tmp_path):
    seconds = compare.run_cases(compare.ROOT, runs=1, share=0.02)
    assert len(seconds) == 6
    assert min(seconds.values()) > 0
    with pytest.raises(RuntimeError, match="expected hoof_env in"):
        compare.run_cases(tmp_path, runs=1, share=0.02)


@pytest.mark.skipif(not (compare.ROOT / ".git").exists(), reason="this is no clone")
def test_a_base_is_the_package_of_its_commit(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(compare, "KEPT", tmp_path)
    tree = compare.checkout("HEAD")
    assert (tree / "hoof_env" / "__init__.py").is_file()
    assert compare.checkout("HEAD") == tree
    (tree / "constraints.txt").unlink()  # one that was kept by an older version of this command
    assert compare.checkout("HEAD") == tree
    assert {path.name for path in tree.iterdir()} >= {"hoof_env", "pyproject.toml", "constraints.txt"}
    assert [path.name for path in tmp_path.iterdir()] == [tree.name]
    with pytest.raises(SystemExit):
        compare.main(["--base", "no such commit"])
    assert "expected a commit of this repository, got 'no such commit'" in capsys.readouterr().err


@pytest.fixture
def own_environments(monkeypatch):
    """A base and a work tree, each with an interpreter of its own; what extras are asked for."""
    asked = []

    def environments(base, now, extras):
        asked.append(extras)
        return Environment("python of base", "1"), Environment("python of now", "2")

    monkeypatch.setattr(compare, "checkout", lambda commit: compare.KEPT / commit)
    monkeypatch.setattr(compare, "environments", environments)
    return asked


def test_commits_of_different_numpys_are_not_compared(own_environments, monkeypatch, capsys):
    def refuse(*given):
        raise NoEnvironment("expected one version of NumPy")

    monkeypatch.setattr(compare, "environments", refuse)
    with pytest.raises(SystemExit):
        compare.main(["--base", "abc"])
    assert "error: expected one version of NumPy" in capsys.readouterr().err


def test_first_steps_have_their_seconds_and_the_ratio_of_each_round(own_environments, monkeypatch, capsys):
    """The base takes twice the time of the work tree in the second round; a third of what caches give."""
    ran = []

    def run(side, words, caches):
        ran.append((*side, words, caches))
        rounds = sum(one[:3] == (*side, words) for one in ran)
        return {"python of base": 8.0, "python of now": 4.0}[side[1]] * (1 if rounds % 2 else 0.25)

    monkeypatch.setattr(compare_first, "run", run)
    assert compare.main(["--base", "abc", "--first", "--rounds", "1"]) == 0
    assert own_environments == [("plot",)]
    head, _, *rows = capsys.readouterr().out.splitlines()
    assert head == "| processor seconds | abc | work tree | abc over work tree |"
    assert "| `import hoof_env`, empty caches | 8 | 4 | 2 |" in rows
    assert "| `import hoof_env`, full caches | 2 | 1 | 2 |" in rows
    assert "| edited term to the next step, empty caches | 8 | 4 | 2 |" in rows
    assert len(rows) == 2 * len(compare_first.WHOLE) + len(compare_first.EDITED)
    # Each pair has caches of its own, and both commits have run everything
    assert len({one[3] for one in ran}) == 2 * (1 + len(compare_first.WHOLE) + len(compare_first.EDITED))
    assert {one[:2] for one in ran} == {
        (compare.KEPT / "abc", "python of base"),
        (compare.ROOT, "python of now"),
    }


def test_a_spread_is_reported_where_there_are_rounds():
    found = {"a step": {"base": [8.0, 8.0, 16.0], "now": [4.0, 4.0, 4.0]}}
    row = compare_first.table(found, "abc").splitlines()[-1]
    assert row == "| a step | 8 (8 to 12; 8 to 16) | 4 (4 to 4; 4 to 4) | 2 (2 to 3; 2 to 4) |"


def test_a_process_counts_what_it_and_its_children_spend(tmp_path, monkeypatch):
    side = (compare.ROOT, sys.executable)
    assert 0.05 < compare_first.run(side, ("import",), tmp_path) < 60
    burn = "import subprocess, sys\nprint(sys.argv[1])\nsubprocess.run([sys.executable, '-c', sys.argv[2]])\n"
    monkeypatch.setattr(compare_first, "SCRIPT", tmp_path / "script.py")
    compare_first.SCRIPT.write_text(burn)
    work = "import time\nwhile time.process_time() < 0.5: pass"
    inside = str(compare.ROOT / "hoof_env" / "__init__.py")
    assert compare_first.run(side, (inside, work), tmp_path) > 0.5
    with pytest.raises(RuntimeError, match="expected hoof_env in"):
        compare_first.run(side, (str(tmp_path), ""), tmp_path)


@pytest.mark.parametrize("count", [1, 3])
def test_an_edited_term_is_in_the_next_step(count):
    """From the caches of the tests, or it would take much longer."""
    command = [sys.executable, "-P", str(compare_first.SCRIPT), "edit", str(count)]
    settings = os.environ | {"PYTHONPATH": str(compare.ROOT)}
    done = subprocess.run(command, env=settings, capture_output=True, text=True, check=True)
    package, seconds = done.stdout.split()
    assert package.startswith(str(compare.ROOT))
    assert 0.0 < float(seconds) < 300.0


def test_a_slower_work_tree_is_named(own_environments, capsys, monkeypatch):
    ratios = {"one leg": [0.9, 0.94, 1.0], "one horse": [0.94, 0.96, 1.2]}
    monkeypatch.setattr(compare, "compare", lambda *given: ratios)
    assert compare.main(["--base", "abc"]) == 1
    leg, horse = capsys.readouterr().out.splitlines()[2:]
    assert "0.94 (" in leg
    assert leg.endswith("| slower |")
    assert "0.96 (" in horse
    assert horse.endswith("|  |")


def test_threads_gain_what_the_model_says():
    alone = {"serial": 0.0, "group": 1e-5, "call": 0.0, "neighbours": 1.0}
    assert threads.gain(1024, 4, **alone) == pytest.approx(4.0)
    assert threads.gain(1024, 256, **alone) == pytest.approx(128.0)  # groups of 8
    assert threads.gain(1024, 4, **alone | {"neighbours": 1.25}) == pytest.approx(3.2)
    slower = {"serial": 1e-3, "group": 1e-5, "call": 1e-4, "neighbours": 1.0}
    assert threads.gain(2048, 2, **slower) == pytest.approx(4.56 / 3.38)
