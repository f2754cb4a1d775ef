"""Kernels of the engine: load environments from its memory, advance them step after step, store them.

`Advance` is the engine inside a kernel. It advances one leg alone, four lanes that are the legs of one trunk,
or `LANES` environments side by side with any number of legs: the `Arrangement`s. It works on copies on the
stack, which LLVM keeps in registers where they fit.

An engine's memory is one matrix `data`, a column for each environment: the rows of the trunk, then the rows
of each leg, fields as in `layout.TrunkMemory` and `LegMemory`. Each kind of engine (`EngineKind`) has its own
kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

from hoof_env.dynamics.hoof import disable_heel, level_ground, remember_contacts
from hoof_env.dynamics.layout import (
    EngineLayout,
    Features,
    LegMemory,
    LegRows,
    TrunkMemory,
    TrunkRows,
    engine_layout,
)
from hoof_env.dynamics.limits import CHECK_EVERY, check_joints, check_trunk, clear_limits
from hoof_env.dynamics.mechanics import evaluate, keep_still, velocities_to_momenta
from hoof_env.dynamics.model import MODEL, unpack_model
from hoof_env.dynamics.observables import count_stride, keep_account, report_leg, report_trunk
from hoof_env.dynamics.parts import FIXED, Result
from hoof_env.dynamics.reactions import find_reactions
from hoof_env.dynamics.stepping import begin_step, end_step, next_stage, weigh_stage
from hoof_env.simd import (
    Cell,
    Lanes,
    Matrix,
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
from hoof_env.simd.layout import Block, Layout
from hoof_env.simd.memory import Arrays, Given, RecordType

LANES = 8
"""Number of environments side by side in a batch: one vector of 512 bits."""

OK = float(Result.OK)
NOT_FINITE = float(Result.NOT_FINITE)
DEAD_POINT = float(Result.DEAD_POINT)
FALLEN = float(Result.FALLEN)
FIRST_LIMIT = float(Result.PITCH)

RESET_REQUESTED = -1.0
"""Mark in place of a result: the environment is to be started."""


def read_trunk(trunk: TrunkRows, memory: TrunkMemory) -> None:
    """Load state and settings from a `TrunkMemory`."""
    load_rows(trunk.state, memory.state)
    load_rows(trunk.settings, memory.settings)
    keep_still(trunk)


def read_leg(leg: LegRows, memory: LegMemory, form: EngineLayout) -> None:
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
        disable_heel(leg, form.springs)


def find_result(
    trunk: TrunkRows, legs: LegRows, leg_count: Whole, lanes_are_legs: bool, form: EngineLayout
) -> Lanes:
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
    ending = where(trunk.fallen > 0.0, FALLEN, trunk.violated_limit[0] if form.has_limits else OK)
    # total - total is 0 if total is finite, else NaN
    return where((total - total != 0.0) | (stuck > 0.0), failure, ending)


def store(memory: Block | Layout, rows: Block | Layout, count: int, good: Truth) -> None:
    """Store `count` rows in the lanes of memory where `good` holds."""
    for k in range(count):
        memory[k] = where(good, rows[k], memory[k])


def leg_memory_of(
    data: Matrix, form: EngineLayout, i: Whole, n: Whole, lanes: int, stride: Whole = 1
) -> LegMemory:
    """Return the `LegMemory` of the i-th leg of environment n and, with lanes, of the neighbouring columns or
    legs, `stride` apart."""
    return columns(data, lanes, form.leg_memory, n, form.trunk_rows + i * form.leg_rows, stride)


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
    """Everything that determines the code of an engine's kernels.

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
        given: arrays of the kernel, `ARRAYS` among them.
        kind: kind of the engine.
        arrangement: environments that are advanced at once.
        is_start: True for a kernel that starts the environments with the result `RESET_REQUESTED`.
    """

    def __init__(
        self, given: Given, kind: EngineKind, arrangement: Arrangement, is_start: bool = False
    ) -> None:
        self.kind = kind
        self.arrangement = arrangement
        self.is_start = is_start
        self.form = form = engine_layout(kind.features)
        lanes = arrangement.lanes
        legs = 1 if arrangement.lanes_are_legs else kind.legs
        self.leg_count: Whole = legs if legs == 1 else rolled(legs)
        self.trunk = new_rows(form.trunk, lanes)
        self.legs = new_rows(form.leg, lanes, legs)
        self.account = new_rows(form.account, lanes)
        self.constants = new_rows(form.constants, lanes, legs)
        self.forces = new_rows(form.reactions, lanes, legs)
        self.data: Matrix = given.data
        self.reactions: Matrix = given.reactions
        self.model = unpack_model(
            given.model, given.tables, given.ground, arrangement.lanes_are_legs, kind.contact_law, form
        )
        if kind.reacts or form.has_limits:
            self._read_constants(given.constants, legs)

    def _read_constants(self, constants: Matrix, legs: int) -> None:
        """Load the constants of all legs, which all environments share."""
        size = self.form.constants.size
        stride = size if self.arrangement.lanes_are_legs else 0
        for i in range(legs):
            of_leg = block_at(self.constants, i)
            for k in range(size):
                of_leg[k] = read(constants.first, i * size + k, stride, self.arrangement.lanes)

    def __call__(self, n: Whole, h: Lanes | float, steps: Whole, keeps_account: Truth) -> None:
        """Advance environment n and, side by side, its neighbours by `steps` of `h` [s]."""
        lanes, lanes_are_legs = self.arrangement.lanes, self.arrangement.lanes_are_legs
        form = self.form
        # lanes are neighbouring columns; lanes that are legs are as far apart as the legs' rows in one column
        far = form.leg_rows * self.data.shape[1] if lanes_are_legs else 1
        memory = columns(self.data, lanes, form.trunk_memory, n, stride=0 if lanes_are_legs else 1)
        before = memory.result
        starts = before == RESET_REQUESTED

        def leg_memory(i: Whole) -> LegMemory:
            return leg_memory_of(self.data, form, i, n, lanes, far)

        @when(any_lane(starts) if self.is_start else True)
        def _() -> None:
            self._load(memory, leg_memory)
            if self.is_start:
                self._start(starts)
            self._run(h, steps, keeps_account)
            result, good = self._step_results(before)
            memory.result = result
            self._store_trunk(memory, good, keeps_account)
            self._store_legs(leg_memory, good)
            if self.kind.reacts:
                self._store_reactions(n)

    def _load(self, memory: TrunkMemory, leg_memory: Callable[[Whole], LegMemory]) -> None:
        """Load the environments, with an account of 0."""
        read_trunk(self.trunk, memory)
        if self.form.has_limits:
            clear_limits(self.trunk)
        for i in loop(self.leg_count):
            read_leg(block_at(self.legs, i), leg_memory(i), self.form)
        for k in range(self.form.account.size):
            self.account[k] = 0.0

    def _start(self, starts: Truth) -> None:
        """Turn the velocities of the environments that start into momenta."""
        begin_step(self.trunk, self.legs, self.leg_count, self.model)
        if self.model.kind != FIXED:
            velocities_to_momenta(self.trunk, self.legs, self.leg_count, self.model, starts)

    def _run(self, h: Lanes | float, steps: Whole, keeps_account: Truth) -> None:
        """Advance by `steps` of `h` [s] and evaluate forces and accelerations at the end."""
        model = self.model
        stage = Cell(0)
        elapsed = Cell(0.0)
        begin_step(self.trunk, self.legs, self.leg_count, model)
        # one loop over all stages of all steps, not two: `evaluate`, which is large, is written once
        for turn in loop(steps * model.stages + 1):
            evaluate(self.trunk, self.legs, self.leg_count, model, elapsed.value)
            when(stage.value == 0)(partial(self._look, turn, h, steps))
            when(turn < steps * model.stages)(partial(self._move, stage, elapsed, h, keeps_account))

    def _look(self, turn: Whole, h: Lanes | float, steps: Whole) -> None:
        """Finish a whole step: remember contacts, count strides, find reactions, check limits."""
        self._remember(turn, h, steps)
        model = self.model
        if model.form.has_limits:
            # counted from the end, so that limits are always checked at the last step
            left = steps * model.stages - turn
            when((turn > 0) & (left % (CHECK_EVERY * model.stages) == 0))(self._check_limits)

    def _remember(self, turn: Whole, h: Lanes | float, steps: Whole) -> None:
        """Remember contacts, count strides and find reactions at the end of a whole step."""
        trunk, model = self.trunk, self.model
        structure = self.kind.features.structure
        for i in loop(self.leg_count):
            leg = block_at(self.legs, i)
            remember_contacts(leg)
            if model.counts_strides:
                when(turn > 0)(partial(count_stride, trunk, leg, model.form, h))
            if self.kind.reacts:
                constants, forces = block_at(self.constants, i), block_at(self.forces, i)
                find = partial(find_reactions, structure, trunk, leg, constants, forces)
                when((turn > 0) | (steps == 0))(find)

    def _check_limits(self) -> None:
        """Check the limits of joints and trunk."""
        mechanism = self.kind.features.structure.mechanism
        for i in loop(self.leg_count):
            leg, constants = block_at(self.legs, i), block_at(self.constants, i)
            check_joints(mechanism, self.trunk, leg, constants, self.model)
        check_trunk(self.trunk, self.model)

    def _move(self, stage: Cell, elapsed: Cell, h: Lanes | float, keeps_account: Truth) -> None:
        """Go on to the next stage, or to the next step from the last."""
        bodies = (self.trunk, self.legs, self.leg_count, self.model)
        model = self.model
        weight = one_of(model.weights[: model.stages], stage.value)
        when(keeps_account)(lambda: keep_account(*bodies, self.account, h * weight))
        weigh_stage(*bodies, weight)
        elapsed.value = one_of(model.fractions[: model.stages], stage.value) * h
        stage.value = stage.value + 1

        def end() -> None:
            end_step(*bodies, h)
            begin_step(*bodies)
            stage.value = 0
            elapsed.value = 0.0

        cond(stage.value < model.stages, lambda: next_stage(*bodies, elapsed.value), end)

    def _step_results(self, before: Lanes) -> tuple[Lanes, Truth]:
        """Return the results of the environments, and where the rows of the kernel are to be stored."""
        result = find_result(
            self.trunk, self.legs, self.leg_count, self.arrangement.lanes_are_legs, self.form
        )
        good = result == OK
        if self.form.has_limits:
            good = good | (result >= FIRST_LIMIT)  # a motion beyond a limit is a motion
        if self.is_start:
            # only environments that start are written, even if the start is infeasible
            good = before == RESET_REQUESTED
            result = where(good, result, before)
        return result, good

    def _store_trunk(self, memory: TrunkMemory, good: Truth, keeps_account: Truth) -> None:
        """Store the report and, where `good` holds, the trunk's state."""
        report_trunk(self.trunk, memory.report)
        store(memory.state, self.trunk.state, self.form.trunk_state, good)

        @when(keeps_account)
        def _() -> None:
            account, size = self.account, self.form.account.size
            for k in range(size):
                account[k] = account[k] + memory.account[k]
            store(memory.account, account, size, good)

    def _store_legs(self, leg_memory: Callable[[Whole], LegMemory], good: Truth) -> None:
        """Store the reports and, where `good` holds, the legs' states."""
        form = self.form
        for i in loop(self.leg_count):
            leg = block_at(self.legs, i)
            memory = leg_memory(i)
            report_leg(self.trunk, leg, memory.report, form)
            store(memory.state, leg.state, form.leg_state, good)
            store(memory.strides, leg.strides, form.strides, good)
            store(memory.sums, leg.sums, form.sums, good)

    def _store_reactions(self, n: Whole) -> None:
        """Store the joint reactions of all legs, an array of shape (legs, numbers, columns)."""
        size = self.form.reactions.size
        width = self.reactions.shape[2]
        rows = Matrix(self.reactions.first, (0, width))
        stride = size * width if self.arrangement.lanes_are_legs else 1
        for i in loop(self.leg_count):
            out = columns(rows, self.arrangement.lanes, self.form.reactions, n, i * size, stride)
            forces = block_at(self.forces, i)
            for k in range(size):
                out[k] = forces[k]


def new_kernel(kind: EngineKind, arrangement: Arrangement, is_start: bool = False) -> Kernel:
    """Return a kernel of an engine.

    Its arguments are the arrays, the substep [s], the number of substeps, and 1 for a kernel that updates
    the account. It advances the columns of the arrays or, if `is_start`, starts the columns whose result is
    `RESET_REQUESTED`.
    """

    def advance(given: Given, h: Lanes, steps: Whole, keeps_account: Whole) -> None:
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
    """Return the kernel of an engine, `new_kernel`. Engines of one kind share it, except with a
    user's function, whose helpers may have changed since."""
    if kind.contact_law is None:
        return _own_kernel(kind, arrangement, is_start)
    return new_kernel(kind, arrangement, is_start)
