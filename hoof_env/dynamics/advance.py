"""The engine's kernels: environments come from the engine's memory, go step after step, and go back.

`advance_leg`, `advance_four` and `advance_batch` are one function, `run`, compiled for one leg alone, for
four lanes that are the legs of one trunk, and for `LANES` environments side by side with any number of legs;
`react_leg` and so on are the same with joint reactions, a fifth more to compile. What they work on lives on
the stack, where the compiler keeps what it can in registers.

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
from hoof_env.dynamics.hoof import law_of, level_ground, remember_contacts
from hoof_env.dynamics.layout import PLAIN, Features
from hoof_env.dynamics.limits import CHECK_EVERY, check_joints, check_trunk, clear_limits
from hoof_env.dynamics.mechanics import evaluate, keep_still, velocities_to_momenta
from hoof_env.dynamics.observables import count_stride, keep_account, report_leg, report_trunk
from hoof_env.dynamics.parts import FIXED, Result
from hoof_env.dynamics.reactions import LegConstants, Reactions, react
from hoof_env.dynamics.stepping import begin_step, end_step, next_stage, weigh_stage
from hoof_env.simd import any_lane, block_at, columns, full_like, lane_sum, load_rows, rows, where
from hoof_env.simd.compile import inline_llvm, inline_source, kernel
from hoof_env.simd.kept import Kept, Kernels
from hoof_env.simd.memory import address, doubles, offset
from hoof_env.simd.reach import fingerprint, refresh

LANES = 8
"""Environments side by side in a batch: one vector of 512 bits."""

OK = float(Result.OK)
NOT_FINITE = float(Result.NOT_FINITE)
DEAD_POINT = float(Result.DEAD_POINT)
FALLEN = float(Result.FALLEN)
FIRST_LIMIT = float(Result.PITCH)

RESET_REQUESTED = -1.0
"""Stands in the place of a result where an environment is to start."""

CONSTANTS_SIZE = LegConstants.size
REACTIONS_SIZE = Reactions.size

MODEL = np.dtype(
    [
        ("legs", "i8"), ("cells", "f8"),  # how many; cells of a leg's table
        ("kind", "i8"), ("eighths", "i8"), ("friction_law", "i8"),  # of trunk, contact exponent, friction
        ("interpolated", "?"), ("is_terrain", "?"), ("new_rates", "?"),  # see `Ground`, `Terrain`, `Scheme`
        ("strides", "?"), ("motors", "?"),  # whether to count them; whether any crank has a motor
        ("averages", "?"), ("stages", "i8"), ("fractions", "f8", (4,)), ("weights", "f8", (4,)),  # `Scheme`
        ("settings", "f8", (12,)),  # of the filters
        ("ground_origin", "f8"), ("ground_per_metre", "f8"),  # of the terrain's grid
    ],
    align=True,
)  # fmt: skip
"""What does not change while the engine runs, but for large arrays."""


class Model(NamedTuple):
    """`MODEL` inside the kernels, with the large arrays."""

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
    settings: Any  # pointer to memory on the stack, as are fractions and weights
    averages: bool
    stages: int
    fractions: Any
    weights: Any
    ground_cells: Any  # of the terrain's grid
    ground_origin: float
    ground_per_metre: float
    law: Any  # of contact, see `hoof.law_of`


@inline_llvm
def unpack_model(model, tables, ground, small, lanes_are_legs, law, form):  # type: ignore[no-untyped-def]
    """The model from its record and arrays; `small` points to room for 8 + 3 form.gait doubles."""
    given = model[0]
    for k in range(4):
        small[k] = given.fractions[k]
        small[4 + k] = given.weights[k]
    settings = offset(small, 8)
    for k in range(12):
        settings[k] = given.settings[k]
    for k in range(12, 3 * form.gait):  # higher harmonics swing like the first
        settings[k] = given.settings[k % 3 + 9]
    return Model(
        given.kind, given.eighths, given.friction_law, given.interpolated, given.is_terrain, given.new_rates,
        given.strides, given.motors, lanes_are_legs, form, given.cells, address(tables),
        settings, given.averages, given.stages, small, offset(small, 4),
        carray(address(ground), ground.shape), given.ground_origin, given.ground_per_metre, law,
    )  # fmt: skip


@inline_llvm
def read_trunk(trunk, memory):  # type: ignore[no-untyped-def]
    """State and settings from a `TrunkMemory`."""
    load_rows(trunk.state, memory.state)
    load_rows(trunk.settings, memory.settings)
    keep_still(trunk)


@inline_llvm
def read_leg(leg, memory, form):  # type: ignore[no-untyped-def]
    """State, command and settings from a `LegMemory`; sums begin anew."""
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


@inline_llvm
def find_result(trunk, legs, leg_count, lanes_are_legs, form):  # type: ignore[no-untyped-def]
    """How the environments ended, numbers of `parts.Result`. A number whose square is none counts as none."""
    total = full_like(trunk, 0.0)
    stuck = trunk.at_dead_point
    for k in range(form.trunk_state):
        total = total + trunk.state[k] * trunk.state[k]
    for i in range(leg_count):
        leg = block_at(legs, i)
        own = leg.theta_acceleration * leg.theta_acceleration  # a sum for each leg: long chains of sums wait
        for k in range(form.leg_state):
            own = own + leg.state[k] * leg.state[k]
        total = total + own
    if lanes_are_legs:
        total = lane_sum(full_like(trunk, 0.0), total)
        stuck = lane_sum(full_like(trunk, 0.0), stuck)
    lost = where(stuck > 0.0, DEAD_POINT, NOT_FINITE)
    fell = where(trunk.fallen > 0.0, FALLEN, OK)
    if form.has_limits:
        fell = where(trunk.fallen > 0.0, FALLEN, trunk.violated_limit[0])
    return where((total - total != 0.0) | (stuck > 0.0), lost, fell)


@inline_llvm
def store(memory, rows, count, good):  # type: ignore[no-untyped-def]
    """Put `count` rows into memory where they are good."""
    for k in range(count):
        memory[k] = where(good, rows[k], memory[k])


@inline_source
def run_steps(  # type: ignore[no-untyped-def]
    trunk, legs, leg_count, model, account, constants, reactions, h, steps, keeps_account, reacts
):
    """Advance by `steps` of `h` [s] and evaluate there."""
    stage = 0
    elapsed = 0.0
    begin_step(trunk, legs, leg_count, model)
    for turn in range(steps * model.stages + 1):
        evaluate(trunk, legs, leg_count, model, elapsed)
        if stage == 0:
            left = steps * model.stages - turn
            looks = turn > 0 and left % (CHECK_EVERY * model.stages) == 0
            for i in range(leg_count):
                leg = block_at(legs, i)
                remember_contacts(leg)
                if model.strides and turn > 0:
                    count_stride(trunk, leg, model.form, h)
                if reacts and (turn > 0 or steps == 0):
                    react(trunk, leg, block_at(constants, i), block_at(reactions, i))
                if model.form.has_limits and looks:
                    check_joints(trunk, leg, block_at(constants, i), model)
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


@inline_source
def run(  # type: ignore[no-untyped-def]
    data, model, tables, ground, constants, reactions, h, steps, keeps_account, begin, end,
    leg_count, lanes, lanes_are_legs, reacts, law, form,
):  # fmt: skip
    """Advance environments `begin` to `end`: `lanes` at a time, or one whose legs the lanes are. With `steps`
    below 0 those start whose result is `RESET_REQUESTED`. Unless `reacts`, a constant, there is no code for
    reactions."""
    trunk = rows(doubles(form.trunk_size * lanes), lanes, form.trunk)
    legs = rows(doubles(leg_count * form.leg_size * lanes), lanes, form.leg)
    account = rows(doubles(form.account_size * lanes), lanes, form.account)
    shapes = rows(doubles(leg_count * CONSTANTS_SIZE * lanes), lanes, LegConstants)
    forces = rows(doubles(leg_count * REACTIONS_SIZE * lanes), lanes, Reactions)
    inside = unpack_model(model, tables, ground, doubles(8 + 3 * form.gait), lanes_are_legs, law, form)
    at = address(data)
    row = data.shape[1]
    # lanes are neighbours, but where they are legs, as far apart as legs are
    envs = lanes
    near = 1
    far = 1
    if lanes_are_legs:
        envs = 1
        near = 0
        far = form.leg_rows * row
    if reacts or form.has_limits:
        own = columns(address(constants), lanes, None, 0, 1, CONSTANTS_SIZE if lanes_are_legs else 0)
        for k in range(leg_count * CONSTANTS_SIZE):
            shapes[k] = own[k]
    for n in range(begin, end, envs):
        memory = columns(at, lanes, form.trunk_memory, n, row, near)
        before = memory.result
        starts = before == RESET_REQUESTED
        if steps < 0 and not any_lane(starts):
            continue
        read_trunk(trunk, memory)
        if form.has_limits:
            clear_limits(trunk)
        for k in range(form.account_size):
            account[k] = 0.0
        for i in range(leg_count):
            first = (form.trunk_rows + i * form.leg_rows) * row + n
            read_leg(block_at(legs, i), columns(at, lanes, form.leg_memory, first, row, far), form)
        if steps < 0:
            begin_step(trunk, legs, leg_count, inside)
            if inside.kind != FIXED:
                velocities_to_momenta(trunk, legs, leg_count, inside, starts)
        run_steps(
            trunk, legs, leg_count, inside, account, shapes, forces, h, max(steps, 0), keeps_account, reacts
        )
        report_trunk(trunk, memory.report)
        result = find_result(trunk, legs, leg_count, lanes_are_legs, form)
        good = result == OK
        if form.has_limits:
            good = good | (result >= FIRST_LIMIT)  # a motion beyond a limit is a motion
        if steps < 0:  # the others are as they were; a start that cannot be is kept as it is
            result = where(starts, result, before)
            good = starts
        memory.result = result
        store(memory.state, trunk.state, form.trunk_state, good)
        if keeps_account:
            for k in range(form.account_size):
                account[k] = account[k] + memory.account[k]
            store(memory.account, account, form.account_size, good)
        for i in range(leg_count):
            leg = block_at(legs, i)
            first = (form.trunk_rows + i * form.leg_rows) * row + n
            own = columns(at, lanes, form.leg_memory, first, row, far)
            report_leg(trunk, leg, own.report)
            store(own.state, leg.state, form.leg_state, good)
            store(own.strides, leg.strides, form.strides, good)
            store(own.sums, leg.sums, form.sums, good)
            if reacts:
                kept = block_at(forces, i)
                first = i * REACTIONS_SIZE * row + n
                stride = REACTIONS_SIZE * row if lanes_are_legs else 1
                out = columns(address(reactions), lanes, Reactions, first, row, stride)
                for k in range(REACTIONS_SIZE):
                    out[k] = kept[k]


KERNELS = {"leg": (1, 1, False), "four": (1, 4, True), "batch": (0, LANES, False)}
"""One leg alone, four legs of one trunk side by side, or `LANES` environments: how many legs, 0 for any
number; lanes; whether these are the legs of one trunk."""


BY_LEGS = {1: "leg", 4: "four"}
"""Kernels that run environments one by one, by the number of their legs."""

_KEPT = Kept()


def advance_kernels(contact_law: Callable[..., Any] | None = None, features: Features = PLAIN) -> Any:
    """`advance_leg`, `advance_four` and `advance_batch`; `react_leg` and so on compute joint reactions too.

    The law of contact is as in `hoof.law_of`; None is that of `ground.laws`. `ParameterError` where it
    reaches what cannot be read.
    """
    identity = fingerprint(contact_law)
    key = (contact_law, features, identity)
    return _KEPT.get(key, lambda: _made(contact_law, features, identity), contact_law is not None)


def _made(contact_law: Callable[..., Any] | None, features: Features, identity: str) -> Kernels:
    refresh(contact_law)
    law = law_of(contact_law)
    form = engine_layout(features)
    if features != PLAIN:
        identity += f" {tuple(features)}"

    def made(name: str, legs: int, lanes: int, lanes_are_legs: bool, reacts: bool) -> Any:
        def advance(  # type: ignore[no-untyped-def]
            data, model, tables, ground, constants, reactions, h, steps, keeps_account, begin, end
        ):
            count = legs if legs else model[0].legs
            run(
                data, model, tables, ground, constants, reactions, h, steps, keeps_account, begin, end,
                count, lanes, lanes_are_legs, reacts, law, form,
            )  # fmt: skip

        advance.__name__ = name
        return kernel(advance, f"{name} {identity}", threads=not lanes_are_legs and lanes > 1)

    names = {f"{does}_{which}": which for does in ("advance", "react") for which in KERNELS}
    return Kernels(**{
        name: made(name, *KERNELS[which], name.startswith("react")) for name, which in names.items()
    })  # fmt: skip
