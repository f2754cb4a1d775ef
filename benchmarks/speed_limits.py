"""What limits the batch: its stages one by one, the machine's ceilings, and experiments.

The ceilings are loops of one kind of independent packed operation. What a stage would take if nothing but its
operations, or nothing but its accesses to memory, went at the ceiling says which of the two it is bound by.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numba
import numpy as np
from numba import carray

from benchmarks.speed_cases import BATCH, DT, engine, scenes, worked
from benchmarks.speed_code import KINDS, assembly, packed_and_not, vector_widths
from benchmarks.speed_rounds import interleave, spread
from benchmarks.speed_stages import NOT_FIXED, STAGES, count_stage, fence, filled_tile, stage_loop
from hoof_env._memory import doubles
from hoof_env.dynamics.advance import TILE, advance_batch, run
from hoof_env.dynamics.trunk_engine import TrunkEngine


def _jit(function: Any) -> Any:
    return numba.njit(error_model="numpy")(function)


LANES = 64


@_jit
def _divide(n):  # type: ignore[no-untyped-def]
    x = carray(doubles(LANES), LANES)
    for i in range(LANES):
        x[i] = 1.0 + 0.01 * i
    for _ in range(n):
        for i in range(LANES):
            x[i] = 1.7 / x[i]
    return x[0]


@_jit
def _root(n):  # type: ignore[no-untyped-def]
    x = carray(doubles(LANES), LANES)
    for i in range(LANES):
        x[i] = 1.0 + 0.01 * i
    for _ in range(n):
        for i in range(LANES):
            x[i] = np.sqrt(x[i] + 2.3)
    return x[0]


@_jit
def _multiply_add(n):  # type: ignore[no-untyped-def]
    x = carray(doubles(LANES), LANES)
    for i in range(LANES):
        x[i] = 1.0 + 0.01 * i
    for _ in range(n):
        for i in range(LANES):
            y = x[i]
            for _ in range(8):
                y = y * 0.7 + 0.3
            x[i] = y
    return x[0]


@_jit
def _copy(n):  # type: ignore[no-untyped-def]
    rows = doubles(32 * LANES)
    x = carray(rows, (32, LANES))
    for k in range(32):
        for i in range(LANES):
            x[k, i] = 1.0 * i
    for _ in range(n):
        fence(rows)
        for k in range(16):
            for i in range(LANES):
                x[k, i] = x[16 + k, i]
    return x[0, 0]


# name: (loop, elements for each turn)
CEILINGS: dict[str, tuple[Any, int]] = {
    "divisions": (_divide, LANES),
    "square_roots": (_root, LANES),
    "arithmetic": (_multiply_add, 16 * LANES),
    "accesses": (_copy, 2 * 16 * LANES),
}
"""Loops that do nothing but one kind of operation; a copy in the nearest cache is one load and one store."""


def _kernel(tile: int, legs: int) -> Any:
    def advance(arrays, model, h, steps, account):  # type: ignore[no-untyped-def]
        run(arrays, model, h, steps, account, legs, tile, False)

    return numba.njit(error_model="numpy")(advance)


def limits(preset: str, quick: bool, rounds: int) -> dict[str, Any]:
    """Vector width, ceilings, stages of the leg on a fixed trunk and of the horse, and experiments."""
    at = scenes(preset)
    result: dict[str, Any] = {} if quick else _vectors(engine(at["leg"], preset, TILE))
    turns, steps = (200, 10) if quick else (20000, 40)
    runs: dict[str, Callable[[], float]] = {
        f"ceiling {name}": partial(worked, _nothing, partial(loop, turns))
        for name, (loop, _) in CEILINGS.items()
    }
    found: dict[str, dict[str, Counter[str]]] = {}
    for scene in () if quick else ("leg", "horse"):
        made, found[scene] = engine(at[scene], preset, TILE), {}
        tile = filled_tile(made)
        for name, (stage, _, _) in STAGES.items():
            if name not in NOT_FIXED or made.trunk.kind != "fixed":
                found[scene][name] = count_stage(name, made)
                loop = stage_loop(stage, len(made.limbs))
                work = partial(loop, *tile, made._model, 1e-6, turns // 20)
                runs[f"{scene} {name}"] = partial(worked, _nothing, work)
        runs[f"{scene} whole"] = _whole(engine(at[scene], preset, BATCH), steps)
    seconds = interleave(runs, rounds)
    rates = {name: per * turns / seconds[f"ceiling {name}"] for name, (_, per) in CEILINGS.items()}
    result["ceilings_per_s"] = {name: spread(rate) for name, rate in rates.items()}
    result["stages"] = {}
    for scene, counts in found.items():
        whole, rows = seconds[f"{scene} whole"] / (BATCH * steps), {}
        for name, count in counts.items():
            cost = seconds[f"{scene} {name}"] / (turns // 20 * TILE) * STAGES[name][1]
            rows[name] = dict(count) | {
                "ns": 1e9 * float(np.median(cost)),
                "share": float(np.median(cost / whole)),
            }
        total = {k: sum(row[k] for row in rows.values()) for k in KINDS}
        need = {k: total[k] / rates[k] / whole for k in KINDS}
        result["stages"][scene] = {
            "whole_ns": spread(whole * 1e9), "rows": rows, "total": total,
            "division_share": spread(need["divisions"] + need["square_roots"]),
            "arithmetic_share": spread(need["arithmetic"]), "access_share": spread(need["accesses"]),
        }  # fmt: skip
    result["experiments"] = {} if quick else experiments(preset, rounds)
    return result


def _vectors(made: TrunkEngine) -> dict[str, Any]:
    """Widths in the code of the batch kernel; one from the cache has no code to look at."""
    fresh = _jit(advance_batch.py_func)
    fresh(made._arrays, made._model, DT, 1, False)
    code = assembly(fresh)
    return {"vector_instructions": vector_widths(code)} | packed_and_not(code)


def _nothing() -> None:
    pass


def _whole(made: TrunkEngine, steps: int) -> Callable[[], float]:
    made.advance(steps=1, account=False)
    state = made.get_state()
    return partial(worked, partial(made.set_state, state), partial(made.advance, steps=steps, account=False))


def experiments(preset: str, rounds: int) -> dict[str, Any]:
    """Cost per leg-step of a batch of legs that is changed in one respect, over that of the plain one."""
    leg, steps = scenes(preset)["leg"], 40
    high = leg.trunk.height + 1.0
    aloft = replace(leg, trunk=replace(leg.trunk, height=high))
    plain = engine(leg, preset, BATCH)
    runs = {
        "plain": (_whole(plain, steps), BATCH * steps),
        "all at one crank angle": (_whole(engine(leg, preset, BATCH, spread=False), steps), BATCH * steps),
        "in the air": (_whole(engine(aloft, preset, BATCH), steps), BATCH * steps),
        "64 environments": (_whole(engine(leg, preset, 64), 16 * steps), BATCH * steps),
        "16384 environments": (_whole(engine(leg, preset, 16 * BATCH), steps), 16 * BATCH * steps),
    }
    for tile in (8, 16, 64, 128):
        if tile != TILE:
            made = engine(leg, preset, BATCH)
            kernel, state = _kernel(tile, 1), made.get_state()
            work = partial(kernel, made._arrays, made._model, DT, steps, False)
            work()
            made.set_state(state)
            runs[f"tiles of {tile}"] = partial(worked, partial(made.set_state, state), work), BATCH * steps
    seconds = interleave({name: r for name, (r, _) in runs.items()}, rounds)
    base = seconds["plain"] / runs["plain"][1]
    return {
        name: spread(seconds[name] / units / base) for name, (_, units) in runs.items() if name != "plain"
    }
