"""The engine's kernels: environments come from the engine's memory, go step after step, and go back.

`advance_leg`, `advance_four` and `advance_batch` are one function, compiled for one leg alone, for four lanes
that are the legs of one trunk, and for `LANES` environments side by side with any number of legs; `react_leg`
and so on are the same with joint reactions, a fifth more to compile. What they work on lives on the stack,
where the compiler keeps what it can in registers.

An engine's memory is one matrix `data`, a column for each environment: the rows of the trunk, then those of
each leg, as `TRUNK` and `LIMB` have them.
"""

from __future__ import annotations

from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.lanes import evaluate, keep_still, settle
from hoof_env.dynamics.lanes_ground import level_ground, remember_contacts
from hoof_env.dynamics.lanes_reactions import react
from hoof_env.dynamics.lanes_report import (
    ACCOUNT,
    LIMB_REPORT,
    TRUNK_REPORT,
    keep_account,
    report_leg,
    report_trunk,
)
from hoof_env.dynamics.lanes_strides import count_stride, forget_sums
from hoof_env.dynamics.lanes_time import begin_step, end_step, next_stage, weigh_stage
from hoof_env.dynamics.reactions import CONSTANTS, OUTPUTS
from hoof_env.dynamics.trunk import FIXED
from hoof_env.dynamics.vectors import put, vector
from hoof_env.simd import anywhere, below, choose, fill, lane_sum, level, read, rows, write
from hoof_env.simd.compile import inlined, kernel, pasted
from hoof_env.simd.memory import address, doubles, offset

LANES = 8
"""Environments side by side in a batch: one vector of 512 bits."""

OK, NOT_FINITE, DEAD_POINT, FALLEN = 0, 1, 3, 4
"""As in `result.Result`."""

STARTS = -1.0
"""Stands in the place of a result where an environment is to start."""


def _blocks(**sizes: int) -> dict[str, slice]:
    """Consecutive rows by name."""
    ends = accumulate(sizes.values(), initial=0)
    return {name: slice(*pair) for name, pair in zip(sizes, pairwise(ends), strict=True)}


TRUNK = _blocks(
    state=len(t.STATE), settings=len(t.PARAMETERS), account=len(ACCOUNT), report=len(TRUNK_REPORT), result=1
)
LIMB = _blocks(
    state=len(b.STATE), strides=len(b.STRIDES), stride_sums=len(b.STRIDE_SUMS), command=4,
    settings=len(b.PARAMETERS), report=len(LIMB_REPORT),
)  # fmt: skip
"""Rows of `data`: the engine's state and settings, what it was told, and what it tells."""

TRUNK_ROWS, LIMB_ROWS = TRUNK["result"].stop, LIMB["report"].stop
TRUNK_STATES, TRUNK_SETTINGS, ACCOUNTS = len(t.STATE), len(t.PARAMETERS), len(ACCOUNT)
LIMB_STATES, LIMB_KEPT, LIMB_SETTINGS = len(b.STATE), len(b.STATE + b.STRIDES), len(b.PARAMETERS)
LIMB_STORED = LIMB_KEPT + len(b.STRIDE_SUMS)
AT_SETTINGS, AT_ACCOUNT, AT_REPORT, AT_RESULT = (block.start for block in list(TRUNK.values())[1:])
AT_COMMAND, AT_LIMB_SETTINGS, AT_LIMB_REPORT = (block.start for block in list(LIMB.values())[3:])

MODEL = np.dtype(
    [
        ("legs", "i8"), ("cells", "i8"),  # how many; cells of a leg's table
        ("kind", "i8"), ("eighths", "i8"), ("friction_law", "i8"),  # of trunk, contact exponent, friction
        ("interpolated", "?"), ("is_terrain", "?"), ("new_rates", "?"),  # see `Ground`, `Terrain`, `schemes`
        ("strides", "?"),  # whether to count them
        ("stages", "i8"), ("fractions", "f8", (4,)), ("weights", "f8", (4,)),  # of the scheme
        ("settings", "f8", (12,)),  # of the filters
        ("ground_origin", "f8"), ("ground_per_metre", "f8"),  # of the terrain's grid
    ],
    align=True,
)  # fmt: skip
"""What does not change while the engine runs, but for large arrays."""


class Model(NamedTuple):
    """`MODEL` inside the kernels, small arrays on the stack, with the large ones.

    Attributes:
        together: the lanes are the legs of one trunk.
        tables: pointer to the tables of all legs, one after the other.
        settings, fractions, weights: pointers.
        ground_cells: of the terrain's grid.
    """

    kind: int
    eighths: int
    friction_law: int
    interpolated: bool
    is_terrain: bool
    new_rates: bool
    strides: bool
    together: bool
    cells: int
    tables: Any
    settings: Any
    stages: int
    fractions: Any
    weights: Any
    ground_cells: Any
    ground_origin: float
    ground_per_metre: float


