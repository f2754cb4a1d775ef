"""The benchmark runs without peers, writes its files, and its arithmetic is right."""

import json
import sys

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks import speed
from benchmarks.speed_cases import Case
from benchmarks.speed_code import count_operations, packed_and_not, vector_widths
from benchmarks.speed_report import speed_table
from benchmarks.speed_rounds import interleave, spread
from benchmarks.speed_scaling import line_error


def test_quick_mode_runs_without_peers_and_writes_its_files(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)  # as if they were not installed
    monkeypatch.setitem(sys.modules, "exudyn", None)
    speed.main(["--quick", "--rounds", "2", "--out", str(tmp_path)])
    assert {path.name for path in tmp_path.iterdir()} == {
        "speed.json",
        "speed.md",
        "scaling.png",
        "scaling.svg",
    }
    result = json.loads((tmp_path / "speed.json").read_text())
    assert result["machine"]["processor"]
    assert {case["group"] for case in result["cases"]} == {"leg", "suspended leg", "horse"}
    assert all(case["rate"]["min"] > 0 and not case["ratios"] for case in result["cases"])
    assert "MuJoCo is left out" in " ".join(result["notes"])
    page = (tmp_path / "speed.md").read_text()
    assert "leg, one" in page
    assert "scaling.svg" in page
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


def test_every_case_runs_once_a_round_in_changing_order():
    seen = []
    runs = {name: (lambda name=name: seen.append(name) or 1.0) for name in "abc"}
    interleave(runs, 20)
    rounds = [tuple(seen[k : k + 3]) for k in range(0, len(seen), 3)]
    assert len(rounds) == 21
    assert all(sorted(r) == ["a", "b", "c"] for r in rounds)
    assert len(set(rounds)) > 3


def test_machine_code_is_counted_by_width():
    code = "\n".join(
        [
            "\tvmulpd\t(%rax), %zmm1, %zmm2",
            "\tvdivpd\t%ymm1, %ymm2, %ymm3",
            "\tvsqrtsd\t%xmm1, %xmm2, %xmm3",
            "\tvaddpd\t.LCPI0_1(%rip), %xmm1, %xmm2",
            "\tvmovupd\t%zmm2, 64(%rsp)",
            "\tmovq\t8(%rsp), %rax",
        ]
    )
    assert count_operations(code) == {"arithmetic": 10, "divisions": 4, "square_roots": 1, "accesses": 16}
    assert vector_widths(code) == {"scalar": 1, "128": 1, "256": 1, "512": 1}
    assert packed_and_not(code) == {"div packed": 1, "div scalar": 0, "sqrt packed": 0, "sqrt scalar": 1}


def test_departure_from_a_straight_line():
    x = [1, 10, 100]
    straight = [{"median": (5 + 2 * n) / n} for n in x]
    assert line_error({"x": x, "line_from": 1, "per_unit_s": straight}) < 1e-9
    assert line_error({"x": x, "line_from": 1, "per_unit_s": [{"median": n} for n in x]}) > 0.1
