"""The kernels of an environment's step: from actions through the engine to observation and reward.

One source for one environment and for `LANES` side by side, so that a row of a batch has the bits of the
environment alone. All arrays are reached from one array of addresses (`DESK`), for a call from Python costs
more than this whole step does.
"""

from __future__ import annotations

import numpy as np
from numba import carray, from_dtype  # type: ignore[attr-defined]
from numba.core import types

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics.advance import (
    AT_COMMAND,
    AT_LIMB_REPORT,
    AT_REPORT,
    AT_RESULT,
    LANES,
    MODEL,
    TRUNK_ROWS,
    advance_batch,
    advance_leg,
)
from hoof_env.dynamics.lanes_report import LIMB_REPORT
from hoof_env.ground.surface import surface
from hoof_env.simd import anywhere, choose, larger, level, read, rows, size, smaller, write
from hoof_env.simd.compile import inlined, kernel, pasted
from hoof_env.simd.math import clip, cos_sin, tanh
from hoof_env.simd.memory import doubles, pointer_to

ACTIONS = 4

(
    ACTION, _, _, _,  # the last one, clipped to its limits
    STEPS,  # control steps so far
    BEFORE,  # x of the trunk before this step [m]
    TARGET,  # commanded speed [m/s]; infinite if there is none
    WEIGHT,  # of trunk and leg [N]
    TIME, DISTANCE, WORK, IMPULSE, LOADED_TIME, STANCES, PEAK_SUM, HIGHEST,  # totals, see SUMS
    TERM, _, _, _, _, _,  # of the last reward, see TERMS
    ENDED,  # 0, or how: FAILED, TRUNCATED
    SWITCH, NEXT_TARGET,  # the control step after which another speed is commanded, and which [m/s]
) = range(25)  # fmt: skip
EPISODE_ROWS = 25
"""Rows of an environment's memory of its episode; a column is an environment."""

SUMS = ("time", "distance", "work", "impulse", "loaded_time", "stances", "peak_sum", "highest")
TERMS = (
    "reward_progress", "reward_peak", "reward_energy", "reward_action", "reward_failure", "reward_support",
)  # fmt: skip
FAILED, TRUNCATED = 1, 2
NOT_A_NUMBER, SWITCHED = -1, 2
"""What a step returns if an action is none, and nothing has happened then; 1 if an episode ended, and 2 more
if somewhere another speed is commanded now."""

AHEAD = (0.25, 0.5, 0.75, 1.0)
"""Where the height of the ground is seen, from O forward [m]."""

ENTRIES = 25 + len(AHEAD)
"""Everything that can be observed; `observation` says which entries there are, and in what order."""

SPEED_SCALE, RISE_SCALE, HEIGHT_SCALE, APPROACH_SCALE, LOAD_SCALE, GROUND_SCALE = 5.0, 2.0, 0.3, 2.0, 3.0, 0.5
"""Scales of tanh: forward speed [m/s], vertical speed [m/s], height [m], approach speed [m/s], force
[weights], height of the ground [m]."""

TASK = np.dtype(
    [
        ("base", "f8", (4,)), ("half", "f8", (4,)),  # command = base + half action
        ("low", "f8", (4,)), ("high", "f8", (4,)),  # within these
        ("middle", "f8", (4,)), ("rate_bound", "f8", (4,)),  # (value - middle) / half is observed
        ("weights", "f8", (6,)), ("failure_seconds", "f8"),  # of the reward
        ("h", "f8"), ("substeps", "i8"), ("dt", "f8"), ("episode_steps", "i8"),
        ("height", "f8"), ("lowest", "f8"), ("highest", "f8"),  # nominal and extreme heights of the trunk [m]
        ("stays", "?"), ("sees_ground", "?"),  # a fixed trunk; whether ground ahead is observed
        ("count", "i8"), ("places", "i8", (ENTRIES,)),  # of the observation; -1: not observed
    ],
    align=True,
)  # fmt: skip
"""What a task is, for the kernels."""

ARRAYS = ("data", "model", "tables", "ground", "constants", "reactions", "episode", "task", "actions", "seen")
"""The arrays behind a desk, in order; each has `_SLOTS` numbers: address and shape."""

_SLOTS = 4
_double_at, _single_at = pointer_to(types.float64), pointer_to(types.float32)
_model_at, _task_at = pointer_to(from_dtype(MODEL)), pointer_to(from_dtype(TASK))

