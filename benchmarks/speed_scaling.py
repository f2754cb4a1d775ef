"""Cost against run length, legs and environments; and what a start costs."""

from __future__ import annotations

import json
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
from benchmarks.speed_rounds import Floats, interleave, spread
from hoof_env.dynamics.advance import LANES
from hoof_env.dynamics.trunk_engine import TrunkEngine

KERNELS = {
    "advance_leg": ("leg", 1, 1),
    "advance_four": ("horse", 4, 1),
    "advance_batch": ("leg", 1, 8),
}
"""Scene, legs and environments that each is used for."""

_START = """
import json, time
spent, last = {{}}, [time.perf_counter(), 0.0]
def lap(name):
    now = [time.perf_counter(), time.process_time()]
    spent[name] = [b - a for a, b in zip(last, now)]
    last[:] = now
from benchmarks.speed_cases import engine, scenes
from benchmarks.speed_scaling import KERNELS, on_legs
from hoof_env.leg.profile import leg_profile
at = scenes({preset!r})
leg_profile(at["leg"].limbs[0].geometry)
lap("import, table of the leg")
for name in {kernels}:
    scene, legs, number = KERNELS[name]
    made = engine(on_legs(at[scene], legs), {preset!r}, number)
    made.advance(steps=1)
    assert made._run.__name__ == name
    lap(name)
print(json.dumps(spent))
"""


def _start(preset: str, folder: str, kernels: list[str]) -> dict[str, Floats]:
    """Wall and processor time [s] of parts of a start in a fresh process, and of all: import, and for each
    kernel construction and a first step."""
    environment = os.environ | {"NUMBA_CACHE_DIR": folder, "HOOF_ENV_QUIET": "1"}
    code, root = _START.format(preset=preset, kernels=kernels), Path(__file__).resolve().parents[1]
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=environment, capture_output=True, text=True, check=True
    )
    spent = {name: np.array(both) for name, both in json.loads(done.stdout).items()}
    return spent | {"all": np.sum(list(spent.values()), axis=0)}


def startup(preset: str, starts: int = 5) -> dict[str, Any]:
    """Wall and processor time [s] of the first start, in an empty cache, of all kernels; of the same again;
    and of starts with one leg."""
    with tempfile.TemporaryDirectory() as folder:
        cold, again = (_start(preset, folder, list(KERNELS)) for _ in range(2))
        warm = np.array([_start(preset, folder, ["advance_leg"])["all"] for _ in range(starts)])
    return {
        "cold_s": {name: list(both) for name, both in cold.items()},
        "cached_s": {name: list(both) for name, both in again.items()},
        "warm_one_leg_s": [spread(column) for column in warm.T],
    }


def _advance(made: TrunkEngine, steps: int) -> Callable[[], float]:
    made.advance(steps=1, account=False)
    state = made.get_state()
    return partial(worked, partial(made.set_state, state), partial(made.advance, steps=steps, account=False))


def on_legs(scene: Scene, count: int) -> Scene:
    """The scene with so many legs, half of them in front, and a trunk for them."""
    if count == len(scene.limbs):
        return scene
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
    made = [engine(on_legs(at["horse"], n), preset, 32 if quick else 256) for n in numbers]
    units = [n * e.num_envs * 20 for n, e in zip(numbers, made, strict=True)]
    curves["batch of 256 against legs"] = numbers, units, [_advance(e, 20) for e in made]
    steps = 10 if quick else 1000
    for name in ("leg", "horse"):
        runs = [_advance(engine(at[name], preset, n), steps) for n in sizes]
        curves[f"{name} against environments"] = sizes, [n * steps for n in sizes], runs
    named = {f"{t} {k}": run for t, (_, _, runs) in curves.items() for k, run in enumerate(runs)}
    seconds = interleave(named, rounds)
    return {
        title: {
            "x": xs,
            "line_from": LANES if "environments" in title and not quick else xs[0],
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


def draw(curves: dict[str, dict[str, Any]], folder: Path, bits: int) -> None:
    """Three panels for vectors of so many bits, `scaling.svg` and `scaling.png`."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    panels = (
        ("steps of one run", "step of the leg", {"one leg against steps": "one leg"}),
        (
            "legs on one trunk",
            "step of the trunk",
            {"batch of 256 against legs": "batch of 256, per trunk"},
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
    figure.suptitle(f"vectors of {bits} bits", fontsize="medium")
    for kind in ("svg", "png"):
        figure.savefig(folder / f"scaling.{kind}", dpi=150)
    plt.close(figure)