@inlined
def inner(model, tables, ground, small, together):  # type: ignore[no-untyped-def]
    """The model from its record and arrays; `small` points to room for 20 doubles."""
    given = model[0]
    for k in range(12):
        small[k] = given.settings[k]
    for k in range(4):
        small[12 + k], small[16 + k] = given.fractions[k], given.weights[k]
    return Model(
        given.kind, given.eighths, given.friction_law, given.interpolated, given.is_terrain, given.new_rates,
        given.strides, together, given.cells, address(tables),
        small, given.stages, offset(small, 12), offset(small, 16),
        carray(address(ground), ground.shape), given.ground_origin, given.ground_per_metre,
    )  # fmt: skip


@inlined
def load_trunk_rows(trunk, data, n, row, stride):  # type: ignore[no-untyped-def]
    """State and settings of environments n, n + stride, ..."""
    fill(trunk, 0, TRUNK_STATES, data, n, row, stride)
    fill(trunk, t.TOTAL_MASS, TRUNK_SETTINGS, data, n + AT_SETTINGS * row, row, stride)
    keep_still(trunk)


@inlined
def load_limb_rows(limb, data, start, row, stride):  # type: ignore[no-untyped-def]
    """State, command and settings of a leg, whose rows begin at `start`."""
    fill(limb, 0, LIMB_KEPT, data, start, row, stride)
    forget_sums(limb)
    fill(limb, b.COMMAND, 4, data, start + AT_COMMAND * row, row, stride)
    fill(limb, b.HIP_ON_TRUNK, LIMB_SETTINGS, data, start + AT_LIMB_SETTINGS * row, row, stride)
    put(limb, b.HIP, vector(limb, b.HIP_ON_TRUNK))  # stays so unless the trunk pitches
    level_ground(limb)


@inlined
def judge(trunk, limbs, legs, together):  # type: ignore[no-untyped-def]
    """How the environments ended, numbers of `result.Result`."""
    total, stuck = level(trunk, 0.0), trunk[t.STUCK]
    for k in range(TRUNK_STATES):
        total = total + trunk[k]
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        total = total + limb[b.SPIN_RATE]
        for k in range(LIMB_STATES):
            total = total + limb[k]
    if together:
        total, stuck = lane_sum(level(trunk, 0.0), total), lane_sum(level(trunk, 0.0), stuck)
    lost = choose(stuck > 0.0, float(DEAD_POINT), float(NOT_FINITE))
    fell = choose(trunk[t.FELL] > 0.0, float(FALLEN), float(OK))
    return choose((total - total != 0.0) | (stuck > 0.0), lost, fell)


@inlined
def replace(old, new, count, data, start, row, stride, good):  # type: ignore[no-untyped-def]
    """Put `count` rows into memory where they are good."""
    for k in range(count):
        at = start + k * row
        before = read(old, data, at, stride)
        write(choose(good, new[k], before), data, at, stride)


@pasted
def run_steps(trunk, limbs, legs, model, account, constants, found, h, steps, keeps_account, reacts):  # type: ignore[no-untyped-def]
    """Advance by `steps` of `h` [s] and evaluate there."""
    stage, elapsed = 0, 0.0
    begin_step(trunk, limbs, legs, model)
    for turn in range(steps * model.stages + 1):
        evaluate(trunk, limbs, legs, model, elapsed)
        if stage == 0:
            for i in range(legs):
                limb = below(limbs, i * b.ROWS)
                remember_contacts(limb)
                if model.strides and turn > 0:
                    count_stride(trunk, limb, h)
                if reacts and (turn > 0 or steps == 0):
                    react(trunk, limb, below(constants, i * CONSTANTS), below(found, i * OUTPUTS))
        if turn < steps * model.stages:
            weight = model.weights[stage]
            if keeps_account:
                keep_account(trunk, limbs, legs, model, account, h * weight)
            weigh_stage(trunk, limbs, legs, model, weight)
            elapsed = model.fractions[stage] * h
            stage += 1
            if stage < model.stages:
                next_stage(trunk, limbs, legs, model, elapsed)
            else:
                end_step(trunk, limbs, legs, model, h)
                begin_step(trunk, limbs, legs, model)
                stage, elapsed = 0, 0.0


