"""Kernels of the engine: load environments from its memory, advance them step after step, store them.

`advance_leg`, `advance_four` and `advance_batch` are one function, that of `advance_of`, compiled for one leg
alone, for four lanes that are the legs of one trunk, and for `LANES` environments side by side with any
number of legs; `react_leg`, `react_four` and `react_batch` also compute joint reactions, and take a fifth
longer to compile. Kernels work on copies on the stack, which the compiler keeps in registers where it can.

An engine's memory is one matrix `data`, a column for each environment: the rows of the trunk, then those of
each leg, fields as in `layout.TrunkMemory` and `LegMemory`. Each kind of engine (`layout.Features`) has
kernels of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from hoof_env.dynamics.form import EngineLayout, engine_layout
from hoof_env.dynamics.hoof import law_of, level_ground, lift_heel, remember_contacts
from hoof_env.dynamics.layout import PLAIN, Features
from hoof_env.dynamics.limits import CHECK_EVERY, check_trunk, clear_limits, joint_check_of
from hoof_env.dynamics.mechanics import evaluate, keep_still
from hoof_env.dynamics.momenta import velocities_to_momenta
from hoof_env.dynamics.observables import count_stride, keep_account, report_leg, report_trunk
from hoof_env.dynamics.parts import FIXED, Result
from hoof_env.dynamics.reactions import reactions_of
from hoof_env.dynamics.stepping import begin_step, end_step, next_stage, weigh_stage
from hoof_env.simd import any_lane, block_at, columns, full_like, lane_sum, load_rows, rows, where
from hoof_env.simd.compile import inline_llvm, inline_source, kernel
from hoof_env.simd.kept import Kept, Kernels
from hoof_env.simd.memory import address, doubles, offset
from hoof_env.simd.reach import fingerprint, refresh

LANES = 8
"""Number of environments side by side in a batch: one vector of 512 bits."""

OK = float(Result.OK)
NOT_FINITE = float(Result.NOT_FINITE)
DEAD_POINT = float(Result.DEAD_POINT)
FALLEN = float(Result.FALLEN)
FIRST_LIMIT = float(Result.PITCH)

RESET_REQUESTED = -1.0
"""Mark in the place of a result: the environment is to be started."""

MODEL = np.dtype(
    [
        ("legs", "i8"),  # number of legs
        ("cells", "f8"),  # number of cells of a leg's table
        ("kind", "i8"),  # of the trunk, position in `parts.TRUNKS`
        ("eighths", "i8"),  # contact exponent times 8
        ("friction_law", "i8"),  # position in `laws.FRICTION_LAWS`
        ("interpolated", "?"),  # the approach speed, see `Ground`
        ("is_terrain", "?"),  # false if level and the same everywhere
        ("new_rates", "?"),  # as are averages, stages, fractions and weights: of the `Scheme`
        ("strides", "?"),  # true if stances are counted
        ("motors", "?"),  # true if any crank has a motor
        ("averages", "?"),
        ("stages", "i8"),
        ("fractions", "f8", (4,)),
        ("weights", "f8", (4,)),
        ("settings", "f8", (12,)),  # of the filters
        ("ground_origin", "f8"),  # of the terrain's grid
        ("ground_per_metre", "f8"),
    ],
    align=True,
)
"""Record type of all settings that stay constant while the engine runs, except large arrays."""


class Model(NamedTuple):
    """Constant settings inside the kernels: the fields of `MODEL` and the large arrays."""

    kind: int
    eighths: int
    friction_law: int
    interpolated: bool
    is_terrain: bool
    new_rates: bool
    strides: bool
    motors: bool
    lanes_are_legs: bool  # the lanes are the legs of one trunk
    form: EngineLayout
    cells: float
    tables: Any  # pointer to the tables of all legs, one after the other
    settings: Any  # of the filters; pointer to memory on the stack, as are fractions and weights
    averages: bool
    stages: int
    fractions: Any
    weights: Any
    ground_cells: Any  # of the terrain's grid
    ground_origin: float
    ground_per_metre: float
    law: Any  # of contact, see `hoof.law_of`


class Joints(NamedTuple):
    """Kernels that belong to the legs' structure: of their reactions, and of their heights."""

    react: Any
    check: Any


