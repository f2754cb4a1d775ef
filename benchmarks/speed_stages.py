"""The stages of the batch kernel one by one: loops that time each, and counts of what each does.

The counts come from the machine code that the compiler makes of a stage for one lane, with both sides of
every selection, as vector code has them.
"""

from __future__ import annotations

from collections import Counter
from functools import cache
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import carray
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from benchmarks.speed_code import assembly, count_operations
from hoof_env._jit import inlined
from hoof_env._memory import address, doubles
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.advance import TILE, Model, inner, load
from hoof_env.dynamics.lanes import (
    accelerate_crank,
    accelerate_trunk,
    clear_trunk,
    evaluate,
    feel_leg,
    gather_leg,
    load_trunk,
    look_up_functions,
    move_trunk,
    place_frame,
)
from hoof_env.dynamics.lanes_ground import clear_ground, meet_ground, push_back, remember_contacts
from hoof_env.dynamics.lanes_report import ACCOUNT
from hoof_env.dynamics.lanes_time import begin_step, bend_filters, end_step, next_stage, weigh_stage
from hoof_env.dynamics.trunk import FIXED, TRUNKS
from hoof_env.dynamics.trunk_engine import TrunkEngine
from hoof_env.ground.exact_math import EXPONENT_UNIT
from hoof_env.ground.friction import FRICTION_LAWS

# The stages, all called as stage(trunk, limbs, model, h).