@pasted
def run(  # type: ignore[no-untyped-def]
    data, model, tables, ground, constants, reactions, h, steps, keeps_account, legs, lanes, together, reacts
):
    """Advance all environments: `lanes` at a time, or one whose legs the lanes are. With `steps` below 0
    those start whose result is `STARTS`. Unless `reacts`, a constant, no code for reactions is made."""
    trunk = rows(doubles(t.ROWS * lanes), lanes)
    limbs = rows(doubles(legs * b.ROWS * lanes), lanes)
    account = rows(doubles(ACCOUNTS * lanes), lanes)
    shape = rows(doubles(legs * CONSTANTS * lanes), lanes)
    found = rows(doubles(legs * OUTPUTS * lanes), lanes)
    inside = inner(model, tables, ground, doubles(20), together)
    at, row = address(data), data.shape[1]
    # lanes are neighbours, but where they are legs, as far apart as legs are
    envs, near, far = lanes, 1, 1
    if together:
        envs, near, far = 1, 0, LIMB_ROWS * row
    if reacts:
        for i in range(legs):
            for k in range(CONSTANTS):
                one = i * CONSTANTS + k
                shape[one] = read(shape, address(constants), one, CONSTANTS if together else 0)
    for n in range(0, row, envs):
        load_trunk_rows(trunk, at, n, row, near)
        for k in range(ACCOUNTS):
            account[k] = 0.0
        for i in range(legs):
            first = (TRUNK_ROWS + i * LIMB_ROWS) * row + n
            load_limb_rows(below(limbs, i * b.ROWS), at, first, row, far)
        before = read(trunk, at, AT_RESULT * row + n, near)
        starts = before == STARTS
        if steps < 0:
            if not anywhere(starts):
                continue
            begin_step(trunk, limbs, legs, inside)
            if inside.kind != FIXED:
                settle(trunk, limbs, legs, inside, starts)
        run_steps(trunk, limbs, legs, inside, account, shape, found, h, max(steps, 0), keeps_account, reacts)
        report_trunk(trunk, at, AT_REPORT * row + n, row, near)
        result = judge(trunk, limbs, legs, together)
        good = result == float(OK)
        if steps < 0:  # the others are as they were; a start that cannot be is kept as it is
            result, good = choose(starts, result, before), starts
        write(result, at, AT_RESULT * row + n, near)
        replace(trunk, trunk, TRUNK_STATES, at, n, row, near, good)
        for k in range(ACCOUNTS):
            place = (AT_ACCOUNT + k) * row + n
            account[k] = account[k] + read(account, at, place, near)
        replace(trunk, account, ACCOUNTS, at, AT_ACCOUNT * row + n, row, near, good)
        for i in range(legs):
            limb, first = below(limbs, i * b.ROWS), (TRUNK_ROWS + i * LIMB_ROWS) * row + n
            report_leg(trunk, limb, at, first + AT_LIMB_REPORT * row, row, far)
            replace(trunk, limb, LIMB_STORED, at, first, row, far, good)
            if reacts:
                for k in range(OUTPUTS):
                    place = (i * OUTPUTS + k) * row + n
                    write(found[i * OUTPUTS + k], address(reactions), place, OUTPUTS * row if together else 1)


@kernel
def advance_leg(data, model, tables, ground, constants, reactions, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """Each environment by itself; they have one leg."""
    run(data, model, tables, ground, constants, reactions, h, steps, keeps_account, 1, 1, False, False)


@kernel
def advance_four(data, model, tables, ground, constants, reactions, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """Each environment by itself; they have four legs, side by side."""
    run(data, model, tables, ground, constants, reactions, h, steps, keeps_account, 1, 4, True, False)


@kernel
def advance_batch(data, model, tables, ground, constants, reactions, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """`LANES` environments at a time, with any number of legs."""
    legs = model[0].legs
    run(data, model, tables, ground, constants, reactions, h, steps, keeps_account, legs, LANES, False, False)


@kernel
def react_leg(data, model, tables, ground, constants, reactions, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """As `advance_leg`, with joint reactions."""
    run(data, model, tables, ground, constants, reactions, h, steps, keeps_account, 1, 1, False, True)


@kernel
def react_four(data, model, tables, ground, constants, reactions, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """As `advance_four`, with joint reactions."""
    run(data, model, tables, ground, constants, reactions, h, steps, keeps_account, 1, 4, True, True)


@kernel
def react_batch(data, model, tables, ground, constants, reactions, h, steps, keeps_account):  # type: ignore[no-untyped-def]
    """As `advance_batch`, with joint reactions."""
    legs = model[0].legs
    run(data, model, tables, ground, constants, reactions, h, steps, keeps_account, legs, LANES, False, True)