@inline_llvm
def unpack_model(model, tables, ground, small, lanes_are_legs, law, form):  # type: ignore[no-untyped-def]
    """Return the `Model` of a record and its arrays; `small` points to room for 8 + 3 form.gait doubles."""
    record = model[0]
    # copied to the stack: the compiler could not rule out that a store to `data` changes the record
    for k in range(4):
        small[k] = record.fractions[k]
        small[4 + k] = record.weights[k]
    settings = offset(small, 8)
    for k in range(12):
        settings[k] = record.settings[k]
    # higher harmonics have the filters of the first
    for k in range(12, 3 * form.gait):
        settings[k] = record.settings[k % 3 + 9]
    return Model(
        record.kind,
        record.eighths,
        record.friction_law,
        record.interpolated,
        record.is_terrain,
        record.new_rates,
        record.strides,
        record.motors,
        lanes_are_legs,
        form,
        record.cells,
        address(tables),
        settings,
        record.averages,
        record.stages,
        small,
        offset(small, 4),
        carray(address(ground), ground.shape),
        record.ground_origin,
        record.ground_per_metre,
        law,
    )


@inline_llvm
def read_trunk(trunk, memory):  # type: ignore[no-untyped-def]
    """Load state and settings from a `TrunkMemory`."""
    load_rows(trunk.state, memory.state)
    load_rows(trunk.settings, memory.settings)
    keep_still(trunk)


@inline_llvm
def read_leg(leg, memory, form):  # type: ignore[no-untyped-def]
    """Load state, command and settings from a `LegMemory`; set the sums to 0."""
    load_rows(leg.state, memory.state)
    load_rows(leg.strides, memory.strides)
    for k in range(form.sums):
        leg.sums[k] = 0.0
    for k in range(form.gait):
        leg.command[k] = memory.command[k]
    load_rows(leg.settings, memory.settings)
    leg.hip = leg.settings.hip_on_trunk  # stays so unless the trunk pitches
    for k in range(form.springs):
        leg.inverse_damping[k] = 1.0 / leg.settings.hoof_damping[k]
    level_ground(leg)
    if form.feet == 1:
        lift_heel(leg, form.springs)


@inline_llvm
def find_result(trunk, legs, leg_count, lanes_are_legs, form):  # type: ignore[no-untyped-def]
    """Return how the environments ended, numbers of `parts.Result`. A number too large to be squared counts
    as not finite."""
    total = full_like(trunk, 0.0)
    stuck = trunk.at_dead_point
    for k in range(form.trunk_state):
        total = total + trunk.state[k] * trunk.state[k]
    for i in range(leg_count):
        leg = block_at(legs, i)
        # a sum for each leg: in one long sum each addition would wait for the one before
        leg_total = leg.theta_acceleration * leg.theta_acceleration
        for k in range(form.leg_state):
            leg_total = leg_total + leg.state[k] * leg.state[k]
        total = total + leg_total
    if lanes_are_legs:
        total = lane_sum(full_like(trunk, 0.0), total)
        stuck = lane_sum(full_like(trunk, 0.0), stuck)
    failure = where(stuck > 0.0, DEAD_POINT, NOT_FINITE)
    ending = where(trunk.fallen > 0.0, FALLEN, OK)
    if form.has_limits:
        ending = where(trunk.fallen > 0.0, FALLEN, trunk.violated_limit[0])
    # total - total is 0 if total is finite, else NaN
    return where((total - total != 0.0) | (stuck > 0.0), failure, ending)


@inline_llvm
def store(memory, rows, count, good):  # type: ignore[no-untyped-def]
    """Store `count` rows in the lanes of memory where `good` holds."""
    for k in range(count):
        memory[k] = where(good, rows[k], memory[k])


@inline_source
def run_steps(  # type: ignore[no-untyped-def]
    trunk, legs, leg_count, model, account, constants, reactions, h, steps, keeps_account, reacts, joints
):
    """Advance by `steps` of `h` [s] and evaluate forces and accelerations at the end."""
    stage = 0
    elapsed = 0.0
    begin_step(trunk, legs, leg_count, model)
    # one loop over all stages of all steps, not two: `evaluate`, which is large, then has a single call
    for turn in range(steps * model.stages + 1):
        evaluate(trunk, legs, leg_count, model, elapsed)
        if stage == 0:
            # counted from the end, so that limits are always checked at the last step
            left = steps * model.stages - turn
            looks = turn > 0 and left % (CHECK_EVERY * model.stages) == 0
            for i in range(leg_count):
                leg = block_at(legs, i)
                remember_contacts(leg)
                if model.strides and turn > 0:
                    count_stride(trunk, leg, model.form, h)
                if reacts and (turn > 0 or steps == 0):
                    joints.react(trunk, leg, block_at(constants, i), block_at(reactions, i))
                if model.form.has_limits and looks:
                    joints.check(trunk, leg, block_at(constants, i), model)
            if model.form.has_limits and looks:
                check_trunk(trunk, model)
        if turn < steps * model.stages:
            weight = model.weights[stage]
            if keeps_account:
                keep_account(trunk, legs, leg_count, model, account, h * weight)
            weigh_stage(trunk, legs, leg_count, model, weight)
            elapsed = model.fractions[stage] * h
            stage += 1
            if stage < model.stages:
                next_stage(trunk, legs, leg_count, model, elapsed)
            else:
                end_step(trunk, legs, leg_count, model, h)
                begin_step(trunk, legs, leg_count, model)
                stage = 0
                elapsed = 0.0


