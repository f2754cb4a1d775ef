"""Speed of the engine compared with MuJoCo and Exudyn on the same leg: `make bench`.

Everything runs interleaved in one process on one thread. Writes speed.json and speed.md into a folder for the
vector width, and a row for each barred case into speed.csv and speed.md next to it.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common import ALL, RIGID, GroundForces
from benchmarks.history import RESULTS, write
from benchmarks.machine import machine, vector_bits
from benchmarks.rounds import bar_text, describe, interleave, spread, timed
from benchmarks.scenes import DT, Scene, engine, scenes, with_springs
from hoof_env._output import markdown_table
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limits
from hoof_env.ground.contact import load_ground

ROUNDS = 40
BATCH = 1024

PRESET = "identified"
"""Leg and ground of the scenes. With its swing held, its walk meets the ground under a fixed trunk, too; that
of `tests/data/first_fit.json` does not."""

ASSEMBLIES = {"ALL": ALL, "RIGID": RIGID}

BARS = {
    ("leg", 1): (35, 80),
    ("leg", BATCH): (150, 220),
    ("horse", 1): (60, None),
    ("horse", BATCH): (120, 170),
}
"""Required and aimed ratios to MuJoCo's `ALL`, of one and of a batch."""

STEPS = {("leg", 1): 20000, ("leg", BATCH): 100, ("horse", 1): 1000, ("horse", BATCH): 40}

START_BARS = {"import hoof_env": 0.3, "first step of HorseLeg-v0 with an empty cache": 2.0}
"""Most seconds in a fresh process."""

VARIANTS: tuple[tuple[str, dict[str, Any], float], ...] = (
    ("", {}, 1.0),
    (", all joint reactions", {"reactions": True}, 0.5),
    (", semi_implicit_euler", {"integrator": "semi_implicit_euler"}, 0.0),
)
"""Name, options of the engine, and the share of the bars that it must meet; the last is MuJoCo's own
scheme."""

ANIMAL: tuple[tuple[str, dict[str, Any], float | None], ...] = (
    (", springs and three harmonics", {"harmonics": 3}, 1.4),
    (
        ", the same with limits and figures of stances",
        {"harmonics": 3, "limits": Limits(), "strides": True},
        None,
    ),
)
"""Name and options of compliant legs, and the largest ratio of their time of a step to rigid legs'."""

INTRO = """\
# How fast it is

Written by `make bench`; run it again for the numbers of your machine. Everything runs in one process on one
thread, interleaved: {rounds} rounds, each with every case once in a new order, {clock} time. A ratio is taken
within a round; given are the median and in brackets quartiles and extremes. Only ratios count. Every figure
of this engine is of code with vectors of up to {bits} bits, the widest of kernels here; MuJoCo and
Exudyn are as they come."""

RATIOS = """\
## Ratios

Steps of 1 ms with contact and motors. MuJoCo: `mj_step` of many steps with its own contact. ALL is the
linkage body for body and joint for joint (14 hinges a leg); RIGID has the rigid triangles and the locked
shank welded (9 hinges), which is kinder to MuJoCo. The bars are judged on ALL. Rates are steps of the whole
animal. Bars with all joint reactions are half of those without."""


COSTS = """\
## A whole animal

The time of a step of four compliant legs whose swing has three harmonics, over that of four rigid legs with
one, in the same round."""


@dataclass(frozen=True)
class Case:
    """Piece of work to time.

    Attributes:
        name: unique.
        group: the scene; cases of one group have the same reference.
        run: does the work from the same state and returns its time [s].
        units: steps of the whole animal in it.
        note: remark in the table.
        required, aimed: bars of the ratio to the reference.
        bits: bits of the widest vectors in the code of kernels.
    """

    name: str
    group: str
    run: Callable[[], float]
    units: int
    note: str = ""
    required: float | None = None
    aimed: float | None = None
    bits: int | None = None


CLOCKS = {"wall": time.perf_counter, "processor": time.thread_time}
Clock = Callable[[], float]


