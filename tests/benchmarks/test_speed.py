"""The benchmarks run without peers, write their files, and their arithmetic is right."""

import json
import sys

import numpy as np
import pytest

from benchmarks import compare, speed, threads
from benchmarks.history import keep, read
from benchmarks.machine import compiled_for, vector_bits
from benchmarks.rounds import interleave, spread
from benchmarks.speed import Case, speed_table


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
    assert "| 0.40 | under 30: met |" in late
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
    monkeypatch.setattr(compare, "run_cases", lambda tree: {"one leg": next(pace[tree.name])})
    assert compare.compare(tmp_path / "base", tmp_path / "now", 3) == {"one leg": [0.5] * 3}


def test_a_process_times_every_case_of_its_own_package(tmp_path):
    seconds = compare.run_cases(compare.ROOT, runs=1, share=0.02)
    assert len(seconds) == 6
    assert min(seconds.values()) > 0
    with pytest.raises(RuntimeError, match="expected hoof_env of"):
        compare.run_cases(tmp_path, runs=1, share=0.02)


@pytest.mark.skipif(not (compare.ROOT / ".git").exists(), reason="this is no clone")
def test_a_base_is_the_package_of_its_commit(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(compare, "KEPT", tmp_path)
    tree = compare.checkout("HEAD")
    assert (tree / "hoof_env" / "__init__.py").is_file()
    assert compare.checkout("HEAD") == tree
    assert [path.name for path in tmp_path.iterdir()] == [tree.name]
    with pytest.raises(SystemExit):
        compare.main(["--base", "no such commit"])
    assert "expected a commit of this repository, got 'no such commit'" in capsys.readouterr().err


def test_a_slower_work_tree_is_named(capsys, monkeypatch):
    monkeypatch.setattr(compare, "checkout", lambda commit: compare.KEPT / commit)
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