@inline_llvm
def leg_memory_of(at, i, n, row, far, lanes, form):  # type: ignore[no-untyped-def]
    """Return the `LegMemory` of the i-th leg of environment n and, with lanes, of the neighbouring columns or
    legs; `at` is the engine's array, `row` and `far` are distances from row to row and from lane to lane."""
    return columns(at, lanes, form.leg_memory, (form.trunk_rows + i * form.leg_rows) * row + n, row, far)


@inline_source
def load(trunk, legs, leg_count, account, memory, at, n, row, far, lanes, form):  # type: ignore[no-untyped-def]
    """Load the environments from column n on, with an account of 0."""
    read_trunk(trunk, memory)
    if form.has_limits:
        clear_limits(trunk)
    for i in range(leg_count):
        read_leg(block_at(legs, i), leg_memory_of(at, i, n, row, far, lanes, form), form)
    for k in range(form.account_size):
        account[k] = 0.0


@inline_source
def start_motion(trunk, legs, leg_count, model, starts):  # type: ignore[no-untyped-def]
    """Turn the velocities of the environments that start into momenta."""
    begin_step(trunk, legs, leg_count, model)
    if model.kind != FIXED:
        velocities_to_momenta(trunk, legs, leg_count, model, starts)


@inline_source
def store_legs(trunk, legs, leg_count, good, at, n, row, far, lanes, form):  # type: ignore[no-untyped-def]
    """Store reports, and where `good` holds what changes of the legs."""
    for i in range(leg_count):
        leg = block_at(legs, i)
        memory = leg_memory_of(at, i, n, row, far, lanes, form)
        report_leg(trunk, leg, memory.report, form)
        store(memory.state, leg.state, form.leg_state, good)
        store(memory.strides, leg.strides, form.strides, good)
        store(memory.sums, leg.sums, form.sums, good)


@inline_source
def store_reactions(forces, leg_count, reactions, n, row, lanes, lanes_are_legs, form):  # type: ignore[no-untyped-def]
    """Store the joint reactions of all legs."""
    for i in range(leg_count):
        size = form.reactions_size
        stride = size * row if lanes_are_legs else 1
        out = columns(address(reactions), lanes, form.reactions, i * size * row + n, row, stride)
        leg_forces = block_at(forces, i)
        for k in range(size):
            out[k] = leg_forces[k]


@inline_source
def read_shapes(shapes, leg_count, constants, lanes, lanes_are_legs, form):  # type: ignore[no-untyped-def]
    """Load the constants of all legs, which all environments share."""
    stride = form.constants_size if lanes_are_legs else 0
    shared = columns(address(constants), lanes, None, 0, 1, stride)
    for k in range(leg_count * form.constants_size):
        shapes[k] = shared[k]


@inline_source
def judge(trunk, legs, leg_count, before, resets, lanes_are_legs, form):  # type: ignore[no-untyped-def]
    """Return the results of the environments, and where the rows of the kernel are to be stored."""
    result = find_result(trunk, legs, leg_count, lanes_are_legs, form)
    good = result == OK
    if form.has_limits:
        good = good | (result >= FIRST_LIMIT)  # a motion beyond a limit is a motion
    if resets:
        # a reset writes the started lanes only, even where the start is infeasible
        good = before == RESET_REQUESTED
        result = where(good, result, before)
    return result, good


@inline_source
def store_trunk(trunk, account, memory, good, keeps_account, form):  # type: ignore[no-untyped-def]
    """Store the report, and where `good` holds what changes of the trunk."""
    report_trunk(trunk, memory.report)
    store(memory.state, trunk.state, form.trunk_state, good)
    if keeps_account:
        for k in range(form.account_size):
            account[k] = account[k] + memory.account[k]
        store(memory.account, account, form.account_size, good)


