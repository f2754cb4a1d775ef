"""How fast the engine is, beside MuJoCo and Exudyn on the same leg: `make bench`.

Everything runs interleaved in one process on one thread. `speed_cases` and `speed_peers` say what is timed,
`speed_rounds` how, `speed_limits` what limits it. Writes speed.json, speed.md, scaling.svg and scaling.png
into a folder for the vector width, and a row for each barred case into speed.csv and speed.md beside it.
"""

from __future__ import annotations

import benchmarks.speed_threads  # noqa: F401  # isort: skip

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import speed_cases as cases
from benchmarks.speed_code import target, vector_bits
from benchmarks.speed_history import keep
from benchmarks.speed_limits import limits
from benchmarks.speed_peers import ASSEMBLIES, exudyn_cases, has, mujoco_cases, walking
from benchmarks.speed_report import markdown, speed_table
from benchmarks.speed_rounds import interleave, spread
from benchmarks.speed_scaling import draw, line_error, scaling, startup
from hoof_env._output import staged

RESULTS = Path(__file__).parent / "results"
ROUNDS = 40


def machine() -> dict[str, str]:
    """What it ran on and was compiled for: processor, vectors, versions, date and commit."""
    _, processor, features = target()
    versions = []
    for package in ("hoof-env", "numba", "llvmlite", "numpy", "mujoco", "exudyn"):
        try:
            versions.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{package} not installed")
    return {
        "processor": f"{_processor()}, {os.cpu_count()} cores, one used",
        "compiled for": f"{processor}, vectors of {vector_bits()} bits",
        "vector features": " ".join(sorted(features)) or f"those of {processor}",
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "versions": ", ".join(versions),
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "commit": _commit(),
    }


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
        return next(
            line.split(":", 1)[1].strip() for line in text.splitlines() if line.startswith("model name")
        )
    except (OSError, StopIteration):
        return platform.processor() or "unknown"


def _commit() -> str:
    def git(*arguments: str) -> str:
        done = subprocess.run(
            ["git", *arguments], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    try:
        changed = git("status", "--porcelain", "--untracked-files=no", "--", "../hoof_env", ".", ":!results")
        return git("rev-parse", "--short", "HEAD") + (" and changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


PRESET = "identified"
"""With its swing held, its walk meets the ground under a fixed trunk too; that of `first_fit` does not."""


def measure(preset: str, quick: bool, peers: bool, rounds: int) -> dict[str, Any]:
    """All of it; what `speed.json` holds."""
    start = None
    if not quick:
        _say("start")
        start = startup(preset)
    found, notes = cases.our_cases(preset, quick), []
    mujoco = peers and has("mujoco")
    if mujoco:
        found += mujoco_cases(preset, quick)
    else:
        notes.append("MuJoCo is left out: no ratios")
    if peers and has("exudyn"):
        found += exudyn_cases(preset, quick)
    else:
        notes.append("Exudyn is left out")
    _say(f"{len(found)} cases, {rounds} rounds")
    rows = compare(found, rounds)
    _say("do they walk")
    walk_steps = 100 if quick else 1000
    walks = walking(preset, mujoco, walk_steps)
    _say("what limits it")
    limited = limits(preset, quick, max(2, rounds // 2))
    _say("cost against size")
    curves = scaling(preset, quick, max(2, rounds // 2))
    for curve in curves.values():
        curve["line_error"] = line_error(curve)
    return {
        "machine": machine(), "bits": vector_bits(), "preset": preset, "quick": quick, "clock": cases.CLOCK,
        "rounds": rounds, "dt_s": cases.DT,
        "cases": rows, "notes": notes, "walking": walks, "walking_steps": walk_steps,
        "limits": limited, "scaling": curves, "startup": start,
    }  # fmt: skip


def compare(found: list[cases.Case], rounds: int) -> list[dict[str, Any]]:
    """Time all cases interleaved: rates [steps/s] and ratios to MuJoCo of the same group, as spreads."""
    seconds = interleave({case.name: case.run for case in found}, rounds)
    rate = {case.name: case.units / seconds[case.name] for case in found}
    rows = []
    for case in found:
        peers = {a: f"{case.group}, MuJoCo {a}" for a in ASSEMBLIES}
        rows.append(
            {
                "name": case.name,
                "group": case.group,
                "note": case.note,
                "bits": case.bits,
                "rate": spread(rate[case.name]),
                "ratios": {
                    a: spread(rate[case.name] / rate[peer])
                    for a, peer in peers.items()
                    if peer in rate and peer != case.name
                },
                "required": case.required,
                "aimed": case.aimed,
            }
        )
    return rows


def _say(what: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {what}", file=sys.stderr, flush=True)


def main(arguments: list[str] | None = None) -> None:
    """The command; see `--help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for those of all vector widths")
    parser.add_argument("--preset", default=PRESET, help="whose leg and ground")
    parser.add_argument("--rounds", type=int, help=f"how many; {ROUNDS} if not given")
    parser.add_argument("--clock", choices=cases.CLOCKS, default="wall", help="processor: on a busy machine")
    parser.add_argument("--quick", action="store_true", help="a smoke test: small numbers that mean nothing")
    parser.add_argument("--no-peers", action="store_true", help="this engine alone")
    given = parser.parse_args(arguments)
    cases.CLOCK = given.clock
    rounds = given.rounds or (2 if given.quick else ROUNDS)
    result = measure(given.preset, given.quick, not given.no_peers, rounds)
    own = given.out / f"{result['bits']}-bits"
    with staged(own) as folder:
        draw(result["scaling"], folder, result["bits"])
        (folder / "speed.json").write_text(json.dumps(result, indent=1, default=_plain) + "\n")
        (folder / "speed.md").write_text(markdown(result))
    rows = [(row["name"], "MuJoCo ALL", row["ratios"].get("ALL"), row["required"]) for row in result["cases"]]
    keep(given.out, result["machine"], result["bits"], rows)
    print(speed_table(result["cases"]))
    print(f"written to {own}")


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"expected something that JSON has, got {value!r}")


if __name__ == "__main__":
    main()
