"""What limits the speed: the stages of a step one by one, the machine's ceilings, and experiments.

A pass is what the kernels' code does at a time: one leg, eight legs of a batch, the four legs of a horse or
eight horses. What it would take if nothing but its divisions, its arithmetic, its loads or its stores went at
the machine's ceiling says which of them it is bound by; the clock says how many instructions go side by side.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from benchmarks.speed_cases import BATCH, DT, STEPS, Scene, engine, scenes, worked
from benchmarks.speed_ceilings import ceilings, clock
from benchmarks.speed_code import (
    KINDS,
    WIDTHS,
    assembly,
    by_kind,
    instructions,
    is_counted,
    target,
    vector_bits,
)
from benchmarks.speed_rounds import Floats, interleave, spread
from benchmarks.speed_stages import STAGES, STEP, Pass, jit
from hoof_env.dynamics.advance import LANES, advance_batch, advance_four, advance_leg, run
from hoof_env.dynamics.trunk_engine import TrunkEngine
from hoof_env.dynamics.trunk_model import new_memory
from hoof_env.simd.memory import aligned

Timed = tuple[Callable[[], float], float]
"""A run, and how many of what is asked it does."""

PASSES = {
    "leg, one": ("leg", 1, 1),
    "leg, batch": ("leg", LANES, BATCH),
    "horse, one": ("horse", 4, 1),
    "horse, batch": ("horse", LANES, BATCH),
}
"""By name: scene, lanes, environments."""

PIECE = "a step in one piece"

BOUNDS = {"divisions": KINDS[:2], "arithmetic": KINDS[2:3], "loads": KINDS[3:4], "stores": KINDS[4:]}
"""Square roots go through the divider."""

TURNS = 20000  # of a stage

Counts = Counter[tuple[str, int]]


def limits(preset: str, quick: bool, rounds: int) -> dict[str, Any]:
    """Clock, ceilings, the stages of a pass, widths of the kernels' instructions, experiments, and what is
    left out because this machine does not have it."""
    turns, at = 200 if quick else 100000, scenes(preset)
    widths = [width for width in WIDTHS if width <= vector_bits()]
    runs: dict[Any, Timed] = {"clock": clock(10 * turns)} if is_counted() else {}
    for width in widths:
        runs |= {(kind, width): timed for kind, timed in ceilings(width // 64, turns).items()}
    counts: dict[str, dict[str, Counts]] = {}
    for name, (scene, lanes, number) in {} if quick or not is_counted() else PASSES.items():
        made = engine(at[scene], preset, number)
        one, counts[name] = Pass(made, lanes, together=number == 1 < lanes), {}
        runs[name, "step"] = _advance(made, number // lanes if number > 1 else 1, STEPS[scene, number])
        for title, stage in {**STAGES, PIECE: STEP}.items():
            if not stage.moves or made.trunk.kind != "fixed":
                found, work = one.count(stage), partial(one.loop(stage, one.legs), *one.given, DT, TURNS)
                counts[name][title] = Counter({k: stage.calls * n for k, n in found.items()})
                runs[name, title] = partial(worked, _nothing, work), TURNS / stage.calls
    seconds = _each(runs, rounds)
    return {
        "clock_GHz": spread(1e-9 / seconds["clock"]) if "clock" in seconds else None,
        "ceilings_per_ns": {w: {k: spread(1e-9 / seconds[k, w]) for k in KINDS} for w in widths},
        "left_out": left_out(),
        "passes": {name: _pass(name, found, seconds) for name, found in counts.items()},
        "widths": {} if quick or not is_counted() else _widths(at, preset),
        "experiments": {} if quick else experiments(preset, rounds),
    }


def left_out() -> list[str]:
    """A line for each thing that is not measured here, and why."""
    bits, (architecture, name, _) = vector_bits(), target()
    lines = [
        f"Vectors of {width} bits are left out: the code that numba makes for {name} has none."
        for width in WIDTHS
        if width > bits
    ]
    if not is_counted():
        lines.append(f"Clock and counts of instructions are left out: they know x86_64, not {architecture}.")
    return lines


def _pass(name: str, counts: dict[str, Counts], seconds: dict[Any, Floats]) -> dict[str, Any]:
    """Of one pass: what its stages do and take in a step, and how near the step comes to the ceilings."""

    def needed(count: Counts, bound: str) -> Any:
        timed = ((k, w) for k in BOUNDS[bound] for w in WIDTHS if (k, w) in seconds)
        return sum(count[key] * seconds[key] for key in timed)

    def row(count: Counts, spent: Floats) -> dict[str, Any]:
        return by_kind(count) | {
            "ns": spread(spent * 1e9),
            "per_cycle": spread(count["all", 0] * seconds["clock"] / spent),
            "of_ceiling": {bound: spread(needed(count, bound) / spent) for bound in BOUNDS},
        }

    rows = {title: row(count, seconds[name, title]) for title, count in counts.items()}
    return {"rows": rows, "step": row(counts[PIECE], seconds[name, "step"])}


def _widths(at: dict[str, Scene], preset: str) -> dict[str, dict[str, dict[int, int]]]:
    """Floating-point instructions of each kernel by kind and width."""
    kernels: tuple[tuple[Any, str, int], ...] = (
        (advance_leg, "leg", 1), (advance_four, "horse", 1), (advance_batch, "leg", LANES)
    )  # fmt: skip
    widths = {}
    for kernel, scene, number in kernels:
        fresh = jit(kernel.py_func)
        fresh(*engine(at[scene], preset, number).arrays, DT, 1, False)
        found = instructions(assembly(fresh))
        widths[kernel.__name__] = {k: {w: found[k, w] for w in WIDTHS} for k in KINDS[:3]}
    return widths


def _nothing() -> None:
    pass


def _advance(made: TrunkEngine, passes: int, steps: int, kernel: Any = None) -> Timed:
    """A call of so many steps, by another kernel if one is given; each counts as so many passes."""
    made._run = kernel or made._run
    made.advance(steps=1, account=False)
    state = made.get_state()
    work = partial(made.advance, steps=steps, account=False)
    return partial(worked, partial(made.set_state, state), work), passes * steps


def _each(runs: dict[Any, Timed], rounds: int) -> dict[Any, Floats]:
    """Seconds of one of what each run does, interleaved."""
    seconds = interleave({name: run for name, (run, _) in runs.items()}, rounds)
    return {name: seconds[name] / number for name, (_, number) in runs.items()}


def _kernel(lanes: int, legs: int = 0) -> Any:
    """`advance_batch` for other lanes, and a number of legs that the compiler knows if it is given."""

    def advance(data, model, tables, ground, constants, reactions, h, steps, account):  # type: ignore[no-untyped-def]
        number = legs if legs else model[0].legs
        run(data, model, tables, ground, constants, reactions, h, steps, account, number, lanes, False, False)

    return jit(advance)


def _without_idle(made: TrunkEngine) -> TrunkEngine:
    """The engine with memory for its environments alone."""
    column = made._memory.data[:, : made.num_envs]
    made._memory = new_memory(made, made.num_envs)
    made._memory.data[:] = column
    return made


def _with_unaligned_table(made: TrunkEngine, steps: int) -> Timed:
    model, tables, ground = made._model
    room = aligned(tables.size + 2)[2:].reshape(tables.shape)
    room[:] = tables
    made._model = model, room, ground
    return _advance(made, made.num_envs, steps)


def _legs(scene: Scene, count: int) -> Scene:
    """So many legs on the scene's trunk; if it is fixed they do not feel each other."""
    return replace(scene, limbs=scene.limbs[:1] * count, cranks=scene.cranks[:1] * count)


