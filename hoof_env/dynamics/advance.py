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
from dataclasses import dataclass
from functools import lru_cache
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
    Matrix,
    Number,
    Truth,
    Whole,
    any_lane,
    block_at,
    columns,
    cond,
    full_like,
    lane_sum,
    load_rows,
    loop,
    new_rows,
    one_of,
    read,
    rolled,
    when,
    where,
)
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import Arrays, Given, RecordType

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
        tables=tables.first,
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


def read_trunk(trunk, memory):  # type: ignore[no-untyped-def]
    """Load state and settings from a `TrunkMemory`."""
    load_rows(trunk.state, memory.state)
    load_rows(trunk.settings, memory.settings)
    keep_still(trunk)


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


def find_result(trunk, legs, leg_count, lanes_are_legs, form):  # type: ignore[no-untyped-def]
    """Return how the environments ended, numbers of `parts.Result`. A number too large to be squared counts
    as not finite."""
    of_trunk = full_like(trunk, 0.0)
    stuck = trunk.at_dead_point
    for k in range(form.trunk_state):
        of_trunk = of_trunk + trunk.state[k] * trunk.state[k]
    of_all = Cell(of_trunk)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        # a sum for each leg: in one long sum each addition would wait for the one before
        leg_total = leg.theta_acceleration * leg.theta_acceleration
        for k in range(form.leg_state):
            leg_total = leg_total + leg.state[k] * leg.state[k]
        of_all.value = of_all.value + leg_total
    total = of_all.value
    if lanes_are_legs:
        total = lane_sum(full_like(trunk, 0.0), total)
        stuck = lane_sum(full_like(trunk, 0.0), stuck)
    failure = where(stuck > 0.0, DEAD_POINT, NOT_FINITE)
    ending = where(trunk.fallen > 0.0, FALLEN, OK)
    if form.has_limits:
        ending = where(trunk.fallen > 0.0, FALLEN, trunk.violated_limit[0])
    # total - total is 0 if total is finite, else NaN
    return where((total - total != 0.0) | (stuck > 0.0), failure, ending)


def store(memory, rows, count, good):  # type: ignore[no-untyped-def]
    """Store `count` rows in the lanes of memory where `good` holds."""
    for k in range(count):
        memory[k] = where(good, rows[k], memory[k])


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


def leg_memory_of(data: Matrix, form: EngineLayout, i: Whole, n: Whole, lanes: int, stride: Whole = 1) -> Any:
    """Return the `LegMemory` of the i-th leg of environment n and, with lanes, of the neighbouring columns or
    legs, `stride` apart."""
    return columns(data, lanes, form.leg_memory, n, form.trunk_rows + i * form.leg_rows, stride)


def load(trunk, legs, leg_count, account, memory, leg_memory, form):
    """Load the environments, with an account of 0; `leg_memory` gives the memory of each leg."""
    read_trunk(trunk, memory)
    if form.has_limits:
        clear_limits(trunk)
    for i in loop(leg_count):
        read_leg(block_at(legs, i), leg_memory(i), form)
    for k in range(form.account_size):
        account[k] = 0.0


def start_motion(trunk, legs, leg_count, model, starts):  # type: ignore[no-untyped-def]
    """Turn the velocities of the environments that start into momenta."""
    begin_step(trunk, legs, leg_count, model)
    if model.kind != FIXED:
        velocities_to_momenta(trunk, legs, leg_count, model, starts)


def store_legs(trunk, legs, leg_count, good, leg_memory, form):
    """Store reports, and where `good` holds what changes of the legs."""
    for i in loop(leg_count):
        leg = block_at(legs, i)
        memory = leg_memory(i)
        report_leg(trunk, leg, memory.report, form)
        store(memory.state, leg.state, form.leg_state, good)
        store(memory.strides, leg.strides, form.strides, good)
        store(memory.sums, leg.sums, form.sums, good)


