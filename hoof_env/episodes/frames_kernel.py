"""Parts of the kernels of a step that store observations and actions: delays and histories of both.

A row keeps frames, which are observations of one instant, and actions, the newest first. Each control step
moves them one place on. Both are numbers of one row after the other, so these loops take no lanes.
"""

from __future__ import annotations

from hoof_env.episodes.scene import Scene
from hoof_env.simd import Pointer, Whole, whole
from hoof_env.simd.math import clip


def move_on(past: Pointer, first: int, last: int, size: int) -> None:
    """Move blocks of `size` numbers from `first` on one place on; the block at `last` is lost."""
    for k in range(last * size - 1, first * size - 1, -1):
        past[k + size] = past[k]


def copy(to: Pointer, start: Pointer, size: int) -> None:
    """Copy `size` numbers."""
    for k in range(size):
        to[k] = start[k]


def remember(scene: Scene, n: Whole) -> None:
    """Make room for the frame of this step and keep its action, in row n and its neighbours."""
    task = scene.task
    if task.frames > 0:
        row_size = task.frames * task.frame_size
        for lane in range(scene.lanes):
            move_on(scene.frames + (n + lane) * row_size, task.first_frame, task.frames - 1, task.frame_size)
    if task.has_actions:
        row_size = task.kept_actions * task.action_size
        for lane in range(scene.lanes):
            row = n + lane
            past = scene.past_actions + row * row_size
            move_on(past, 0, task.kept_actions - 1, task.action_size)
            for k in range(task.action_size):
                past[k] = clip(scene.actions[row * task.action_size + k], 1.0)


def put_action(scene: Scene, n: Whole) -> None:
    """Put the action that acts now in its place, in row n and its neighbours."""
    task = scene.task
    if task.has_actions:
        size = task.action_size
        for lane in range(scene.lanes):
            row = n + lane
            place = row * task.kept_actions + whole(scene.episode_of(row).action_delay)
            copy(scene.acted + row * size, scene.past_actions + place * size, size)


def publish(scene: Scene, n: Whole) -> None:
    """Observe earlier frames and actions, in row n and its neighbours."""
    task = scene.task
    if task.frames > 0:
        size = task.frame_size
        for lane in range(scene.lanes):
            row = n + lane
            place = row * task.frames + task.first_frame + whole(scene.episode_of(row).observation_delay)
            observed = scene.observations + row * task.observation_size
            copy(observed, scene.frames + place * size, task.history * size)
    if task.last_actions > 0:
        size = task.action_size
        for lane in range(scene.lanes):
            row = n + lane
            observed = scene.observations + (row * task.observation_size + task.history * task.frame_size)
            copy(observed, scene.past_actions + row * task.kept_actions * size, task.last_actions * size)
