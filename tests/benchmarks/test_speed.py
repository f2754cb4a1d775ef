"""The benchmark runs without peers, writes its files, and its arithmetic is right."""

import json
import platform
import sys

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks import speed
from benchmarks.speed_cases import Case, engine, scenes
from benchmarks.speed_code import WIDTHS, by_kind, instructions, target, vector_bits
from benchmarks.speed_history import keep, read
from benchmarks.speed_report import speed_table
from benchmarks.speed_rounds import interleave, spread
from benchmarks.speed_scaling import line_error
from benchmarks.speed_stages import STAGES, Pass


def test_quick_mode_runs_without_peers_and_writes_its_files(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)  # as if they were not installed
    monkeypatch.setitem(sys.modules, "exudyn", None)
    speed.main(["--quick", "--rounds", "2", "--out", str(tmp_path)])
    bits = vector_bits()
    own = tmp_path / f"{bits}-bits"
    assert {path.name for path in own.iterdir()} == {
        "speed.json",
        "speed.md",
        "scaling.png",
        "scaling.svg",
    }
    result = json.loads((own / "speed.json").read_text())
    assert result["machine"]["processor"]
    assert result["machine"]["compiled for"] == f"{target()[1]}, vectors of {bits} bits"
    assert {case["group"] for case in result["cases"]} == {"leg", "suspended leg", "horse"}
    assert all(case["rate"]["min"] > 0 and not case["ratios"] for case in result["cases"])
    assert "MuJoCo is left out" in " ".join(result["notes"])
    assert {case["bits"] for case in result["cases"]} == {bits}
    assert list(result["limits"]["ceilings_per_ns"]) == [str(w) for w in WIDTHS if w <= bits]
    page = (own / "speed.md").read_text()
    assert "leg, one" in page
    assert f"vectors of {bits} bits" in page
    for width in WIDTHS:
        assert (f"Vectors of {width} bits are left out" in page) == (width > bits)
    assert f"[{bits}-bits, speed]({bits}-bits/speed.md)" in (tmp_path / "speed.md").read_text()
    assert read(tmp_path) == []  # numbers of a smoke test mean nothing
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
            "\tmulpd\t%xmm0, %xmm1",
            "\tsqrtsd\t%xmm0, %xmm1",
            "\tmovhpd\t8(%rax), %xmm1",
        ]
    )
    found = instructions(code)
    assert +found == {
        ("all", 0): 12, ("arithmetic", 512): 1, ("divisions", 256): 1, ("square roots", 64): 2,
        ("arithmetic", 128): 2, ("loads", 512): 1, ("stores", 512): 1, ("loads", 64): 2,
    }  # fmt: skip
    assert by_kind(found) == {
        "instructions": 12, "divisions": 1, "square roots": 2, "arithmetic": 3, "loads": 3, "stores": 1,
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