def store_reactions(forces, leg_count, reactions, n, lanes, lanes_are_legs, form):
    """Store the joint reactions of all legs, an array of shape (legs, numbers, columns)."""
    size = form.reactions_size
    width = reactions.shape[2]
    rows = Matrix(reactions.first, (0, width))
    for i in loop(leg_count):
        out = columns(rows, lanes, form.reactions, n, i * size, size * width if lanes_are_legs else 1)
        leg_forces = block_at(forces, i)
        for k in range(size):
            out[k] = leg_forces[k]


def read_shapes(shapes, leg_count, constants, lanes, lanes_are_legs, form):
    """Load the constants of all legs, which all environments share."""
    stride = form.constants_size if lanes_are_legs else 0
    for k in range(leg_count * form.constants_size):
        shapes[k] = read(constants.first, k, stride, lanes)


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


def store_trunk(trunk, account, memory, good, keeps_account, form):  # type: ignore[no-untyped-def]
    """Store the report, and where `good` holds what changes of the trunk."""
    report_trunk(trunk, memory.report)
    store(memory.state, trunk.state, form.trunk_state, good)

    @when(keeps_account)
    def _() -> None:
        for k in range(form.account_size):
            account[k] = account[k] + memory.account[k]
        store(memory.account, account, form.account_size, good)


@dataclass(frozen=True)
class Arrangement:
    """Which environments, or legs, a kernel advances side by side.

    Attributes:
        name: of the arrangement.
        lanes: number of environments side by side or, if `lanes_are_legs`, of legs of one trunk.
        lanes_are_legs: True if the lanes are the legs of one trunk.
    """

    name: str
    lanes: int
    lanes_are_legs: bool = False

    @property
    def step(self) -> int:
        """Number of environments that are advanced at once."""
        return 1 if self.lanes_are_legs else self.lanes


ONE_BY_ONE = {1: Arrangement("leg", 1), 4: Arrangement("four", 4, lanes_are_legs=True)}
"""Arrangements that run environments one by one, by the number of their legs."""

SIDE_BY_SIDE = Arrangement("batch", LANES)


@dataclass(frozen=True)
class EngineKind:
    """All that the code of an engine's kernels follows from.

    Attributes:
        features: features of the engine.
        contact_law: user's law of the normal force; None for the engine's.
        known: fields `STATIC` of its `MODEL`, with their values.
        reacts: True for joint reactions.
    """

    features: Features
    contact_law: Callable[..., Any] | None
    known: tuple[tuple[str, Any], ...]
    reacts: bool = False

    @property
    def legs(self) -> int:
        """Number of legs."""
        return int(dict(self.known)["legs"])

    @property
    def arrays(self) -> dict[str, str | RecordType]:
        """Types of the arrays that kernels take."""
        return {**dict.fromkeys(ARRAYS, "f8"), "model": RecordType(MODEL, dict(self.known))}


ARRAYS = ("data", "model", "tables", "ground", "constants", "reactions")
"""Names of the arrays that an engine's kernels take, in the order of `TrunkEngine.arrays`."""


