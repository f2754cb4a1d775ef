"""The stages of a step one by one: loops that time each, and counts of what each does.

Counts come from the machine code of a stage with the engine's settings as constants, without the loop around
it. Both sides of a branch count, among them the touch-down, which is rare.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from hoof_env.dynamics.lanes_ground import meet_ground, remember_contacts
from hoof_env.dynamics.lanes_time import begin_step, end_step, next_stage, weigh_stage
from llvmlite import ir
from numba import carray  # type: ignore[attr-defined]
from numba.core import types
from numpy.typing import NDArray

from benchmarks.speed_code import assembly, instructions
from hoof_env.dynamics import lanes as m
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.advance import LIMB_ROWS, TRUNK_ROWS, Model, inner, load_limb_rows, load_trunk_rows
from hoof_env.dynamics.trunk_engine import TrunkEngine
from hoof_env.simd import below, rows
from hoof_env.simd.compile import inlined, pasted
from hoof_env.simd.memory import address, doubles, intrinsic


class Stage(NamedTuple):
    """work(trunk, limbs, legs, model, h), its calls in a step of midpoint, whether only trunks that move have
    it."""

    work: Any
    calls: int
    moves: bool = False


def _each(stage: Callable[..., None], calls: int = 2, moves: bool = False) -> Stage:
    """stage(trunk, limb, model, h) for every leg."""
    part = inlined(stage)

    def work(trunk, limbs, legs, model, h):  # type: ignore[no-untyped-def]
        for i in range(legs):
            part(trunk, below(limbs, i * b.ROWS), model, h)

    return Stage(inlined(work), calls, moves)


def _trunk(stage: Callable[..., None]) -> Stage:
    """stage(trunk, kind)."""
    part = inlined(stage)
    return Stage(inlined(lambda trunk, limbs, legs, model, h: part(trunk, model.kind)), 2, True)


def _all(stage: Callable[..., None]) -> Stage:
    return Stage(inlined(stage), 1)


STAGES: dict[str, Stage] = {
    "clear the trunk": _trunk(lambda trunk, kind: m.clear_trunk(trunk, kind)),
    "look up the leg's functions": _each(
        lambda trunk, limb, model, h: m.look_up_functions(trunk, limb, model)
    ),
    "place the frame": _each(lambda trunk, limb, model, h: m.place_frame(trunk, limb, h)),
    "gather the legs": _each(
        lambda trunk, limb, model, h: m.gather_leg(trunk, limb, model.kind, model.together), moves=True
    ),
    "move the trunk": _trunk(lambda trunk, kind: m.move_trunk(trunk, kind)),
    "meet the ground": _each(lambda trunk, limb, model, h: meet_ground(trunk, limb, model)),
    "feel the leg": _each(lambda trunk, limb, model, h: m.feel_leg(trunk, limb, h)),
    "load the trunk": _each(
        lambda trunk, limb, model, h: m.load_trunk(trunk, limb, model.kind, model.together), moves=True
    ),
    "accelerate the trunk": _trunk(lambda trunk, kind: m.accelerate_trunk(trunk, kind)),
    "accelerate the crank": _each(lambda trunk, limb, model, h: m.accelerate_crank(trunk, limb)),
    "remember contacts": _each(lambda trunk, limb, model, h: remember_contacts(limb), calls=1),
    "begin the step": _all(lambda trunk, limbs, legs, model, h: begin_step(trunk, limbs, legs, model)),
    "weigh the stage": _all(lambda trunk, limbs, legs, model, h: weigh_stage(trunk, limbs, legs, model, h)),
    "next stage": _all(lambda trunk, limbs, legs, model, h: next_stage(trunk, limbs, legs, model, h)),
    "end the step": _all(lambda trunk, limbs, legs, model, h: end_step(trunk, limbs, legs, model, h)),
}
"""By name. Of the two stages of midpoint one has no weight."""


@pasted
def _step(trunk, limbs, legs, model, h):  # type: ignore[no-untyped-def]
    m.evaluate(trunk, limbs, legs, model, 0.0)
    for i in range(legs):
        remember_contacts(below(limbs, i * b.ROWS))
    next_stage(trunk, limbs, legs, model, 0.5 * h)
    m.evaluate(trunk, limbs, legs, model, 0.5 * h)
    weigh_stage(trunk, limbs, legs, model, 1.0)
    end_step(trunk, limbs, legs, model, h)
    begin_step(trunk, limbs, legs, model)


STEP = Stage(_step, 1)
"""A step of midpoint in one piece, without the kernels' loop over the stages of any scheme."""