_REPORT = {name: AT_LIMB_REPORT + k for k, name in enumerate(LIMB_REPORT)}
TOE_NORMAL, HEEL_NORMAL = _REPORT["toe_normal"], _REPORT["heel_normal"]


@inlined
def take_action(mine, actions, episode, data, task, n, columns):  # type: ignore[no-untyped-def]
    """Clip an action to its limits, command what it says, and keep the mean square of its change as a
    term."""
    change = level(mine, 0.0)
    for k in range(ACTIONS):
        action = clip(read(mine, actions, n * ACTIONS + k, ACTIONS), 1.0)
        step = action - read(mine, episode, (ACTION + k) * columns + n, 1)
        change = change + step * step
        write(action, episode, (ACTION + k) * columns + n, 1)
        command = smaller(larger(task.base[k] + task.half[k] * action, task.low[k]), task.high[k])
        write(level(mine, 0.0) + command, data, (TRUNK_ROWS + AT_COMMAND + k) * columns + n, 1)
    write(0.25 * change, episode, (TERM + 3) * columns + n, 1)


@inlined
def add_to(mine, episode, row, x, n, columns):  # type: ignore[no-untyped-def]
    """Add to a row of the episode."""
    at = row * columns + n
    write(read(mine, episode, at, 1) + x, episode, at, 1)


@inlined
def judge_step(mine, data, episode, task, n, columns):  # type: ignore[no-untyped-def]
    """Terms of the reward, totals of the episode, and whether it ends. Returns where it does, and
    where another speed is commanded."""
    limb = TRUNK_ROWS
    good = read(mine, data, AT_RESULT * columns + n, 1) == 0.0  # else the state is of before: nothing is paid
    x, y = read(mine, data, AT_REPORT * columns + n, 1), read(mine, data, (AT_REPORT + 1) * columns + n, 1)
    if task.stays:
        distance = read(mine, data, (limb + b.TRAVEL) * columns + n, 1)
    else:
        distance = x - read(mine, episode, BEFORE * columns + n, 1)
    distance = choose(good, distance, 0.0)
    write(x, episode, BEFORE * columns + n, 1)
    increase = choose(good, read(mine, data, (limb + b.PEAK_INCREASE) * columns + n, 1), 0.0)
    work = choose(good, read(mine, data, (limb + b.POSITIVE_WORK) * columns + n, 1), 0.0)
    target = read(mine, episode, TARGET * columns + n, 1)
    wanted = task.dt * target  # what goes beyond it costs as much
    paid = choose(distance > wanted, wanted - (distance - wanted), distance)

    steps = read(mine, episode, STEPS * columns + n, 1) + 1.0
    failed = choose(good & (y > task.lowest) & (y < task.highest), 0.0, float(FAILED))
    late = choose(steps >= task.episode_steps, float(TRUNCATED), 0.0)
    ended = choose(failed > 0.0, failed, late)
    write(steps, episode, STEPS * columns + n, 1)
    write(ended, episode, ENDED * columns + n, 1)

    switch = steps >= read(mine, episode, SWITCH * columns + n, 1)  # from the next step on, and observed now
    following = read(mine, episode, NEXT_TARGET * columns + n, 1)
    write(choose(switch, following, target), episode, TARGET * columns + n, 1)

    changed = read(mine, episode, (TERM + 3) * columns + n, 1)
    write(task.weights[0] * paid, episode, TERM * columns + n, 1)
    write(-0.001 * task.weights[1] * increase, episode, (TERM + 1) * columns + n, 1)
    write(-0.001 * task.weights[2] * work, episode, (TERM + 2) * columns + n, 1)
    write(-task.weights[3] * changed, episode, (TERM + 3) * columns + n, 1)
    charge = choose(failed > 0.0, -task.weights[4] * task.failure_seconds, 0.0)
    write(charge, episode, (TERM + 4) * columns + n, 1)

    add_to(mine, episode, TIME, choose(good, task.dt, 0.0), n, columns)
    add_to(mine, episode, DISTANCE, distance, n, columns)
    add_to(mine, episode, WORK, work, n, columns)
    impulse = choose(good, read(mine, data, (limb + b.LOAD_IMPULSE) * columns + n, 1), 0.0)
    add_to(mine, episode, IMPULSE, impulse, n, columns)
    borne = impulse / read(mine, episode, WEIGHT * columns + n, 1)
    write(task.weights[5] * borne, episode, (TERM + 5) * columns + n, 1)
    loaded = read(mine, data, (limb + b.LOADED_TIME) * columns + n, 1)
    add_to(mine, episode, LOADED_TIME, choose(good, loaded, 0.0), n, columns)
    stances = read(mine, data, (limb + b.STANCES) * columns + n, 1)
    add_to(mine, episode, STANCES, choose(good, stances, 0.0), n, columns)
    add_to(mine, episode, PEAK_SUM, increase, n, columns)
    highest = choose(good, read(mine, data, (limb + b.HIGHEST) * columns + n, 1), 0.0)
    before = read(mine, episode, HIGHEST * columns + n, 1)
    write(larger(before, highest), episode, HIGHEST * columns + n, 1)
    return ended > 0.0, switch


