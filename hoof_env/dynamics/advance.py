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
from hoof_env.simd import (
    Cell,
    any_lane,
    block_at,
    columns,
    cond,
    full_like,
    lane_sum,
    load_rows,
    loop,
    one_of,
    rows,
    when,
    where,
)
from hoof_env.simd.compile import Kernel, inline_llvm, inline_source
from hoof_env.simd.kept import Kept, Kernels
from hoof_env.simd.memory import address, doubles

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


STATIC = ("legs", "kind", "eighths", "friction_law", "interpolated", "is_terrain", "new_rates", "strides", "motors",
          "averages", "stages", "fractions", "weights")  # fmt: skip
"""Fields of `MODEL` that are known when a kernel is traced."""


def static_of(model: Any) -> tuple[tuple[str, Any], ...]:
    """Return the fields of a model that its kernels are made for, with their values."""
    return tuple((name, _plain(model[0][name])) for name in STATIC)


def _plain(value: Any) -> Any:
    return tuple(value.tolist()) if value.shape else value.item()


def unpack_model(record, tables, ground, lanes_are_legs, law, form):  # type: ignore[no-untyped-def]
    """Return the `Model` of a record and its arrays."""
    # higher harmonics have the filters of the first
    places = [*range(12), *(k % 3 + 9 for k in range(12, 3 * form.gait))]
    return Model(
        kind=record.kind,
        eighths=record.eighths,
        friction_law=record.friction_law,
        interpolated=record.interpolated,
        is_terrain=record.is_terrain,
        new_rates=record.new_rates,
        strides=record.strides,
        motors=record.motors,
        lanes_are_legs=lanes_are_legs,
        form=form,
        cells=record.cells,
        tables=address(tables),
        settings=[record.settings[k] for k in places],
        averages=record.averages,
        stages=record.stages,
        fractions=record.fractions,
        weights=record.weights,
        ground_cells=ground,
        ground_origin=record.ground_origin if record.is_terrain else 0.0,
        ground_per_metre=record.ground_per_metre if record.is_terrain else 0.0,
        law=law,
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
    stage = Cell(0)
    elapsed = Cell(0.0)
    begin_step(trunk, legs, leg_count, model)
    # one loop over all stages of all steps, not two: `evaluate`, which is large, then has a single call
    for turn in loop(steps * model.stages + 1):
        evaluate(trunk, legs, leg_count, model, elapsed.value)

        @when(stage.value == 0)
        def _() -> None:
            # counted from the end, so that limits are always checked at the last step
            left = steps * model.stages - turn
            for i in loop(leg_count):
                leg = block_at(legs, i)
                remember_contacts(leg)
                if model.strides:
                    when(turn > 0)(lambda: count_stride(trunk, leg, model.form, h))
                if reacts:
                    when((turn > 0) | (steps == 0))(
                        lambda: joints.react(trunk, leg, block_at(constants, i), block_at(reactions, i))
                    )
            if model.form.has_limits:

                @when((turn > 0) & (left % (CHECK_EVERY * model.stages) == 0))
                def _() -> None:
                    for i in loop(leg_count):
                        joints.check(trunk, block_at(legs, i), block_at(constants, i), model)
                    check_trunk(trunk, model)

        @when(turn < steps * model.stages)
        def _() -> None:
            weight = one_of(model.weights[: model.stages], stage.value)
            when(keeps_account)(lambda: keep_account(trunk, legs, leg_count, model, account, h * weight))
            weigh_stage(trunk, legs, leg_count, model, weight)
            elapsed.value = one_of(model.fractions[: model.stages], stage.value) * h
            stage.value = stage.value + 1

            def end() -> None:
                end_step(trunk, legs, leg_count, model, h)
                begin_step(trunk, legs, leg_count, model)
                stage.value = 0
                elapsed.value = 0.0

            cond(
                stage.value < model.stages,
                lambda: next_stage(trunk, legs, leg_count, model, elapsed.value),
                end,
            )


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
    for i in loop(leg_count):
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

    @when(keeps_account)
    def _() -> None:
        for k in range(form.account_size):
            account[k] = account[k] + memory.account[k]
        store(memory.account, account, form.account_size, good)


def advance_of(
    legs: int,
    lanes: int,
    lanes_are_legs: bool,
    reacts: bool,
    law: Any,
    form: EngineLayout,
    joints: Joints,
    is_start: bool = False,
) -> Callable[..., None]:
    """Return the function of a kernel, which advances environments `begin` to `end` by substeps of h [s]; if
    their number is negative, environments with the result `RESET_REQUESTED` are started.

    Args:
        legs: number of legs, 0 for any.
        lanes: number of environments side by side or, if `lanes_are_legs`, of legs of one environment.
        reacts: false for a kernel without code for joint reactions.
        law, form, joints: law of contact (`hoof.law_of`), engine's layouts, kernels of the legs' structure.
    """

    def prepare(data, model, tables, ground, constants, reactions):  # type: ignore[no-untyped-def]
        leg_count = legs
        trunk = rows(doubles(form.trunk_size * lanes), lanes, form.trunk)
        of_legs = rows(doubles(leg_count * form.leg_size * lanes), lanes, form.leg)
        account = rows(doubles(form.account_size * lanes), lanes, form.account)
        shapes = rows(doubles(leg_count * form.constants_size * lanes), lanes, form.constants)
        forces = rows(doubles(leg_count * form.reactions_size * lanes), lanes, form.reactions)
        unpacked = unpack_model(model, tables, ground, lanes_are_legs, law, form)
        at = address(data)
        row = data.shape[1]
        # lanes are neighbouring columns; lanes that are legs are as far apart as the legs' rows in one column
        far = form.leg_rows * row if lanes_are_legs else 1
        if reacts or form.has_limits:
            read_shapes(shapes, leg_count, constants, lanes, lanes_are_legs, form)

        def advance_group(n, h, steps, keeps_account):  # type: ignore[no-untyped-def]
            memory = columns(at, lanes, form.trunk_memory, n, row, 0 if lanes_are_legs else 1)
            before = memory.result
            starts = before == RESET_REQUESTED

            @when(any_lane(starts) if is_start else True)
            def _() -> None:
                load(trunk, of_legs, leg_count, account, memory, at, n, row, far, lanes, form)
                if is_start:
                    start_motion(trunk, of_legs, leg_count, unpacked, starts)
                run_steps(
                    trunk, of_legs, leg_count, unpacked, account, shapes, forces, h, steps, keeps_account, reacts, joints
                )  # fmt: skip
                result, good = judge(trunk, of_legs, leg_count, before, is_start, lanes_are_legs, form)
                memory.result = result
                store_trunk(trunk, account, memory, good, keeps_account, form)
                store_legs(trunk, of_legs, leg_count, good, at, n, row, far, lanes, form)
                if reacts:
                    store_reactions(forces, leg_count, reactions, n, row, lanes, lanes_are_legs, form)

        return advance_group

    return prepare


KERNELS = {"leg": (1, 1, False), "four": (1, 4, True), "batch": (0, LANES, False)}
"""Number of legs (0 for any), number of lanes, and true if the lanes are the legs of one trunk: for one leg
alone, for four legs of one trunk side by side, and for `LANES` environments."""


BY_LEGS = {1: "leg", 4: "four"}
"""Kernels that run environments one by one, by the number of their legs."""

_KEPT = Kept()


class AdvanceKernels:
    """Kernels of engines with one law of contact and one set of features, each made when it is first needed."""

    def __init__(self, contact_law: Any, features: Features) -> None:
        self._law = law_of(contact_law)
        self._form = engine_layout(features)
        self._joints = Joints(reactions_of(features.structure), joint_check_of(features.structure))
        self._made: dict[Any, Kernel] = {}

    def function(self, which: str, legs: int, reacts: bool = False, is_start: bool = False) -> Any:
        """Return the function of a kernel, for kernels that contain it."""
        own, lanes, lanes_are_legs = KERNELS[which]
        count = own or legs
        parts = (reacts, self._law, self._form, self._joints, is_start)
        return advance_of(count, lanes, lanes_are_legs, *parts)

    def get(self, which: str, does: str, static: tuple[tuple[str, Any], ...], is_start: bool = False) -> Kernel:
        """Return a kernel for models with these values."""
        key = (which, does, static, is_start)
        if key not in self._made:
            legs = dict(static)["legs"]
            prepare = self.function(which, legs, does == "react", is_start)
            step = 1 if KERNELS[which][2] else KERNELS[which][1]

            def advance(  # type: ignore[no-untyped-def]
                data, model, tables, ground, constants, reactions, h, steps, keeps_account, begin, end
            ):
                group = prepare(data, model, tables, ground, constants, reactions)
                for n in loop(begin, end, step):
                    group(n, h, 0 if is_start else steps, keeps_account != 0)

            advance.__name__ = f"{'start' if is_start else does}_{which}"
            kinds = ["matrix", (MODEL, dict(static)), "matrix", "matrix", "matrix", "matrix"]
            kinds += ["double", "index", "truth", "index", "index"]
            self._made[key] = Kernel(advance, kinds)
        return self._made[key]


def advance_kernels(contact_law: Callable[..., Any] | None = None, features: Features = PLAIN) -> Any:
    """Return the kernels of engines with a law of contact and features."""
    return _KEPT.get(
        (contact_law, features), lambda: AdvanceKernels(contact_law, features), contact_law is not None
    )