def own_cases(quick: bool, clock: Clock) -> list[Case]:
    """Return the cases of this project's engine."""
    cases = []
    for (name, count), steps in STEPS.items():
        n, steps = (min(count, 64), max(steps // 20, 4)) if quick else (count, steps)
        title = f"{name}, " + ("one" if n == 1 else f"batch of {n}")
        for what, options, share in VARIANTS:
            run = run_of(engine(scenes(PRESET)[name], PRESET, n, **options), steps, clock)
            bars = (None, None) if quick or not share else BARS[name, count]
            required, aimed = (bar and share * bar for bar in bars)
            cases.append(Case(title + what, name, run, n * steps, "", required, aimed, vector_bits()))
        for what, options, _ in ANIMAL if name == "horse" else ():
            run = run_of(engine(with_springs(scenes(PRESET)[name]), PRESET, n, **options), steps, clock)
            cases.append(Case(title + what, name, run, n * steps, bits=vector_bits()))
    return cases


def run_of(made: TrunkEngine, steps: int, clock: Clock) -> Callable[[], float]:
    """Return a function that times `steps` steps of an engine from its present state, with compiled
    kernels."""
    # Compiles outside of the clock
    made.advance(steps=1, account=False)
    before = partial(made.set_state, made.get_state())
    return partial(timed, clock, before, partial(made.advance, steps=steps, account=False))


def mujoco_cases(quick: bool, clock: Clock) -> list[Case]:
    """Return the cases of MuJoCo's `mj_step`, with its own contact and the Jacobian that is faster here."""
    import mujoco

    from benchmarks.mujoco_legs import MujocoLegs

    def run_of(scene: Scene, assembly: str, jacobian: int) -> Callable[[], float]:
        parts = ASSEMBLIES[assembly]
        legs = MujocoLegs(scene.limbs, scene.trunk, scene.start, dt=DT, contact=True, assembly=parts)
        model = legs.model
        data = legs.data
        what = mujoco.mjtState.mjSTATE_INTEGRATION
        model.geom_solref[:] = scene.softness, 1.0
        model.opt.jacobian = jacobian
        state = np.empty(mujoco.mj_stateSize(model, what))
        mujoco.mj_getState(model, data, state, what)
        before = partial(mujoco.mj_setState, model, data, state, what)
        return partial(timed, clock, before, partial(mujoco.mj_step, model, data, steps))

    cases = []
    steps = 50 if quick else 1000
    for name in ("leg", "horse"):
        for assembly in ASSEMBLIES:
            runs = {
                kind: run_of(scenes(PRESET)[name], assembly, k) for k, kind in enumerate(("dense", "sparse"))
            }
            # The peer runs with the options that serve it best
            fastest = {kind: min(run() for _ in range(2 if quick else 7)) for kind, run in runs.items()}
            best = min(runs, key=lambda kind: fastest[kind])
            cases.append(Case(f"{name}, MuJoCo {assembly}", name, runs[best], steps, f"{best} Jacobian"))
    return cases


def exudyn_cases(quick: bool, clock: Clock) -> list[Case]:
    """Return the cases of Exudyn at its fastest, with this project's contact law and motor in Python."""
    from benchmarks.exudyn_legs import ExudynLegs

    def run(scene: Scene) -> float:
        law = GroundForces(load_ground(PRESET), len(scene.limbs))
        legs = ExudynLegs(scene.limbs, scene.trunk, scene.start, dt=DT, outside=law)
        return timed(clock, lambda: None, partial(legs.run, steps * DT, 1, fast=True))

    steps = 5 if quick else 50
    title = "Exudyn with our contact law from Python"
    return [
        Case(f"{name}, {title}", name, partial(run, scenes(PRESET)[name]), steps, "modified Newton")
        for name in ("leg", "horse")
    ]


def compare(cases: list[Case], rounds: int) -> list[dict[str, Any]]:
    """Time all cases interleaved: rates [steps/s] and ratios to MuJoCo of the same group, as spreads."""
    seconds = interleave({case.name: case.run for case in cases}, rounds)
    costs = {
        case.name + what: seconds[case.name + what] / seconds[case.name]
        for case in cases
        for what, _, _ in ANIMAL
        if case.name + what in seconds
    }
    rate = {case.name: case.units / seconds[case.name] for case in cases}
    rows = []
    for case in cases:
        peers = {a: f"{case.group}, MuJoCo {a}" for a in ASSEMBLIES}
        others = {a: rate[peer] for a, peer in peers.items() if peer in rate and peer != case.name}
        ratios = {a: spread(rate[case.name] / other) for a, other in others.items()}
        rows.append(
            {
                "name": case.name,
                "group": case.group,
                "note": case.note,
                "bits": case.bits,
                "rate": spread(rate[case.name]),
                "ratios": ratios,
                "cost": spread(costs[case.name]) if case.name in costs else None,
                "required": case.required,
                "aimed": case.aimed,
            }
        )
    return rows


def start() -> dict[str, float]:
    """Return the wall time [s] of `import hoof_env`, and of all up to a first step whose kernels are
    compiled: medians of five processes each."""
    root = Path(__file__).resolve().parents[1]

    def seconds_of(code: str, before: str = "", **settings: str) -> float:
        clock = "import time; begin = time.perf_counter()"
        program = "\n".join((before, clock, code, "print(time.perf_counter() - begin)"))
        command = [sys.executable, "-c", program]
        environment = os.environ | settings
        done = subprocess.run(
            command, cwd=root, env=environment, stdout=subprocess.PIPE, text=True, check=True
        )
        return float(done.stdout)

    def first_step() -> float:
        with tempfile.TemporaryDirectory() as folder:
            make = 'import gymnasium, hoof_env; env = gymnasium.make("hoof_env/HorseLeg-v0")'
            step = "env.reset(seed=0); env.step(env.action_space.sample())"
            return seconds_of(f"{make}; {step}", HOOF_ENV_CACHE_DIR=folder)

    imported, stepped = (
        float(np.median([seconds() for _ in range(5)]))
        for seconds in (lambda: seconds_of("import hoof_env"), first_step)
    )
    return dict(zip(START_BARS, (imported, stepped), strict=True))


def measure(quick: bool, rounds: int, clock_name: str) -> dict[str, Any]:
    """Measure all of it and return the content of `speed.json`."""
    clock = CLOCKS[clock_name]
    cases = own_cases(quick, clock)
    notes = []
    for package, title, peer in (("mujoco", "MuJoCo", mujoco_cases), ("exudyn", "Exudyn", exudyn_cases)):
        if importlib.util.find_spec(package):
            cases += peer(quick, clock)
        else:
            notes.append(f"{title} is left out")
    print(f"{len(cases)} cases, {rounds} rounds", file=sys.stderr, flush=True)
    rows = compare(cases, rounds)
    return {
        "machine": machine(),
        "bits": vector_bits(),
        "preset": PRESET,
        "quick": quick,
        "clock": clock_name,
        "rounds": rounds,
        "dt_s": DT,
        "cases": rows,
        "notes": notes,
        "start": None if quick else start(),
    }


def speed_table(rows: list[dict[str, Any]]) -> str:
    """Return the table of every case: its rate, its ratios, and the verdicts on the bars."""
    head = ["case", "bits", "steps/s", "ratio to MuJoCo ALL", "ratio to MuJoCo RIGID", "required", "aimed at"]
    lines = []
    for row in rows:
        ratios = row["ratios"]
        rate = row["rate"]["median"]
        lines.append(
            [
                row["name"] + (f" ({row['note']})" if row["note"] else ""),
                str(row["bits"] or ""),
                f"{rate / 1e6:.2f} M" if rate >= 1e6 else f"{rate / 1e3:.3g} k",
                *(describe(ratios[a]) if a in ratios else "" for a in ASSEMBLIES),
                *(bar_text(row[bar], ratios.get("ALL")) if row[bar] else "" for bar in ("required", "aimed")),
            ]
        )
    return markdown_table(head, lines)


def cost_table(rows: list[dict[str, Any]]) -> str:
    """Return the table of the costs of springs and harmonics, compared with rigid legs."""
    bars = {what: bar for what, _, bar in ANIMAL}
    lines = []
    for row in rows:
        if cost := row["cost"]:
            bar = next(bar for what, bar in bars.items() if row["name"].endswith(what))
            met = f"{bar:g}: {'met' if cost['median'] <= bar else 'not met'}" if bar else ""
            lines.append([row["name"], describe(cost), met])
    return markdown_table(["case", "time over that of rigid legs", "at most"], lines)


def page(result: dict[str, Any]) -> str:
    """Return the whole result as Markdown."""
    about = [["leg and ground", result["preset"]], *([k, v] for k, v in result["machine"].items())]
    parts = [INTRO.format(**result), markdown_table(["", ""], about), RATIOS, speed_table(result["cases"])]
    parts += [COSTS, cost_table(result["cases"])]
    parts += [f"- {note}" for note in result["notes"]]
    if seconds := result["start"]:
        rows = [
            [what, f"{seconds[what]:.2f}", f"under {bar:g}: {'met' if seconds[what] < bar else 'not met'}"]
            for what, bar in START_BARS.items()
        ]
        parts += ["## Start", markdown_table(["in a fresh process", "wall s", "bar"], rows)]
    return "\n\n".join(parts) + "\n"


def main(arguments: list[str] | None = None) -> None:
    """Run the command; see `--help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of results of all vector widths")
    parser.add_argument("--rounds", type=int, help=f"how many; {ROUNDS} if not given")
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="processor: on a busy machine")
    parser.add_argument("--quick", action="store_true", help="a smoke test: small numbers that mean nothing")
    args = parser.parse_args(arguments)
    rounds = args.rounds or (2 if args.quick else ROUNDS)
    result = measure(args.quick, rounds, args.clock)
    rows = [(row["name"], "MuJoCo ALL", row["ratios"].get("ALL"), row["required"]) for row in result["cases"]]
    folder = write(args.out, "speed", result, page(result), rows)
    print(speed_table(result["cases"]))
    print(f"written to {folder}")


if __name__ == "__main__":
    main()