@inlined
def _none(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    pass


@inlined
def _look_up(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        look_up_functions(trunk, limbs[i], model.tables, model.cells)


@inlined
def _place(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        place_frame(trunk, limbs[i], h)


@inlined
def _clear(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    clear_trunk(trunk, model.kind)


@inlined
def _gather(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        gather_leg(trunk, limbs[i], model.together)


@inlined
def _move(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    move_trunk(trunk, model.kind)


@inlined
def _meet(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        for point in range(2):
            meet_ground(trunk, limbs[i], point, model)


@inlined
def _push(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        clear_ground(limbs[i])
        for point in range(2):
            push_back(trunk, limbs[i], point, model)


@inlined
def _feel(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        feel_leg(trunk, limbs[i], h)


@inlined
def _load(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        load_trunk(trunk, limbs[i], model.kind, model.together)


@inlined
def _solve(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    accelerate_trunk(trunk, model.kind)


@inlined
def _turn(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        accelerate_crank(trunk, limbs[i])


@inlined
def _remember(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    for i in range(limbs.shape[0]):
        remember_contacts(limbs[i])


@inlined
def _filters(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    bend_filters(limbs, model.settings)


@inlined
def _begin(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    begin_step(trunk, limbs, model)


@inlined
def _weigh(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    weigh_stage(trunk, limbs, model, 0.5)


@inlined
def _next(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    next_stage(trunk, limbs, model, h)


@inlined
def _end(trunk, limbs, model, h):  # type: ignore[no-untyped-def]
    end_step(trunk, limbs, model, h)


LEG, TRUNK, BOTH = "leg", "trunk", "both"
STAGES: dict[str, tuple[Any, int, str]] = {
    "look up the leg's functions": (_look_up, 2, LEG),
    "place the frame": (_place, 2, LEG),
    "clear the trunk": (_clear, 2, TRUNK),
    "gather the legs": (_gather, 2, LEG),
    "move the trunk": (_move, 2, TRUNK),
    "meet the ground": (_meet, 2, LEG),
    "push back": (_push, 2, LEG),
    "feel the leg": (_feel, 2, LEG),
    "load the trunk": (_load, 2, LEG),
    "accelerate the trunk": (_solve, 2, TRUNK),
    "accelerate the crank": (_turn, 2, LEG),
    "remember contacts": (_remember, 1, LEG),
    "bend the filters": (_filters, 1, LEG),
    "begin the step": (_begin, 1, BOTH),
    "weigh the stage": (_weigh, 1, BOTH),
    "next stage": (_next, 1, BOTH),
    "end the step": (_end, 1, BOTH),
}
"""By name: the stage, its calls in a step of midpoint, and whose lanes it works on."""

NOT_FIXED = ("clear the trunk", "gather the legs", "move the trunk", "load the trunk", "accelerate the trunk")


@intrinsic
def fence(context: Any, pointer: Any) -> Any:
    """Let the compiler believe that somebody uses the memory at `pointer` here; it costs nothing."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [values[0].type])
        builder.asm(kind, "", "r,~{memory}", [values[0]], side_effect=True)
        return context.get_dummy_value()

    return types.void(pointer), emit


def filled_tile(made: TrunkEngine) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The rows of trunk and limbs for the first tile of an engine's environments, evaluated."""
    legs, accounts = len(made.limbs), len(ACCOUNT)
    trunk, limbs = np.zeros((t.ROWS, TILE)), np.zeros((legs, b.ROWS, TILE))

    def fill(arrays, model, trunk, limbs):  # type: ignore[no-untyped-def]
        account = carray(doubles(accounts * TILE), (accounts, TILE))
        small = inner(model, doubles(20), False)
        load(arrays, trunk, limbs, account, 0, False)
        bend_filters(limbs, small.settings)
        begin_step(trunk, limbs, small)
        evaluate(trunk, limbs, small, 0.0)

    numba.njit(error_model="numpy")(fill)(made._arrays, made._model, trunk, limbs)
    return trunk, limbs


def stage_loop(stage: Any, legs: int) -> Any:
    """stage(...) n times on a tile: a function of what `filled_tile` gives, the model, h and n."""

    def loop(trunk_rows, limb_rows, model, h, n):  # type: ignore[no-untyped-def]
        at_trunk, at_limbs = doubles(t.ROWS * TILE), doubles(legs * b.ROWS * TILE)
        trunk, limbs = carray(at_trunk, (t.ROWS, TILE)), carray(at_limbs, (legs, b.ROWS, TILE))
        for k in range(trunk.size):
            at_trunk[k] = trunk_rows.flat[k]
        for k in range(limbs.size):
            at_limbs[k] = limb_rows.flat[k]
        small = inner(model, doubles(20), False)
        for _ in range(n):
            fence(at_trunk)
            fence(at_limbs)
            stage(trunk, limbs, small, h)
        fence(at_trunk)
        fence(at_limbs)

    return numba.njit(error_model="numpy")(loop)


def _stage_alone(stage: Any, made: TrunkEngine, kind: int) -> Any:
    """stage(...) once for one lane of one leg, with the settings as constants: its code has no loops."""
    ground, cells = made.ground, made.profiles[0].cells
    eighths, law = int(ground.exponent * EXPONENT_UNIT), FRICTION_LAWS.index(ground.friction_law)
    interpolated = ground.approach == "interpolated"

    def alone(model, h):  # type: ignore[no-untyped-def]
        at_trunk, at_limbs = doubles(t.ROWS), doubles(b.ROWS)
        fixed = Model(
            kind, eighths, law, interpolated, False, False, False, cells, address(model.tables),
            model.settings, model.fractions, model.weights, model.ground_cells, 0.0, 1.0,
        )  # fmt: skip
        fence(at_trunk)
        fence(at_limbs)
        stage(carray(at_trunk, (t.ROWS, 1)), carray(at_limbs, (1, b.ROWS, 1)), fixed, h)
        fence(at_trunk)
        fence(at_limbs)

    return numba.njit(error_model="numpy")(alone)


@cache
def _operations(stage: Any, made: TrunkEngine, kind: int) -> Counter[str]:
    compiled = _stage_alone(stage, made, kind)
    compiled(made._model, 1e-6)
    return count_operations(assembly(compiled))


def _count(stage: Any, made: TrunkEngine, kind: int) -> Counter[str]:
    """What a stage does to one lane of one leg, under a trunk of some kind."""
    found = Counter(_operations(stage, made, kind))
    found.subtract(_operations(_none, made, kind))
    return found


def count_stage(name: str, made: TrunkEngine) -> Counter[str]:
    """What a stage does to one environment in a step, by kind."""
    stage, calls, whose = STAGES[name]
    kind, legs = TRUNKS.index(made.trunk.kind), len(made.limbs)
    found = _count(stage, made, kind)
    if whose == BOTH:
        for _ in range(legs - 1):
            found.update(_count(stage, made, FIXED))
    times = calls * (legs if whose == LEG else 1)
    return Counter({k: times * n for k, n in found.items()})