class Advance:
    """Engine inside a kernel: memory on the stack, and settings, of the environments that are advanced.

    Args:
        given: arrays of the kernel, with those of `ARRAYS`.
        kind: kind of the engine.
        arrangement: environments that are advanced at once.
        is_start: True for a kernel that starts the environments with the result `RESET_REQUESTED`.
    """

    def __init__(self, given: Given, kind: EngineKind, arrangement: Arrangement, is_start: bool = False) -> None:
        self.kind = kind
        self.arrangement = arrangement
        self.is_start = is_start
        self.form = form = engine_layout(kind.features)
        lanes = arrangement.lanes
        lanes_are_legs = arrangement.lanes_are_legs
        legs = 1 if lanes_are_legs else kind.legs
        self.leg_count = legs if legs == 1 else rolled(legs)
        self.trunk = new_rows(form.trunk, lanes)
        self.legs = new_rows(form.leg, lanes, legs)
        self.account = new_rows(form.account, lanes)
        self.shapes = new_rows(form.constants, lanes, legs)
        self.forces = new_rows(form.reactions, lanes, legs)
        self.data = given.data
        self.reactions = given.reactions
        law = law_of(kind.contact_law)
        self.model = unpack_model(given.model, given.tables, given.ground, lanes_are_legs, law, form)
        structure = kind.features.structure
        self.joints = Joints(reactions_of(structure), joint_check_of(structure))
        if kind.reacts or form.has_limits:
            read_shapes(self.shapes, legs, given.constants, lanes, lanes_are_legs, form)

    def __call__(self, n: Whole, h: Number, steps: Whole, keeps_account: Truth) -> None:
        """Advance environment n and, side by side, its neighbours by `steps` of `h` [s]."""
        lanes = self.arrangement.lanes
        lanes_are_legs = self.arrangement.lanes_are_legs
        form = self.form
        # lanes are neighbouring columns; lanes that are legs are as far apart as the legs' rows in one column
        far = form.leg_rows * self.data.shape[1] if lanes_are_legs else 1
        memory = columns(self.data, lanes, form.trunk_memory, n, stride=0 if lanes_are_legs else 1)
        before = memory.result
        starts = before == RESET_REQUESTED
        trunk, legs, leg_count = self.trunk, self.legs, self.leg_count

        def leg_memory(i: Whole) -> Any:
            return leg_memory_of(self.data, form, i, n, lanes, far)

        @when(any_lane(starts) if self.is_start else True)
        def _() -> None:
            load(trunk, legs, leg_count, self.account, memory, leg_memory, form)
            if self.is_start:
                start_motion(trunk, legs, leg_count, self.model, starts)
            run_steps(
                trunk, legs, leg_count, self.model, self.account, self.shapes, self.forces, h, steps, keeps_account,
                self.kind.reacts, self.joints,
            )  # fmt: skip
            result, good = judge(trunk, legs, leg_count, before, self.is_start, lanes_are_legs, form)
            memory.result = result
            store_trunk(trunk, self.account, memory, good, keeps_account, form)
            store_legs(trunk, legs, leg_count, good, leg_memory, form)
            if self.kind.reacts:
                store_reactions(self.forces, leg_count, self.reactions, n, lanes, lanes_are_legs, form)


def new_kernel(kind: EngineKind, arrangement: Arrangement, is_start: bool = False) -> Kernel:
    """Return a kernel of an engine.

    Its arguments are the arrays, the substep [s], the number of substeps, and 1 for a kernel that keeps the
    account. It advances the columns of the arrays or, if `is_start`, starts those of them whose result is
    `RESET_REQUESTED`.
    """

    def advance(given: Given, h: Number, steps: Whole, keeps_account: Whole) -> None:
        advance_group = Advance(given, kind, arrangement, is_start)
        for n in loop(given.begin, given.end, arrangement.step):
            advance_group(n, h, 0 if is_start else steps, keeps_account != 0)

    does = "start" if is_start else "react" if kind.reacts else "advance"
    threads = not arrangement.lanes_are_legs and arrangement.lanes > 1
    return Kernel(advance, [Arrays(kind.arrays), float, int, int], f"{does}_{arrangement.name}", threads)


@lru_cache(maxsize=256)
def _own_kernel(kind: EngineKind, arrangement: Arrangement, is_start: bool) -> Kernel:
    return new_kernel(kind, arrangement, is_start)


def engine_kernel(kind: EngineKind, arrangement: Arrangement, is_start: bool = False) -> Kernel:
    """Return the kernel of an engine, `new_kernel`; engines of one kind share it, unless a function from outside
    is part of it, whose helpers may have changed since."""
    if kind.contact_law is None:
        return _own_kernel(kind, arrangement, is_start)
    return new_kernel(kind, arrangement, is_start)
