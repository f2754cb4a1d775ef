"""Cost against run length, legs and environments; and what a start costs."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.speed_cases import Scene, engine, scenes, worked
from benchmarks.speed_rounds import interleave, spread
from hoof_env.dynamics.advance import TILE
from hoof_env.dynamics.trunk_engine import TrunkEngine

Runs = dict[str, Callable[[], float]]

_START = """
import time
begin = time.perf_counter()
from benchmarks.speed_cases import engine, scenes
at = scenes({preset!r})
cases = [("leg", 1), ("horse", 1), ("leg", 1024), ("horse", 1024)]
for options in {{}}, {{"reactions": True}}:
    for name, n in cases:
        engine(at[name], {preset!r}, n, **options).advance(steps=1)
        if not {everything}:
            break
    if not {everything}:
        break
print(time.perf_counter() - begin, time.process_time())
"""


def _start(preset: str, folder: str, everything: bool) -> tuple[float, float]:
    """Wall time of import, construction and first steps in a fresh process, and its processor time [s]."""
    environment = os.environ | {"NUMBA_CACHE_DIR": folder}
    code = _START.format(preset=preset, everything=everything)
    root = Path(__file__).resolve().parents[1]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=environment, capture_output=True, text=True, check=True
    )
    wall, processor = done.stdout.split()[-2:]
    return float(wall), float(processor)


def startup(preset: str, starts: int = 5) -> dict[str, Any]:
    """Compiling all kernels into an empty cache, then starts with a full one: wall and processor time [s]."""
    with tempfile.TemporaryDirectory() as folder:
        compiled = _start(preset, folder, everything=True)
        warm = np.array([_start(preset, folder, everything=False) for _ in range(starts)])
        everything = _start(preset, folder, everything=True)
    return {
        "first_compile_s": compiled,
        "warm_start_s": [spread(column) for column in warm.T],
        "warm_start_all_kernels_s": everything,
    }


def _advance(made: TrunkEngine, steps: int) -> Callable[[], float]:
    made.advance(steps=1, account=False)
    state = made.get_state()
    return partial(worked, partial(made.set_state, state), partial(made.advance, steps=steps, account=False))


def _legs(scene: Scene, count: int) -> Scene:
    """A free trunk on so many legs, half of them in front."""
    limb = scene.limbs[0]
    hips = [(0.6 - 1.2 * (i % 2), 0.0) for i in range(count)]
    trunk = replace(scene.trunk, mass=50.0 * count)
    return replace(
        scene,
        limbs=tuple(replace(limb, hip=hip) for hip in hips),
        trunk=trunk,
        cranks=tuple(0.3 + 2 * np.pi * i / count for i in range(count)),
    )


def scaling(preset: str, quick: bool, rounds: int) -> dict[str, dict[str, Any]]:
    """Wall time [s] of a step of one leg or environment, `per_unit_s`, against how many there are, `x`."""
    at = scenes(preset)
    lengths = [100, 1000] if quick else [100, 300, 1000, 3000, 10000, 30000, 100000, 300000]
    numbers = [1, 2] if quick else list(range(1, 9))
    sizes = [1, 64] if quick else [1, 2, 4, 6, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096]
    curves: dict[str, tuple[list[int], list[int], list[Callable[[], float]]]] = {}
    one = engine(at["leg"], preset)
    curves["one leg against steps"] = lengths, lengths, [_advance(one, n) for n in lengths]
    for title, envs, count in (("one trunk against legs", 1, 1000), ("batch of 256 against legs", 256, 20)):
        made = [engine(_legs(at["horse"], n), preset, envs if not quick else min(envs, 32)) for n in numbers]
        units = [n * e.num_envs * count for n, e in zip(numbers, made, strict=True)]
        curves[title] = numbers, units, [_advance(e, count) for e in made]
    for name in ("leg", "horse"):
        steps = [max(10, (20000 if name == "leg" else 5000) // n) for n in sizes]
        runs = [_advance(engine(at[name], preset, n), s) for n, s in zip(sizes, steps, strict=True)]
        curves[f"{name} against environments"] = (
            sizes,
            [n * s for n, s in zip(sizes, steps, strict=True)],
            runs,
        )
    named = {f"{t} {k}": run for t, (_, _, runs) in curves.items() for k, run in enumerate(runs)}
    seconds = interleave(named, rounds)
    return {
        title: {
            "x": xs,
            "line_from": TILE if "environments" in title and not quick else xs[0],
            "per_unit_s": [spread(seconds[f"{title} {k}"] / unit) for k, unit in enumerate(units)],
        }
        for title, (xs, units, _) in curves.items()
    }


def line_error(curve: dict[str, Any]) -> float:
    """Largest relative departure of the total cost from a straight line; from `line_from` on."""
    x = np.array(curve["x"], dtype=float)
    y = x * [s["median"] for s in curve["per_unit_s"]]
    x, y = x[x >= curve["line_from"]], y[x >= curve["line_from"]]
    fit = np.polyval(np.polyfit(x, y, 1, w=1 / y), x)
    return float(np.abs(fit / y - 1).max())


def draw(curves: dict[str, dict[str, Any]], folder: Path) -> None:
    """Three panels, `scaling.svg` and `scaling.png`."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    panels = (
        ("steps of one run", "step of the leg", {"one leg against steps": "one leg"}),
        (
            "legs on one trunk",
            "step of the trunk",
            {"one trunk against legs": "one trunk", "batch of 256 against legs": "batch of 256, per trunk"},
        ),
        (
            "environments in a batch",
            "step and environment",
            {"leg against environments": "one leg", "horse against environments": "horse, four legs"},
        ),
    )
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    for axis, (x_label, unit, curve_labels) in zip(axes, panels, strict=True):
        for (title, label), marker in zip(curve_labels.items(), "os", strict=False):
            x = np.array(curves[title]["x"], dtype=float)
            scale = 1e9 * (x if "legs" in x_label else np.ones_like(x))
            rows = curves[title]["per_unit_s"]
            low, middle, high = (scale * [row[k] for row in rows] for k in ("q1", "median", "q3"))
            bars = middle - low, high - middle
            axis.errorbar(x, middle, bars, marker=marker, ms=4, lw=1, capsize=2, label=label)
        if "legs" not in x_label:
            axis.set_xscale("log")
            axis.set_yscale("log" if "environments" in x_label else "linear")
        if "environments" not in x_label:
            axis.set_ylim(bottom=0)
        axis.set_xlabel(x_label)
        axis.set_ylabel(f"ns per {unit}")
        axis.legend(frameon=False)
        axis.spines[["top", "right"]].set_visible(False)
    for kind in ("svg", "png"):
        figure.savefig(folder / f"scaling.{kind}", dpi=150)
    plt.close(figure)
