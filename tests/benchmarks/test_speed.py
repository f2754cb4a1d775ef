"""The benchmark runs without peers, writes its files, and its arithmetic is right."""

import json
import platform
import sys

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks import speed
from benchmarks.speed_cases import Case, engine, scenes
from benchmarks.speed_code import by_kind, instructions
from benchmarks.speed_report import speed_table
from benchmarks.speed_rounds import interleave, spread
from benchmarks.speed_scaling import line_error
from benchmarks.speed_stages import STAGES, Pass


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
            "loop:",
            "\t.p2align\t4",
            "\tvmulpd\t(%rax), %zmm1, %zmm2",
            "\tvdivpd\t%ymm1, %ymm2, %ymm3",
            "\tvsqrtsd\t%xmm1, %xmm2, %xmm3",
            "\tvaddpd\t.LCPI0_1(%rip), %xmm1, %xmm2",
            "\tvmovupd\t%zmm2, 64(%rsp) {%k1}",
            "\tvmovapd\t%zmm2, %zmm3",
            "\tmovq\t8(%rsp), %rax  # 8-byte Reload",
            "\tleaq\t8(%rsp), %rax",
            "\tretq",
        ]
    )
    found = instructions(code)
    assert +found == {
        ("all", 0): 9, ("arithmetic", 512): 1, ("divisions", 256): 1, ("square roots", 64): 1,
        ("arithmetic", 128): 1, ("loads", 512): 1, ("stores", 512): 1, ("loads", 64): 1,
    }  # fmt: skip
    assert by_kind(found) == {
        "instructions": 9, "divisions": 1, "square roots": 1, "arithmetic": 2, "loads": 2, "stores": 1,
    }  # fmt: skip


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="counts x86 code")
def test_a_stage_is_counted_for_all_legs():
    """One division for a crank, whatever the loop around it; the trunk's 3 x 3 system has one of its own."""
    horse = Pass(engine(scenes("identified")["horse"], "identified", 8), lanes=8)
    legs, trunk = (horse.count(STAGES[name]) for name in ("feel the leg", "accelerate the trunk"))
    bits = {
        kind: sum(n * w for (k, w), n in legs.items() if k == kind) for kind in ("divisions", "square roots")
    }
    assert bits == {"divisions": 4 * 8 * 64, "square roots": 0}
    assert by_kind(trunk)["divisions"] * 4 == by_kind(legs)["divisions"]


def test_departure_from_a_straight_line():
    x = [1, 10, 100]
    straight = [{"median": (5 + 2 * n) / n} for n in x]
    assert line_error({"x": x, "line_from": 1, "per_unit_s": straight}) < 1e-9
    assert line_error({"x": x, "line_from": 1, "per_unit_s": [{"median": n} for n in x]}) > 0.1