def advance_of(
    legs: int, lanes: int, lanes_are_legs: bool, reacts: bool, law: Any, form: EngineLayout, joints: Joints
) -> Callable[..., None]:
    """Return the function of a kernel, which advances environments `begin` to `end` by substeps of h [s]; if
    their number is negative, environments with the result `RESET_REQUESTED` are started.

    Args:
        legs: number of legs, 0 for any.
        lanes: number of environments side by side or, if `lanes_are_legs`, of legs of one environment.
        reacts: false for a kernel without code for joint reactions.
        law, form, joints: law of contact (`hoof.law_of`), engine's layouts, kernels of the legs' structure.
    """

    def advance(  # type: ignore[no-untyped-def]
        data, model, tables, ground, constants, reactions, h, steps, keeps_account, begin, end
    ):
        leg_count = legs if legs else model[0].legs
        trunk = rows(doubles(form.trunk_size * lanes), lanes, form.trunk)
        of_legs = rows(doubles(leg_count * form.leg_size * lanes), lanes, form.leg)
        account = rows(doubles(form.account_size * lanes), lanes, form.account)
        shapes = rows(doubles(leg_count * form.constants_size * lanes), lanes, form.constants)
        forces = rows(doubles(leg_count * form.reactions_size * lanes), lanes, form.reactions)
        unpacked = unpack_model(model, tables, ground, doubles(8 + 3 * form.gait), lanes_are_legs, law, form)
        at = address(data)
        row = data.shape[1]
        # lanes are neighbouring columns; lanes that are legs are as far apart as the legs' rows in one column
        far = form.leg_rows * row if lanes_are_legs else 1
        if reacts or form.has_limits:
            read_shapes(shapes, leg_count, constants, lanes, lanes_are_legs, form)
        for n in range(begin, end, 1 if lanes_are_legs else lanes):
            memory = columns(at, lanes, form.trunk_memory, n, row, 0 if lanes_are_legs else 1)
            before = memory.result
            starts = before == RESET_REQUESTED
            if steps < 0 and not any_lane(starts):
                continue
            load(trunk, of_legs, leg_count, account, memory, at, n, row, far, lanes, form)
            if steps < 0:
                start_motion(trunk, of_legs, leg_count, unpacked, starts)
            run_steps(
                trunk,
                of_legs,
                leg_count,
                unpacked,
                account,
                shapes,
                forces,
                h,
                max(steps, 0),
                keeps_account,
                reacts,
                joints,
            )
            result, good = judge(trunk, of_legs, leg_count, before, steps < 0, lanes_are_legs, form)
            memory.result = result
            store_trunk(trunk, account, memory, good, keeps_account, form)
            store_legs(trunk, of_legs, leg_count, good, at, n, row, far, lanes, form)
            if reacts:
                store_reactions(forces, leg_count, reactions, n, row, lanes, lanes_are_legs, form)

    return advance


KERNELS = {"leg": (1, 1, False), "four": (1, 4, True), "batch": (0, LANES, False)}
"""Number of legs (0 for any), number of lanes, and true if the lanes are the legs of one trunk: for one leg
alone, for four legs of one trunk side by side, and for `LANES` environments."""


BY_LEGS = {1: "leg", 4: "four"}
"""Kernels that run environments one by one, by the number of their legs."""

_KEPT = Kept()


def advance_kernels(contact_law: Callable[..., Any] | None = None, features: Features = PLAIN) -> Any:
    """Return the kernels `advance_leg`, `advance_four`, `advance_batch`, and `react_leg` and so on, which
    also compute joint reactions.

    Args:
        contact_law: law of contact as in `hoof.law_of`; None is that of `ground.laws`.
        features: features of the engine; each combination has kernels of its own.

    Raises:
        ParameterError: the law of contact reaches something that cannot be read.
    """
    identity = fingerprint(contact_law)
    key = (contact_law, features, identity)
    return _KEPT.get(key, lambda: _new_kernels(contact_law, features, identity), contact_law is not None)


def _new_kernels(contact_law: Callable[..., Any] | None, features: Features, identity: str) -> Kernels:
    refresh(contact_law)
    law = law_of(contact_law)
    form = engine_layout(features)
    joints = Joints(reactions_of(features.structure), joint_check_of(features.structure))
    if features != PLAIN:
        identity += f" {tuple(features)}"

    def new_kernel(name: str, legs: int, lanes: int, lanes_are_legs: bool, reacts: bool) -> Any:
        advance = advance_of(legs, lanes, lanes_are_legs, reacts, law, form, joints)
        advance.__name__ = name
        return kernel(advance, identity, threads=not lanes_are_legs and lanes > 1)

    kernels = {}
    for does in ("advance", "react"):
        for which, (legs, lanes, lanes_are_legs) in KERNELS.items():
            name = f"{does}_{which}"
            kernels[name] = new_kernel(name, legs, lanes, lanes_are_legs, reacts=does == "react")
    return Kernels(**kernels)