def experiments(preset: str, rounds: int) -> dict[str, dict[str, Any]]:
    """Cost of a leg-step of something that is changed in one respect, over that of the plain one."""
    at = scenes(preset)
    leg, horse = at["leg"], at["horse"]
    high = replace(leg, trunk=replace(leg.trunk, height=leg.trunk.height + 1.0))

    def cost(scene: Scene, number: int, steps: int, kernel: Any = None, **options: Any) -> Timed:
        made = engine(scene, preset, number, **options)
        if kernel:  # whose lanes need not divide what there is
            made = _without_idle(made)
        return _advance(made, number * len(scene.limbs), steps, kernel)

    batch = partial(cost, leg, BATCH)
    bare = _without_idle(engine(leg, preset, BATCH))
    groups = {
        f"{BATCH} legs, 100 steps a call": {
            "plain": batch(100),
            "in the order of their crank angles": batch(100, angles="sorted"),
            "all at one crank angle": batch(100, angles="equal"),
            "in the air": cost(high, BATCH, 100),
            "64 legs": cost(leg, 64, 1600),
            "16384 legs": cost(leg, 16 * BATCH, 100),
            "10 steps a call": batch(10),
            "10 steps a call, rows of memory 8 KiB apart": _advance(bare, BATCH, 10),
            "1 step a call": batch(1),
            "1 step a call, rows of memory 8 KiB apart": _advance(bare, BATCH, 1),
            "2 lanes": batch(100, _kernel(2)),
            "4 lanes": batch(100, _kernel(4)),
            "16 lanes": batch(100, _kernel(16)),
            "two legs on each fixed trunk": cost(_legs(leg, 2), BATCH // 2, 100),
            "table 16 bytes off a whole cache line": _with_unaligned_table(engine(leg, preset, BATCH), 100),
        },
        "one leg": {
            "plain": cost(leg, 1, 5000),
            "in the air": cost(high, 1, 5000),
            "by a kernel for any number of legs": cost(leg, 1, 5000, _kernel(1)),
            "two legs on the fixed trunk": cost(_legs(leg, 2), 1, 5000, _kernel(1, 2)),
            "four legs on the fixed trunk": cost(_legs(leg, 4), 1, 5000, _kernel(1, 4)),
        },
        "one horse": {
            "plain": cost(horse, 1, 1000),
            "legs one after the other": cost(horse, 1, 1000, _kernel(1)),
        },
    }
    seconds = _each(
        {(group, name): run for group, runs in groups.items() for name, run in runs.items()}, rounds
    )
    return {
        group: {
            name: spread(seconds[group, name] / seconds[group, "plain"]) for name in runs if name != "plain"
        }
        for group, runs in groups.items()
    }