@inlined
def show(x, k, seen, task, n):  # type: ignore[no-untyped-def]
    """Entry k of the observation, in [-1, 1], if it is asked for."""
    place = task.places[k]
    if place >= 0:
        write(clip(x, 1.0), seen, n * task.count + place, task.count)


@inlined
def look(mine, data, episode, ground, model, seen, task, n, columns):  # type: ignore[no-untyped-def]
    """What a policy sees: entries in the order of `observation.ENTRIES`."""
    limb = TRUNK_ROWS
    cosine, sine = cos_sin(read(mine, data, (limb + b.THETA) * columns + n, 1))
    show(sine, 0, seen, task, n)
    show(cosine, 1, seen, task, n)
    for k in range(ACTIONS):
        value = read(mine, data, (limb + b.VALUE + k) * columns + n, 1)
        rate = read(mine, data, (limb + b.RATE + k) * columns + n, 1)
        show((value - task.middle[k]) / task.half[k], 2 + k, seen, task, n)
        show(rate / task.rate_bound[k], 6 + k, seen, task, n)
        show(read(mine, episode, (ACTION + k) * columns + n, 1), 20 + k, seen, task, n)
    x, y = read(mine, data, AT_REPORT * columns + n, 1), read(mine, data, (AT_REPORT + 1) * columns + n, 1)
    if not task.stays:
        vx = read(mine, data, (AT_REPORT + 2) * columns + n, 1)
        vy = read(mine, data, (AT_REPORT + 3) * columns + n, 1)
        show(tanh(vx * (1 / SPEED_SCALE)), 10, seen, task, n)
        show(tanh(vy * (1 / RISE_SCALE)), 11, seen, task, n)
        show(tanh((y - task.height) * (1 / HEIGHT_SCALE)), 12, seen, task, n)
    load = LOAD_SCALE * read(mine, episode, WEIGHT * columns + n, 1)
    for point in range(2):
        depth = read(mine, data, (limb + b.MEMORY + 3 * point) * columns + n, 1)
        slowness = read(mine, data, (limb + b.MEMORY + 3 * point + 2) * columns + n, 1)
        normal = read(mine, data, (limb + TOE_NORMAL + (HEEL_NORMAL - TOE_NORMAL) * point) * columns + n, 1)
        approach = choose(slowness > 0.0, 1.0 / choose(slowness > 0.0, slowness, 1.0), 0.0)
        show(choose(depth > 0.0, 1.0, 0.0) + level(mine, 0.0), 13 + point, seen, task, n)
        show(tanh(normal / load), 15 + point, seen, task, n)
        show(tanh(approach * (1 / APPROACH_SCALE)), 17 + point, seen, task, n)
    show(tanh(read(mine, data, (limb + b.STANCE_PEAK) * columns + n, 1) / load), 19, seen, task, n)
    show(tanh(read(mine, episode, TARGET * columns + n, 1) * (1 / SPEED_SCALE)), 24, seen, task, n)
    if task.sees_ground:
        here = surface(x, ground, model.ground_origin, model.ground_per_metre)[0]
        for k in range(len(AHEAD)):
            there = surface(x + AHEAD[k], ground, model.ground_origin, model.ground_per_metre)[0]
            show(tanh((there - here) * (1 / GROUND_SCALE)), 25 + k, seen, task, n)


