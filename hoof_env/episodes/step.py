"""Kernels of a control step: apply the action, advance the engine, find its outcome and decide whether the
episode ends, compute the reward, observe.

The source is the same for one environment and for `LANES` side by side, so that a row of a batch has the bits
of the environment alone. A task has the terms of the reward and the entries of the observation
(`reward_kernel`, `observation_kernel`), a body has the meaning of actions (`tasks.body`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from hoof_env.dynamics.advance import LANES, ONE_BY_ONE, SIDE_BY_SIDE, Advance, Arrangement
from hoof_env.dynamics.limits import PITCH, has_moved
from hoof_env.episodes.action_kernel import apply, are_numbers
from hoof_env.episodes.frames_kernel import remember
from hoof_env.episodes.observation_kernel import Observer, put_entries
from hoof_env.episodes.outcome import add_up, decide, find_outcome, put_together
from hoof_env.episodes.reward_kernel import compute_reward
from hoof_env.episodes.scene import Scene, TaskKind
from hoof_env.simd import Cell, Truth, Whole, any_lane, block_at, loop, new_rows, when, where, write
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import Arrays, Given
from hoof_env.simd.values import Index

NOT_A_NUMBER = -1
SOME_ENDED = 1
SOME_SWITCHED = 2
SOME_PUSHED = 4
"""Return codes of a step. NOT_A_NUMBER: an action was NaN or infinite and no environment was advanced.
Otherwise the code is a sum of SOME_ENDED (an episode ended), SOME_SWITCHED (a new commanded speed) and
SOME_PUSHED (a push is due)."""

ONE = Arrangement("one", 1)
"""Arrangement of kernels that run environments one by one, and in which the engine has no part."""


@dataclass(frozen=True)
class StepKernels:
    """Kernels of a task; each takes the arrays of `TaskKind.arrays`, except `measure`, whose
    arrays have `measured`, too.

    Attributes:
        step: control step; returns one of the codes above.
        apply, finish: parts before and after the engine, for a solver that is not a kernel. The first returns
            True if all actions are finite, the second a code.
        observe: kernel that observes without a step.
        measure: kernel that writes the entries before scaling, shape (count, columns).
    """

    step: Kernel
    apply: Kernel
    finish: Kernel
    observe: Kernel
    measure: Kernel


def step_kernels(kind: TaskKind, is_scalar: bool) -> StepKernels:
    """Return the kernels of tasks of one kind, which share them; with a function from outside, whose
    helpers and constants may have changed since, as in a notebook, they are traced again.

    Args:
        kind: kind of the task.
        is_scalar: True for environments one by one, False for `LANES` at a time.
    """
    return _new_kernels(kind, is_scalar) if kind.has_user_functions else _own_kernels(kind, is_scalar)


@lru_cache(maxsize=256)
def _own_kernels(kind: TaskKind, is_scalar: bool) -> StepKernels:
    return _new_kernels(kind, is_scalar)


def _new_kernels(kind: TaskKind, is_scalar: bool) -> StepKernels:
    lanes = 1 if is_scalar else LANES
    # bodies without an arrangement of their own run side by side
    engine = ONE_BY_ONE.get(kind.body.legs, SIDE_BY_SIDE) if is_scalar else SIDE_BY_SIDE
    name = "one" if is_scalar else "batch"

    def step(given: Given) -> Whole:
        return take_step(kind, given, lanes, engine)

    def observe(given: Given) -> None:
        observe_rows(kind, given, lanes)

    def apply_actions(given: Given) -> Truth:
        return apply_rows(kind, given)

    def finish(given: Given) -> Whole:
        return finish_rows(kind, given)

    def measure(given: Given) -> None:
        measure_rows(kind, given)

    return StepKernels(
        step=Kernel(step, [kind.arrays], f"step_{name}", is_threaded=not is_scalar),
        apply=Kernel(apply_actions, [kind.arrays], "apply"),
        finish=Kernel(finish, [kind.arrays], "finish"),
        observe=Kernel(observe, [kind.arrays], f"observe_{name}"),
        measure=Kernel(measure, [Arrays({**kind.arrays.types, "measured": "f8"})], "measure"),
    )


def take_step(kind: TaskKind, given: Given, lanes: int, engine: Arrangement) -> Whole:
    """Take a control step of all rows; return its code."""
    scene = Scene(kind, given, lanes)
    happened = Cell(NOT_A_NUMBER)

    @when(are_numbers(scene))
    def _() -> None:
        happened.value = 0
        advance = Advance(given, kind.engine, engine)
        observe = Observer(scene)
        so_far = new_rows(None, lanes, scene.layouts.legs * scene.layouts.sums + 1)
        # one group of lanes after the other: its memory stays in the cache from action to observation
        for n in loop(given.begin, given.end, lanes):
            happened.value = happened.value | step_rows(scene, n, advance, observe, so_far)

    found: Whole = happened.value
    return found


def step_rows(
    scene: Scene, n: Whole, advance: Callable[..., None], observe: Callable[..., None], so_far: Any
) -> Whole:
    """Take the control step of row n and, with lanes, of its neighbours; `so_far` is memory for the sums of
    the parts into which delays by fractions of a step divide it."""
    task = scene.task
    scratch = new_rows(None, scene.lanes, scene.kind.body.scratch_size)
    remember(scene, n)
    for part in range(task.parts):
        if part == task.acting_part:
            apply(scene, n, scratch)
        advance(n, task.h, task.part_substeps[part], False)
        if task.parts > 1:
            join_sums(scene, n, so_far, part == 0)
        if part == task.seeing_part and part < task.parts - 1:
            observe(n, within=True)
    happened = finish_row(scene, n)
    observe(n)
    return happened


def finish_row(scene: Scene, n: Whole) -> Whole:
    """Do what follows the engine, except for the observation: reward and end; return the code of the step."""
    task, layouts = scene.task, scene.layouts
    trunk, leg, episode = scene.trunk(n), scene.leg(n), scene.episode(n)
    outcome = find_outcome(task, trunk, leg, episode, layouts, new_rows(layouts.stride_sums, scene.lanes))
    add_up(outcome, episode, layouts)
    # before the observation, which shows the speed that is commanded in the next step
    ended, switched, pushed = decide(task, outcome, episode)
    scene.kind.body.on_switch(task, episode, switched)
    write(compute_reward(scene, outcome, n), scene.rewards, n, 1)
    code: Whole = (
        as_whole(any_lane(ended)) * SOME_ENDED
        | as_whole(any_lane(switched)) * SOME_SWITCHED
        | as_whole(any_lane(pushed)) * SOME_PUSHED
    )
    return code


def as_whole(condition: Any) -> Any:
    """Return 1 where a condition holds that all lanes share, else 0."""
    found: Index = condition.to_whole()
    return found


def join_sums(scene: Scene, n: Whole, so_far: Any, is_first: bool) -> None:
    """Join the sums and the result of a part of a step with the parts before it, `so_far`."""
    layouts = scene.layouts
    size, legs = layouts.sums, layouts.legs
    trunk, first_leg = scene.trunk(n), scene.leg(n)
    if not is_first:
        for i in range(legs):
            leg = block_at(first_leg, i)
            for k in range(size):
                leg.sums[k] = put_together(layouts, k, so_far[i * size + k], leg.sums[k])
        before = so_far[legs * size]
        now = trunk.result
        # a failure stays, and so does a limit unless a failure follows
        has_failed = (before > 0.0) & (before < PITCH)
        trunk.result = where(has_failed | ((before >= PITCH) & has_moved(now)), before, now)
    for i in range(legs):
        leg = block_at(first_leg, i)
        for k in range(size):
            so_far[i * size + k] = leg.sums[k]
    so_far[legs * size] = trunk.result


# Parts of a step as kernels of their own


def observe_rows(kind: TaskKind, given: Given, lanes: int) -> None:
    """Observe all rows."""
    observe = Observer(Scene(kind, given, lanes))
    for n in loop(given.begin, given.end, lanes):
        observe(n)


def apply_rows(kind: TaskKind, given: Given) -> Truth:
    """Apply the actions of all rows; return whether they are finite."""
    scene = Scene(kind, given, 1)
    good = are_numbers(scene)

    @when(good)
    def _() -> None:
        scratch = new_rows(None, 1, kind.body.scratch_size)
        for n in loop(given.begin, given.end):
            remember(scene, n)
            apply(scene, n, scratch)

    return good


def finish_rows(kind: TaskKind, given: Given) -> Whole:
    """Finish the step of all rows, and observe; return its code."""
    scene = Scene(kind, given, 1)
    observe = Observer(scene)
    happened = Cell(0)
    for n in loop(given.begin, given.end):
        happened.value = happened.value | finish_row(scene, n)
        observe(n)
    code: Whole = happened.value
    return code


def measure_rows(kind: TaskKind, given: Given) -> None:
    """Write the entries of all rows before scaling."""
    scene = Scene(kind, given, 1)
    slots = kind.slots.count
    numbers = new_rows(None, 1, slots)
    measured, size = given.measured.first, given.measured.shape[1]
    for n in loop(given.begin, given.end):
        put_entries(scene, numbers, n, scaled=False)
        for slot in range(slots):
            column = scene.task.observation_columns[slot]
            if column >= 0:
                write(numbers[slot], measured, column * size + n, 1)
