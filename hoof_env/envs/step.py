"""Kernels of a control step: apply the action, advance the engine, find its outcome and decide whether the
episode ends, compute the reward, observe.

The source is the same for one environment and for `LANES` side by side, so that a row of a batch has the bits
of the environment alone. Terms of the reward and entries of the observation are those of a task
(`reward_kernel`, `observation_kernel`), the meaning of actions is that of a body (`tasks.body`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hoof_env.dynamics.advance import BY_LEGS, LANES, MODEL, advance_kernels
from hoof_env.dynamics.layout import PLAIN, Features
from hoof_env.dynamics.limits import PITCH, has_moved
from hoof_env.envs.action_kernel import converter
from hoof_env.envs.addresses import AT, BEGIN, END, memories
from hoof_env.envs.frames_kernel import delayed_actions, remember
from hoof_env.envs.observation_kernel import (
    Observers,
    from_outside,
    functions_of,
    observers_of,
    room_of,
    slots_of,
)
from hoof_env.envs.outcome import add_up, decide, find_outcome, put_together
from hoof_env.envs.reward_kernel import is_user_term, sum_of_terms
from hoof_env.simd import Cell, any_lane, block_at, cond, full_like, loop, rows, when, where, write
from hoof_env.simd.compile import Kernel, inline_source
from hoof_env.simd.kept import Kept, Kernels
from hoof_env.simd.memory import (
    COLUMNS,
    cube_at,
    doubles,
    doubles_at,
    matrix_at,
    offset,
    record_at,
    singles_at,
)
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import ACTIONS, FAILED, TRUNCATED, Memories, memories_of, task_type
from hoof_env.tasks.observation import Entry
from hoof_env.tasks.one_leg import LEG_KERNELS
from hoof_env.tasks.own_parts import ActionMap, Own, own_of
from hoof_env.tasks.reward import Term

NOT_A_NUMBER = -1
SOME_ENDED = 1
SOME_SWITCHED = 2
SOME_PUSHED = 4
"""Return codes of a step. NOT_A_NUMBER: an action was NaN or infinite and no environment was advanced.
Otherwise the code is a sum of SOME_ENDED (an episode ended), SOME_SWITCHED (a new commanded speed) and
SOME_PUSHED (a push is due)."""


class StepKernels(Kernels):
    """Kernels of a task. The argument of each is the array of `addresses.ADDRESSES`. Kernels that end in
    `_one` run environments one by one, those that end in `_batch` run `LANES` at a time.

    Attributes:
        step_one, step_batch: control step; they return one of the codes above.
        apply_one, finish_one: parts before and after the engine, for a solver that is not a kernel. The first
            one returns True if all actions are finite, the second one a code.
        observers: kernels of the observation alone.
    """

    step_one: Any
    step_batch: Any
    apply_one: Any
    finish_one: Any
    observers: Observers


_KEPT = Kept()


def step_kernels(
    terms: tuple[Term, ...],
    entries: tuple[Entry, ...],
    contact_law: Callable[..., Any] | None,
    features: Features = PLAIN,
    body: BodyKernels = LEG_KERNELS,
    action_map: ActionMap | None = None,
    task: tuple[tuple[str, Any], ...] = (),
    model: tuple[tuple[str, Any], ...] = (),
) -> StepKernels:
    """Return the kernels of tasks with the same parts, which share them.

    Args:
        terms: terms of the reward.
        entries: entries that can be observed.
        contact_law: user's law of the normal force; None for the engine's.
        features: features of the engine.
        body: the body's own parts.
        action_map: map from actions to those of the body; None for none.

    Raises:
        ParameterError: one of the functions refers to something that cannot be read.
    """
    key = (terms, entries, contact_law, features, body, action_map, task, model)
    foreign = from_outside(_functions(terms, entries, contact_law, action_map))
    # Helpers and constants of a user's function may have changed since: such kernels are traced anew.
    return _made(foreign, *key) if foreign else _KEPT.get(key, lambda: _made(foreign, *key), False)


def _functions(
    terms: tuple[Term, ...],
    entries: tuple[Entry, ...],
    contact_law: Callable[..., Any] | None,
    action_map: ActionMap | None,
) -> list[Callable[..., Any]]:
    """Return all functions that a task gives to its kernels."""
    parts: list[Any] = [term.compute for term in terms]
    parts += [part for entry in entries for part in functions_of(entry)]
    parts += [contact_law] if contact_law else []
    return [*parts, action_map.compute] if action_map else parts


def _made(
    foreign: list[Callable[..., Any]],
    terms: tuple[Term, ...],
    entries: tuple[Entry, ...],
    contact_law: Callable[..., Any] | None,
    features: Features,
    body: BodyKernels,
    action_map: ActionMap | None,
    task: tuple[tuple[str, Any], ...],
    model: tuple[tuple[str, Any], ...],
) -> StepKernels:
    """Make the kernels; each is traced when it is called."""
    own = own_of(terms, entries)
    layouts = memories_of(body.episode, len(terms), features, body.legs, own)
    slots = slots_of(entries)[2]
    task_record = task_type(len(terms), slots, layouts.gait, (*body.task_fields, *own.fields))
    observers = observers_of(entries, len(terms), features, body, own, task, model)
    finish = _finish(sum_of_terms(terms, layouts, own.constants), layouts, body)
    parts = (apply, finish, observe) = _apply(layouts, body, action_map, model), finish, observers.observe
    advance = advance_kernels(contact_law, features)
    # Bodies without a kernel of their own run side by side: nothing calls their `step_one`.
    advance_one = advance.function(BY_LEGS.get(body.legs, "batch"), body.legs)
    advance_batch = advance.function("batch", body.legs)
    sizes = (room, scratch_size, count) = room_of(slots), *_sizes(body, action_map)
    task_at = record_at(task_record, task)
    model_at = record_at(MODEL, model)
    records = (task_at, model_at)
    step_one = _step("step_one", 1, advance_one, records, sizes, layouts, body, parts)
    step_batch = _step("step_batch", LANES, advance_batch, records, sizes, layouts, body, parts)
    are_numbers = _are_numbers(count)

    def apply_one(addresses):  # type: ignore[no-untyped-def]
        task = task_at(addresses[AT.task])
        scratch = doubles(scratch_size)
        good = are_numbers(addresses)

        @when(good)
        def _() -> None:
            for n in loop(addresses[BEGIN], addresses[END]):
                remember(addresses, 1, task, n)
                apply(addresses, 1, task, n, scratch)

        return good

    def finish_one(addresses):  # type: ignore[no-untyped-def]
        task = task_at(addresses[AT.task])
        memory = doubles(2 * room)
        sums = doubles(layouts.sums * 2 + layouts.own_rows)
        happened = Cell(0)
        for n in loop(addresses[BEGIN], addresses[END]):
            happened.value = happened.value | finish(addresses, 1, task, n, sums)
            observe(addresses, 1, task, n, memory, 0)
        return happened.value

    of_task = (step_one, step_batch, apply_one, finish_one)
    kernels = {function.__name__: Kernel(function, ["addresses"], returns=True) for function in of_task}
    return StepKernels(observers=observers, **kernels)


def _sizes(body: BodyKernels, action_map: ActionMap | None) -> tuple[int, int]:
    """Return the size of the scratch memory for each row, in numbers, and the number of actions of a row."""
    count = len(action_map.names) if action_map else body.legs * ACTIONS
    return max(body.scratch_size, count if action_map else 0), count


def _are_numbers(actions_per_row: int) -> Callable[..., Any]:
    """Return a part of kernels that is True if all actions are finite, including those of other threads'
    blocks."""

    @inline_source
    def are_numbers(addresses):  # type: ignore[no-untyped-def]
        actions = singles_at(addresses[AT.actions])
        count = addresses[AT.data + COLUMNS]
        # Stays 0 unless an action is infinite or not a number.
        total = Cell(0.0)
        # All columns, not the block of this thread: either all threads take the step or none does.
        for k in loop(count * actions_per_row):
            total.value = total.value + (actions[k] - actions[k])
        return total.value == 0.0

    return are_numbers


def _apply(
    layouts: Memories, body: BodyKernels, action_map: ActionMap | None, model: Any
) -> Callable[..., Any]:
    """Return a part of kernels that turns the actions of row n and, with lanes, of its neighbours into
    commands."""
    command = body.command
    put_action = delayed_actions(layouts)
    convert = converter(action_map, layouts, body, model)

    @inline_source
    def apply(addresses, lanes, task, n, scratch):  # type: ignore[no-untyped-def]
        put_action(addresses, lanes, task, n)
        convert(addresses, lanes, task, n, scratch)
        _, leg, episode = memories(addresses, lanes, layouts, n)
        actions = singles_at(addresses[AT.mapped])
        command(task, actions, episode, leg, layouts.gait, n, rows(scratch, lanes, None))

    return apply


def _finish(compute_reward: Callable[..., Any], layouts: Memories, body: BodyKernels) -> Callable[..., Any]:
    """Return a part of kernels that does what follows the engine, but for the observation: reward and end."""
    on_switch = body.on_switch

    @inline_source
    def finish(addresses, lanes, task, n, sums):  # type: ignore[no-untyped-def]
        trunk, leg, episode = memories(addresses, lanes, layouts, n)
        of_step = rows(sums, lanes, layouts.stride_sums)
        outcome = find_outcome(task, trunk, leg, episode, layouts, of_step)
        add_up(outcome, episode, layouts)
        # Before the observation, which shows the speed that is commanded in the next step.
        ended, switched, pushed = decide(task, outcome, episode)
        on_switch(task, episode, switched)
        nothing = full_like(episode, 0.0)
        # Memory behind the sums, for those of one lane.
        spare = offset(sums, layouts.sums * lanes)
        reward = compute_reward(addresses, lanes, task, outcome, episode, n, spare, nothing)
        write(reward, doubles_at(addresses[AT.rewards]), n, 1)
        return (
            any_lane(ended).to_whole() * SOME_ENDED
            | any_lane(switched).to_whole() * SOME_SWITCHED
            | any_lane(pushed).to_whole() * SOME_PUSHED
        )

    return finish


def _keep_sums(layouts: Memories) -> Callable[..., Any]:
    """Return a part of kernels that puts together the sums and results of the parts of a step."""
    size = layouts.sums
    legs = layouts.legs

    @inline_source
    def keep_sums(addresses, lanes, n, memory, is_first):  # type: ignore[no-untyped-def]
        trunk, first_leg, _ = memories(addresses, lanes, layouts, n)
        kept = rows(memory, lanes, None)
        if not is_first:
            for i in range(legs):
                leg = block_at(first_leg, i)
                for k in range(size):
                    leg.sums[k] = put_together(layouts, k, kept[i * size + k], leg.sums[k])
            before = kept[legs * size]
            now = trunk.result
            # A failure stays, and so does a limit unless a failure follows.
            has_failed = (before > 0.0) & (before < PITCH)
            trunk.result = where(has_failed | ((before >= PITCH) & has_moved(now)), before, now)
        for i in range(legs):
            leg = block_at(first_leg, i)
            for k in range(size):
                kept[i * size + k] = leg.sums[k]
        kept[legs * size] = trunk.result

    return keep_sums


def _step(
    name: str,
    lanes: int,
    advance: Any,
    records: tuple[Any, Any],
    sizes: tuple[int, int, int],
    layouts: Memories,
    body: BodyKernels,
    parts: tuple[Callable[..., Any], ...],
) -> Callable[..., Any]:
    """Return the function of a kernel that takes a whole control step.

    Args:
        name: name of the function.
        lanes, advance: number of environments side by side, and the kernel that advances them.
        records: functions that find the records of task and model.
        layouts, body: parts of the task.
        sizes: room for an observation, size of the scratch memory, and number of actions.
        parts: apply, finish and observe.
    """
    (apply, finish, observe) = parts
    (room, scratch_size, actions_per_row) = sizes
    own_rows = layouts.own_rows
    sums_size = layouts.sums
    keep_sums = _keep_sums(layouts)
    are_numbers = _are_numbers(actions_per_row)
    (task_at, model_at) = records

    def step(addresses):  # type: ignore[no-untyped-def]
        code = Cell(NOT_A_NUMBER)

        @when(are_numbers(addresses))
        def _() -> None:
            code.value = take_step(addresses)

        return code.value

    def take_step(addresses):  # type: ignore[no-untyped-def]
        task = task_at(addresses[AT.task])
        happened = Cell(0)
        scratch = doubles(scratch_size * lanes)
        memory = doubles(2 * room * lanes)
        # Also for the sums of one lane, for terms that take no lanes.
        sums = doubles(sums_size * (lanes + 1) + own_rows * lanes)
        kept = doubles((body.legs * sums_size + 1) * lanes)
        advance_group = advance(
            matrix_at(addresses, AT.data),
            model_at(addresses[AT.model]),
            matrix_at(addresses, AT.tables),
            matrix_at(addresses, AT.ground),
            matrix_at(addresses, AT.constants),
            cube_at(addresses, AT.reactions),
        )
        # One group of lanes after the other: its memory stays in the cache from action to observation.
        for n in loop(addresses[BEGIN], addresses[END], lanes):
            remember(addresses, lanes, task, n)
            # One part, but for delays by fractions of a step.
            for part in range(task.parts):
                if part == task.acting_part:
                    apply(addresses, lanes, task, n, scratch)
                advance_group(n, task.h, task.part_substeps[part], False)
                if task.parts > 1:
                    keep_sums(addresses, lanes, n, kept, part == 0)
                is_last = part == task.parts - 1
                if is_last:
                    happened.value = happened.value | finish(addresses, lanes, task, n, sums)
                if is_last or part == task.seeing_part:
                    observe(addresses, lanes, task, n, memory, 0 if is_last else 1)
        return happened.value

    step.__name__ = name
    return step
