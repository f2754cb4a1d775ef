"""The engine's kernels: environments go through a tile, step after step, and come back.

`advance_one_leg`, `advance_one` and `advance_batch` are one function, compiled for one leg of one environment, for
several legs of one, and for `TILE` environments at a time. A tile lives on the stack: for one leg of one
environment the compiler keeps most of it in registers, for a batch each loop over its lanes is vector code.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import carray

from hoof_env._jit import inlined, kernel
from hoof_env._memory import address, doubles, offset
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.lanes import evaluate, keep_still
from hoof_env.dynamics.lanes_ground import level_ground, remember_contacts
from hoof_env.dynamics.lanes_report import ACCOUNT, keep_account, report
from hoof_env.dynamics.lanes_time import begin_step, bend_filters, end_step, next_stage, weigh_stage
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
        tables: shape (profiles * cells, coefficients); `first` the row where each leg's begins, shape (legs,).
        motors: 1 for each leg with a motor, shape (legs,).
        settings: of the filters, shape (4, 3).
        fractions, weights: of the scheme.
        ground_cells, ground_origin, ground_per_metre: the terrain's grid.
    """

    kind: int
    eighths: int
    friction_law: int
    interpolated: bool
    is_terrain: bool
    new_rates: bool
    cells: int
    tables: Any
    first: Any
    motors: Any
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
        trunk_settings, limb_settings: parameters, shapes (16, n) and (legs, 9, n).
        command: shape (legs, 4, n).
        account: shape (9, n), added to.
        trunk_report, limb_report: at the end, shapes (8, n) and (legs, 18, n).
        result: how it ended, shape (n,); where it is not OK the state is left as it was.
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


@inlined
def inner(model, legs, small):  # type: ignore[no-untyped-def]
    """The same model with its small arrays in `small`, on the stack, and a pointer to the large one."""
    stages = model.weights.shape[0]
    first, motors = carray(small, (legs,)), carray(offset(small, legs), (legs,))
    for i in range(legs):
        first[i], motors[i] = model.first[i], model.motors[i]
    settings = carray(offset(small, 2 * legs), (4, 3))
    for k in range(4):
        for j in range(3):
            settings[k, j] = model.settings[k, j]
    weights = carray(offset(small, 2 * legs + 12), (stages,))
    fractions = carray(offset(small, 2 * legs + 12 + MOST_STAGES), (stages,))
    for j in range(stages):
        weights[j] = model.weights[j]
        fractions[j] = model.fractions[j] if j < stages - 1 else 1.0
    cells = model.ground_cells
    return Model(
        model.kind, model.eighths, model.friction_law, model.interpolated, model.is_terrain, model.new_rates,
        model.cells, address(model.tables), first, motors, settings, fractions, weights,
        carray(address(cells), cells.shape), model.ground_origin, model.ground_per_metre,
    )  # fmt: skip


@inlined
def load(arrays, trunk, limbs, account, n, last):  # type: ignore[no-untyped-def]
    """Fill a tile with environments n, n + 1, ...; lanes past the last one repeat it."""
    for lane in range(trunk.shape[1]):
        e = min(n + lane, last)
        for k in range(len(t.STATE)):
            trunk[k, lane] = arrays.trunk[k, e]
        for k in range(len(t.PARAMETERS)):
            trunk[t.TOTAL_MASS + k, lane] = arrays.trunk_settings[k, e]
        for k in range(len(ACCOUNT)):
            account[k, lane] = 0.0
        for i in range(limbs.shape[0]):
            for k in range(len(b.STATE)):
                limbs[i, k, lane] = arrays.limbs[i, k, e]
            for k in range(len(b.PARAMETERS)):
                limbs[i, b.HIP_ON_TRUNK + k, lane] = arrays.limb_settings[i, k, e]
            for k in range(4):
                limbs[i, b.COMMAND + k, lane] = arrays.command[i, k, e]
    for k in range(t.MOVING):
        for lane in range(trunk.shape[1]):
            trunk[t.NOW + k, lane] = trunk[t.FIRST + k, lane]
    keep_still(trunk)
    for i in range(limbs.shape[0]):
        level_ground(limbs[i])


@inlined
def judge(trunk, limbs, kind, lane):  # type: ignore[no-untyped-def]
    """How a lane ended, one of `result.Result`."""
    total = 0.0
    for k in range(len(t.STATE)):
        total += trunk[k, lane]
    for i in range(limbs.shape[0]):
        for k in range(len(b.STATE)):
            total += limbs[i, k, lane]
        total += limbs[i, b.SPIN_RATE, lane]
    if total - total != 0.0:
        return DEAD_POINT if trunk[t.STUCK, lane] > 0.0 else NOT_FINITE
    if kind != FIXED and trunk[t.PLACE + 1, lane] < trunk[t.BOTTOM, lane]:
        return FALLEN
    return OK


@inlined
def store(arrays, model, trunk, limbs, account, n, lanes):  # type: ignore[no-untyped-def]
    """Write back the lanes that ended well, and how each ended."""
    for lane in range(lanes):
        result = judge(trunk, limbs, model.kind, lane)
        arrays.result[n + lane] = result
        if result == OK:
            for k in range(len(t.STATE)):
                arrays.trunk[k, n + lane] = trunk[k, lane]
            for k in range(len(ACCOUNT)):
                arrays.account[k, n + lane] += account[k, lane]
            for i in range(limbs.shape[0]):
                for k in range(len(b.STATE)):
                    arrays.limbs[i, k, n + lane] = limbs[i, k, lane]


@inlined
def run_tile(arrays, model, trunk, limbs, account, scratch, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """Advance what is in the tile by `steps` of `h` [s], and evaluate it there."""
    stages = model.weights.shape[0]
    stage, elapsed = 0, 0.0
    bend_filters(limbs, model.settings)
    begin_step(trunk, limbs, model)
    for turn in range(steps * stages + 1):
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


@inlined
def run(arrays, model, h, steps, keeps_account, legs, tile):  # type: ignore[no-untyped-def]
    """Advance all environments, a tile at a time."""
    trunk = carray(doubles(t.ROWS * tile), (t.ROWS, tile))
    limbs = carray(doubles(legs * b.ROWS * tile), (legs, b.ROWS, tile))
    account = carray(doubles(len(ACCOUNT) * tile), (len(ACCOUNT), tile))
    scratch = doubles(2 * WIDTH)
    small = inner(model, legs, doubles(2 * legs + 12 + 2 * MOST_STAGES))
    count = arrays.result.shape[0]
    for n in range(0, count, tile):
        load(arrays, trunk, limbs, account, n, count - 1)
        run_tile(arrays, small, trunk, limbs, account, scratch, h, steps, keeps_account)
        lanes = min(tile, count - n)
        report(trunk, limbs, small, arrays.trunk_report, arrays.limb_report, n, lanes)
        store(arrays, small, trunk, limbs, account, n, lanes)


@kernel
def advance_one_leg(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """Each environment by itself; they have one leg."""
    run(arrays, model, h, steps, keeps_account, 1, 1)


@kernel
def advance_one(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """Each environment by itself."""
    run(arrays, model, h, steps, keeps_account, arrays.limbs.shape[0], 1)


@kernel
def advance_batch(arrays, model, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """`TILE` environments at a time."""
    run(arrays, model, h, steps, keeps_account, arrays.limbs.shape[0], TILE)
