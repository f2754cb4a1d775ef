"""The engine's kernels: environments go through a tile, step after step, and come back.

`advance_one_leg`, `advance_four_legs` and `advance_batch` are one function. The first is compiled for one
lane, the second for four that are the legs of one trunk, the third for `TILE` environments side by side. A
tile lives on the stack: of one lane the compiler keeps most in registers, of many each loop becomes vector
code.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import carray

from hoof_env._jit import inlined, kernel, pasted
from hoof_env._memory import address, doubles, offset
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.lanes import evaluate, keep_still
from hoof_env.dynamics.lanes_ground import level_ground, remember_contacts
from hoof_env.dynamics.lanes_reactions import react
from hoof_env.dynamics.lanes_report import ACCOUNT, keep_account, report
from hoof_env.dynamics.lanes_time import begin_step, bend_filters, end_step, next_stage, weigh_stage
from hoof_env.dynamics.reactions import CONSTANTS, OUTPUTS
from hoof_env.dynamics.trunk import FIXED
from hoof_env.leg.profile import WIDTH

TILE = 32
"""Environments side by side: whole vectors, few enough that their rows stay in the nearest cache."""

MOST_STAGES = 4

OK, NOT_FINITE, DEAD_POINT, FALLEN = 0, 1, 3, 4
"""As in `result.Result`."""


class Model(NamedTuple):
    """What does not change while the engine runs, as the kernels take it.

    Attributes:
        kind, eighths, friction_law: of trunk, contact exponent and friction.
        interpolated, is_terrain, new_rates: see `Ground`, `Terrain` and `schemes`.
        together: the lanes of a tile are the legs of one trunk; the kernels set it.
        cells, tables: cells of a leg's table; all tables, one after the other, shape (rows, coefficients).
        settings: of the filters, shape (4, 3).
        fractions, weights: of the scheme, shapes (stages - 1,) and (stages,).
        ground_cells, ground_origin, ground_per_metre: the terrain's grid.
    """

    kind: int
    eighths: int
    friction_law: int
    interpolated: bool
    is_terrain: bool
    new_rates: bool
    together: bool
    cells: int
    tables: Any
    settings: Any
    fractions: Any
    weights: Any
    ground_cells: Any
    ground_origin: float
    ground_per_metre: float


class Arrays(NamedTuple):
    """The engine's arrays; the last axis is the environment.

    Attributes:
        trunk, limbs: the state, shapes (7, n) and (legs, 16, n).
        trunk_settings, limb_settings: parameters, shapes (17, n) and (legs, 11, n).
        command: shape (legs, 4, n).
        account: shape (9, n), added to.
        trunk_report, limb_report: at the end, shapes (8, n) and (legs, 18, n).
        result: how it ended, shape (n,); where it is not OK the state is left as it was.
        constants, reactions: of `reactions`, shapes (legs, CONSTANTS) and (legs, OUTPUTS, n); the latter is
            filled by the kernels that react.
    """

    trunk: Any
    limbs: Any
    trunk_settings: Any
    limb_settings: Any
    command: Any
    account: Any
    trunk_report: Any
    limb_report: Any
    result: Any
    constants: Any
    reactions: Any


@inlined
def inner(model, small, together):  # type: ignore[no-untyped-def]
    """The same model with its small arrays in `small`, on the stack, and a pointer to the large one."""
    stages = model.weights.shape[0]
    settings = carray(small, (4, 3))
    for k in range(4):
        for j in range(3):
            settings[k, j] = model.settings[k, j]
    weights, fractions = carray(offset(small, 12), (stages,)), carray(offset(small, 16), (stages,))
    for j in range(stages):
        weights[j] = model.weights[j]
        fractions[j] = model.fractions[j] if j < stages - 1 else 1.0
    cells = model.ground_cells
    return Model(
        model.kind, model.eighths, model.friction_law, model.interpolated, model.is_terrain, model.new_rates,
        together, model.cells, address(model.tables), settings, fractions, weights,
        carray(address(cells), cells.shape), model.ground_origin, model.ground_per_metre,
    )  # fmt: skip


@pasted
def load(arrays, trunk, limbs, account, n, together):  # type: ignore[no-untyped-def]
    """Fill a tile with environments n, n + 1, ..., the last one repeated if need be, or with n alone."""
    last = arrays.result.shape[0] - 1
    for lane in range(trunk.shape[1]):
        e = n if together else min(n + lane, last)
        for k in range(len(t.STATE)):
            trunk[k, lane] = arrays.trunk[k, e]
        for k in range(len(t.PARAMETERS)):
            trunk[t.TOTAL_MASS + k, lane] = arrays.trunk_settings[k, e]
        for k in range(len(ACCOUNT)):
            account[k, lane] = 0.0
        for i in range(limbs.shape[0]):
            leg = lane if together else i
            for k in range(len(b.STATE)):
                limbs[i, k, lane] = arrays.limbs[leg, k, e]
            for k in range(len(b.PARAMETERS)):
                limbs[i, b.HIP_ON_TRUNK + k, lane] = arrays.limb_settings[leg, k, e]
            for k in range(4):
                limbs[i, b.COMMAND + k, lane] = arrays.command[leg, k, e]
    for k in range(t.MOVING):
        for lane in range(trunk.shape[1]):
            trunk[t.NOW + k, lane] = trunk[t.FIRST + k, lane]
    keep_still(trunk)
    for i in range(limbs.shape[0]):
        level_ground(limbs[i])


@inlined
def judge(trunk, limbs, model, first, lanes):  # type: ignore[no-untyped-def]
    """How the environment in `lanes` lanes from `first` on ended, one of `result.Result`."""
    total, stuck = 0.0, 0.0
    for lane in range(first, first + lanes):
        stuck += trunk[t.STUCK, lane]
        for k in range(len(t.STATE)):
            total += trunk[k, lane]
        for i in range(limbs.shape[0]):
            for k in range(len(b.STATE)):
                total += limbs[i, k, lane]
            total += limbs[i, b.SPIN_RATE, lane]
    if total - total != 0.0:
        return DEAD_POINT if stuck > 0.0 else NOT_FINITE
    if model.kind != FIXED and trunk[t.PLACE + 1, first] < trunk[t.BOTTOM, first]:
        return FALLEN
    return OK


@pasted
def store(arrays, model, trunk, limbs, account, n, envs):  # type: ignore[no-untyped-def]
    """Write back the environments that ended well, and how each ended."""
    lanes = trunk.shape[1] if model.together else 1
    for e in range(envs):
        result = judge(trunk, limbs, model, e, lanes)
        arrays.result[n + e] = result
        if result == OK:
            for k in range(len(t.STATE)):
                arrays.trunk[k, n + e] = trunk[k, e]
            for k in range(len(ACCOUNT)):
                arrays.account[k, n + e] += account[k, e]
            for lane in range(lanes):
                for i in range(limbs.shape[0]):
                    leg = lane if model.together else i
                    for k in range(len(b.STATE)):
                        arrays.limbs[leg, k, n + e] = limbs[i, k, e + lane]


@pasted
def run_tile(model, trunk, limbs, account, scratch, h, steps, keeps_account, evaluated):  # type: ignore[no-untyped-def]
    """Advance what is in the tile by `steps` of `h` [s] and evaluate it there; `evaluated` if it is now."""
    stages = model.weights.shape[0]
    stage, elapsed = 0, 0.0
    bend_filters(limbs, model.settings)
    begin_step(trunk, limbs, model)
    for turn in range(steps * stages + 1):
        if turn > 0 or not evaluated:
            evaluate(trunk, limbs, model, scratch, elapsed)
        if stage == 0:
            for i in range(limbs.shape[0]):
                remember_contacts(limbs[i])
        if turn < steps * stages:
            if keeps_account:
                keep_account(trunk, limbs, model, account, h * model.weights[stage])
            weigh_stage(trunk, limbs, model, model.weights[stage])
            elapsed = model.fractions[stage] * h
            stage += 1
            if stage < stages:
                next_stage(trunk, limbs, model, elapsed)
            else:
                end_step(trunk, limbs, model, h)
                bend_filters(limbs, model.settings)
                begin_step(trunk, limbs, model)
                stage, elapsed = 0, 0.0


@pasted
def run(arrays, model, h, steps, keeps_account, legs, tile, together):  # type: ignore[no-untyped-def]
    """Advance all environments, a tile at a time: `tile` of them, or one whose legs are the lanes."""
    trunk = carray(doubles(t.ROWS * tile), (t.ROWS, tile))
    limbs = carray(doubles(legs * b.ROWS * tile), (legs, b.ROWS, tile))
    account = carray(doubles(len(ACCOUNT) * tile), (len(ACCOUNT), tile))
    scratch = doubles(2 * WIDTH)
    small = inner(model, doubles(12 + 2 * MOST_STAGES), together)
    count, envs = arrays.result.shape[0], 1 if together else tile
    for n in range(0, count, envs):
        load(arrays, trunk, limbs, account, n, together)
        run_tile(small, trunk, limbs, account, scratch, h, steps, keeps_account, False)
        here = min(envs, count - n)
        report(trunk, limbs, together, arrays.trunk_report, arrays.limb_report, n, here)
        store(arrays, small, trunk, limbs, account, n, here)


@pasted
def run_reacting(arrays, model, h, steps, keeps_account, legs, tile, together):  # type: ignore[no-untyped-def]
    """`run` with the joint reactions of every step; those of the last are kept."""
    trunk = carray(doubles(t.ROWS * tile), (t.ROWS, tile))
    limbs = carray(doubles(legs * b.ROWS * tile), (legs, b.ROWS, tile))
    account = carray(doubles(len(ACCOUNT) * tile), (len(ACCOUNT), tile))
    constants = carray(doubles(legs * CONSTANTS * tile), (legs, CONSTANTS, tile))
    found = carray(doubles(legs * OUTPUTS * tile), (legs, OUTPUTS, tile))
    scratch = doubles(2 * WIDTH)
    small = inner(model, doubles(12 + 2 * MOST_STAGES), together)
    count, envs = arrays.result.shape[0], 1 if together else tile
    for i in range(legs):
        for lane in range(tile):
            for k in range(CONSTANTS):
                constants[i, k, lane] = arrays.constants[lane if together else i, k]
    for n in range(0, count, envs):
        load(arrays, trunk, limbs, account, n, together)
        for step in range(max(steps, 1)):
            run_tile(small, trunk, limbs, account, scratch, h, min(steps, 1), keeps_account, step > 0)
            for i in range(legs):
                react(trunk, limbs[i], constants[i], found[i])
        here = min(envs, count - n)
        report(trunk, limbs, together, arrays.trunk_report, arrays.limb_report, n, here)
        store(arrays, small, trunk, limbs, account, n, here)
        for i in range(legs):
            for k in range(OUTPUTS):
                for lane in range(tile if together else here):
                    if together:
                        arrays.reactions[lane, k, n] = found[i, k, lane]
                    else:
                        arrays.reactions[i, k, n + lane] = found[i, k, lane]


@kernel
def advance_one_leg(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """Each environment by itself; they have one leg."""
    run(arrays, model, h, steps, keeps_account, 1, 1, False)


@kernel
def advance_four_legs(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """Each environment by itself; they have four legs, side by side."""
    run(arrays, model, h, steps, keeps_account, 1, 4, True)


@kernel
def advance_batch(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """`TILE` environments at a time, with any number of legs."""
    run(arrays, model, h, steps, keeps_account, arrays.limbs.shape[0], TILE, False)


@kernel
def react_one_leg(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """`advance_one_leg` with reactions."""
    run_reacting(arrays, model, h, steps, keeps_account, 1, 1, False)


@kernel
def react_four_legs(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """`advance_four_legs` with reactions."""
    run_reacting(arrays, model, h, steps, keeps_account, 1, 4, True)


@kernel
def react_batch(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """`advance_batch` with reactions."""
    run_reacting(arrays, model, h, steps, keeps_account, arrays.limbs.shape[0], TILE, False)