@pasted
def take_all(desk, lanes):  # type: ignore[no-untyped-def]
    """Take all actions, or none: whether they are numbers."""
    columns, mine = desk[2], rows(doubles(lanes), lanes)
    data, episode = _double_at(desk[0]), _double_at(desk[6 * _SLOTS])
    actions, task = _single_at(desk[8 * _SLOTS]), carray(_task_at(desk[7 * _SLOTS]), (1,))
    good = True
    for k in range(columns * ACTIONS):
        good &= size(float(actions[k])) < np.inf
    if good:
        for n in range(0, columns, lanes):
            take_action(mine, actions, episode, data, task[0], n, columns)
    return good


@pasted
def judge_all(desk, lanes):  # type: ignore[no-untyped-def]
    """Reward and observe what has been simulated; returns what `SWITCHED` says."""
    columns, mine = desk[2], rows(doubles(lanes), lanes)
    data, episode, seen = _double_at(desk[0]), _double_at(desk[6 * _SLOTS]), _single_at(desk[9 * _SLOTS])
    task, model = carray(_task_at(desk[7 * _SLOTS]), (1,)), carray(_model_at(desk[_SLOTS]), (1,))
    ground = carray(_double_at(desk[3 * _SLOTS]), (desk[3 * _SLOTS + 1], desk[3 * _SLOTS + 2]))
    what, ended = task[0], 0
    for n in range(0, columns, lanes):
        done, switch = judge_step(mine, data, episode, what, n, columns)
        if anywhere(done):
            ended |= 1
        if anywhere(switch):
            ended |= SWITCHED
        look(mine, data, episode, ground, model[0], seen, what, n, columns)
    return ended


@pasted
def step_all(desk, lanes, advance):  # type: ignore[no-untyped-def]
    """One control step; returns what `NOT_A_NUMBER` and `SWITCHED` say."""
    if not take_all(desk, lanes):
        return NOT_A_NUMBER
    task = carray(_task_at(desk[7 * _SLOTS]), (1,))
    advance(
        carray(_double_at(desk[0]), (desk[1], desk[2])),
        carray(_model_at(desk[_SLOTS]), (1,)),
        carray(_double_at(desk[2 * _SLOTS]), (desk[2 * _SLOTS + 1], desk[2 * _SLOTS + 2])),
        carray(_double_at(desk[3 * _SLOTS]), (desk[3 * _SLOTS + 1], desk[3 * _SLOTS + 2])),
        carray(_double_at(desk[4 * _SLOTS]), (desk[4 * _SLOTS + 1], desk[4 * _SLOTS + 2])),
        carray(_double_at(desk[5 * _SLOTS]), (desk[5 * _SLOTS + 1], desk[5 * _SLOTS + 2], desk[2] * 0)),
        task[0].h,
        task[0].substeps,
        desk[1] < 0,  # never: the account of energy is not kept here
    )
    return judge_all(desk, lanes)


@pasted
def look_all(desk, lanes):  # type: ignore[no-untyped-def]
    """Observe without a step."""
    columns, mine = desk[2], rows(doubles(lanes), lanes)
    data, episode, seen = _double_at(desk[0]), _double_at(desk[6 * _SLOTS]), _single_at(desk[9 * _SLOTS])
    task, model = carray(_task_at(desk[7 * _SLOTS]), (1,)), carray(_model_at(desk[_SLOTS]), (1,))
    ground = carray(_double_at(desk[3 * _SLOTS]), (desk[3 * _SLOTS + 1], desk[3 * _SLOTS + 2]))
    for n in range(0, columns, lanes):
        look(mine, data, episode, ground, model[0], seen, task[0], n, columns)


@kernel
def step_one(desk):  # type: ignore[no-untyped-def]
    """One control step of each environment by itself."""
    return step_all(desk, 1, advance_leg)


@kernel
def step_batch(desk):  # type: ignore[no-untyped-def]
    """One control step of `LANES` environments at a time."""
    return step_all(desk, LANES, advance_batch)


@kernel
def take_one(desk):  # type: ignore[no-untyped-def]
    """Actions of each environment by itself, for a solver that is not a kernel."""
    return take_all(desk, 1)


@kernel
def judge_one(desk):  # type: ignore[no-untyped-def]
    """What follows the physics of each environment by itself."""
    return judge_all(desk, 1)


@kernel
def look_one(desk):  # type: ignore[no-untyped-def]
    """Observations of each environment by itself."""
    look_all(desk, 1)


@kernel
def look_batch(desk):  # type: ignore[no-untyped-def]
    """Observations of `LANES` environments at a time."""
    look_all(desk, LANES)
