"""Parts of the kernels of a step that keep what was observed and asked for: delays of observations and
actions, and histories of both.

A row keeps frames, which are observations of one instant, and actions, the newest first. Each control step
moves them one place on. Both are numbers of one row after the other, so these loops take no lanes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hoof_env.envs.addresses import AT, memories
from hoof_env.simd import loop, whole
from hoof_env.simd.compile import inline_llvm, inline_source
from hoof_env.simd.math import clip
from hoof_env.simd.memory import singles_at
from hoof_env.tasks.episode import Memories


@inline_llvm
def move_on(kept, first, last, size):  # type: ignore[no-untyped-def]
    """Move blocks of `size` numbers from `first` on one place on; the block at `last` is lost."""
    for k in range(last * size - 1, first * size - 1, -1):  # known when the kernel is traced
        kept[k + size] = kept[k]


@inline_llvm
def copied(to, start, of, begin, size):  # type: ignore[no-untyped-def]
    """Copy `size` numbers from of[begin] on to to[start] on; return the place behind them."""
    for k in range(size):
        to[start + k] = of[begin + k]
    return start + size


@inline_source
def remember(addresses, lanes, task, n):  # type: ignore[no-untyped-def]
    """Make room for the frame of this step and keep its action, in row n and its neighbours."""
    if task.frames > 0:
        row_size = task.frames * task.frame_size
        for lane in range(lanes):
            row = n + lane
            frames = singles_at(addresses[AT.frames] + 4 * row * row_size)
            move_on(frames, task.first_frame, task.frames - 1, task.frame_size)
    if task.keeps_actions:
        row_size = task.kept_actions * task.action_size
        asked = singles_at(addresses[AT.actions])
        for lane in range(lanes):
            row = n + lane
            kept = singles_at(addresses[AT.past_actions] + 4 * row * row_size)
            move_on(kept, 0, task.kept_actions - 1, task.action_size)
            for k in range(task.action_size):
                kept[k] = clip(asked[row * task.action_size + k], 1.0)


def delayed_actions(layouts: Memories) -> Callable[..., Any]:
    """Return a part of kernels that puts the action that acts now in its place, in row n and its
    neighbours."""

    @inline_source
    def put_action(addresses, lanes, task, n):  # type: ignore[no-untyped-def]
        if task.keeps_actions:
            size = task.action_size
            kept = singles_at(addresses[AT.past_actions])
            acted = singles_at(addresses[AT.acted])
            for lane in range(lanes):
                row = n + lane
                _, _, episode = memories(addresses, 0, layouts, row)
                place = row * task.kept_actions + whole(episode.action_delay)
                copied(acted, row * size, kept, place * size, size)

    return put_action


def publisher(layouts: Memories) -> Callable[..., Any]:
    """Return a part of kernels that observes kept frames and actions, in row n and its neighbours."""

    @inline_source
    def publish(addresses, lanes, task, n):  # type: ignore[no-untyped-def]
        observations = singles_at(addresses[AT.observations])
        if task.frames > 0:
            frames = singles_at(addresses[AT.frames])
            size = task.frame_size
            for lane in range(lanes):
                row = n + lane
                _, _, episode = memories(addresses, 0, layouts, row)
                place = row * task.frames + task.first_frame + whole(episode.observation_delay)
                copied(observations, row * task.observation_size, frames, place * size, task.history * size)
        if task.last_actions > 0:
            kept = singles_at(addresses[AT.past_actions])
            size = task.action_size
            for lane in range(lanes):
                row = n + lane
                to = row * task.observation_size + task.history * task.frame_size
                copied(observations, to, kept, row * task.kept_actions * size, task.last_actions * size)

    return publish
