"""Parts of the kernels of a step that turn actions into commands, as the body does or a user's map."""

from __future__ import annotations

from typing import Any

from hoof_env.episodes.frames_kernel import put_action
from hoof_env.episodes.scene import Scene
from hoof_env.simd import Cell, Truth, Whole, full, loop, read, write
from hoof_env.simd.math import clip
from hoof_env.simd.user_functions import foreign
from hoof_env.tasks.episode import ACTIONS
from hoof_env.tasks.user_parts import ActionMap


def are_numbers(scene: Scene) -> Truth:
    """Return True if all actions are finite, in the blocks of other threads, too: either all threads take the
    step, or no thread does."""
    total = Cell(0.0)  # stays 0 unless an action is infinite or not a number
    for k in loop(scene.columns * scene.kind.action_size):
        total.value = total.value + (scene.actions[k] - scene.actions[k])
    found: Truth = total.value == 0.0
    return found


def apply(scene: Scene, n: Whole, scratch: Any) -> None:
    """Turn the actions of row n and, with lanes, of its neighbours into commands; `scratch` are the body's
    `scratch_size` rows."""
    put_action(scene, n)
    if scene.kind.action_map is not None:
        convert(scene, scene.kind.action_map, n)
    leg, episode = scene.leg(n), scene.episode(n)
    scene.kind.body.command(scene.task, scene.mapped, episode, leg, scene.layouts.gait, n, scratch)


def convert(scene: Scene, action_map: ActionMap, n: Whole) -> None:
    """Write the body's actions of row n and, with lanes, of its neighbours."""
    lanes = scene.lanes
    given = len(action_map.names)
    size = scene.kind.body.legs * ACTIONS
    actions = tuple(clip(read(scene.acted, n * given + k, given, lanes), 1.0) for k in range(given))
    compute = foreign(action_map.title, action_map.compute, count=size, legs=scene.layouts.legs)
    for k, action in enumerate(compute(actions, scene.inputs(n))):
        write(clip(full(action, lanes), 1.0), scene.mapped, n * size + k, size)