@intrinsic
def fence(context: Any, pointer: Any) -> Any:
    """Let the compiler believe that somebody uses the memory at `pointer` here; it costs nothing."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [values[0].type])
        builder.asm(kind, "", "r,~{memory}", [values[0]], side_effect=True)
        return context.get_dummy_value()

    return types.void(pointer), emit


def jit(function: Any) -> Any:
    """As the kernels, but compiled anew, for code from the cache cannot be looked at."""
    return numba.njit(error_model="numpy")(function)


class Pass:
    """What one pass of the kernels' code works on: so many lanes, environments or the legs of one trunk.

    Args:
        made: an engine with at least that many environments.
        lanes: how many.
        together: the lanes are legs.
    """

    def __init__(self, made: TrunkEngine, lanes: int, together: bool = False) -> None:
        self.made, self.lanes, self.together = made, lanes, together
        self.legs = 1 if together else len(made.limbs)
        _, model, tables, *_ = made.arrays
        self.given = self._filled(), tables, model[0]["settings"].copy()

    def _filled(self) -> NDArray[np.float64]:
        """Rows of trunk and legs, evaluated."""
        lanes, together, legs = self.lanes, self.together, self.legs
        found = np.zeros((t.ROWS + legs * b.ROWS) * lanes)

        def fill(data, model, tables, ground, out):  # type: ignore[no-untyped-def]
            memory = doubles(out.size)
            trunk = rows(memory, lanes)
            limbs, at, row = below(trunk, t.ROWS), address(data), data.shape[1]
            inside = inner(model, tables, ground, doubles(20), together)
            load_trunk_rows(trunk, at, 0, row, 0 if together else 1)
            for i in range(legs):
                first, far = (TRUNK_ROWS + i * LIMB_ROWS) * row, LIMB_ROWS * row if together else 1
                load_limb_rows(below(limbs, i * b.ROWS), at, first, row, far)
            begin_step(trunk, limbs, legs, inside)
            m.evaluate(trunk, limbs, legs, inside, 0.0)
            for k in range(out.size):
                out[k] = memory[k]

        jit(fill)(*self.made.arrays[:4], found)
        return found

    def loop(self, stage: Stage | None, legs: int, again: bool = True) -> Any:
        """The stage n times on these lanes, or once if not `again`: a function of `given`, h and n."""
        work, lanes, together = stage.work if stage else _nothing, self.lanes, self.together
        record = self.made.arrays[1][0]
        kind, eighths, law, cells = (int(record[k]) for k in ("kind", "eighths", "friction_law", "cells"))
        interpolated = bool(record["interpolated"])

        def loop(filled, tables, settings, h, n):  # type: ignore[no-untyped-def]
            memory = doubles(filled.size)
            trunk = rows(memory, lanes)
            limbs = below(trunk, t.ROWS)
            for k in range(filled.size):
                memory[k] = filled[k]
            filters = address(settings)
            fixed = Model(
                kind, eighths, law, interpolated, False, False, False, together, cells, address(tables),
                filters, 2, filters, filters, carray(address(tables), tables.shape), 0.0, 1.0,
            )  # fmt: skip
            for _ in range(n if again else 1):
                fence(memory)
                work(trunk, limbs, legs, fixed, h)
            fence(memory)

        return jit(loop)

    def count(self, stage: Stage) -> Counter[tuple[str, int]]:
        """Instructions of a call of the stage: the trunk's, and a leg's as many times as there are legs."""
        nothing, trunk = self._code(None, 0), self._code(stage, 0)
        one = self._code(stage, 1)
        return Counter(
            {k: trunk[k] - nothing[k] + self.legs * (one[k] - trunk[k]) for k in {*one, *trunk, *nothing}}
        )

    @cache  # noqa: B019 (short-lived)
    def _code(self, stage: Stage | None, legs: int) -> Counter[tuple[str, int]]:
        compiled = self.loop(stage, legs, again=False)
        compiled(*self.given, 1e-6, 1)
        return instructions(assembly(compiled))


@inlined
def _nothing(trunk, limbs, legs, model, h):  # type: ignore[no-untyped-def]
    pass
