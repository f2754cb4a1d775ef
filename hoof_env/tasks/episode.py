"""What an episode keeps between its steps, and what does not change in it: rows of memory and a record, both
read and written by the kernels of `step`."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from hoof_env.dynamics.form import engine_layout
from hoof_env.dynamics.layout import PEAKS, PLAIN, Features, StrideSums
from hoof_env.gait import PARAMETERS
from hoof_env.simd.layout import Block, Constants, Layout, Row, Size
from hoof_env.tasks.reward import TERMS

ACTIONS = len(PARAMETERS)
"""Of a leg."""

FAILED = 1
TRUNCATED = 2
"""How an episode ended, in the place of 0."""

ACTION = Size("action", ACTIONS)
REWARD = Size("reward", len(TERMS))


class Episode(Layout):
    """Memory of an episode."""

    steps: Row  # control steps so far
    allowance: Row  # impulse over the weight that bearing is still paid for [s], see `reward.BEARING`
    x_before: Row  # x of the trunk before this step [m]
    target: Row  # commanded speed [m/s]; infinite if there is none
    weight: Row  # of trunk and leg [N]
    time: Row  # simulated [s]
    distance: Row  # forward [m]
    sums: StrideSums  # of all legs and steps so far
    terms: Annotated[Block, REWARD]  # of the last reward
    ended: Row  # 0, `FAILED` or `TRUNCATED`
    switch: Row  # the control step after which another speed is commanded
    next_target: Row  # and which [m/s]


@cache
def episode_layout(layout: Any, terms: int, features: Features = PLAIN, legs: int = 1) -> Any:
    """Return the layout of an episode's memory, `Episode` or one with more fields, sized for a number of
    terms and legs and an engine with these features."""
    return features.of(layout).sized(action=legs * ACTIONS, reward=terms)


class _Memories(NamedTuple):
    episode: Any
    trunk: Any
    leg: Any
    trunk_rows: int
    legs: int
    gait: int
    has_limits: bool
    stride_sums: Any
    sums: int
    peaks: int


class Memories(Constants, _Memories):
    """Layouts of what a step works on, how many rows the trunk's has, how many legs there are and how many
    gait parameters each has, whether the engine has limits, the layout of `StrideSums`, how many there are
    and which of these are peaks."""


@cache
def memories_of(layout: Any, terms: int, features: Features, legs: int = 1) -> Memories:
    """Return the layouts of an engine with these features and of episodes with a number of terms and legs."""
    form = engine_layout(features)
    return Memories(
        episode_layout(layout, terms, features, legs), form.trunk_memory, form.leg_memory,
        form.trunk_rows, legs, form.gait, form.has_limits, features.of(StrideSums), form.sums, PEAKS,
    )  # fmt: skip


def task_type(terms: int, entries: int, gait: int = ACTIONS, more: tuple[Any, ...] = ()) -> np.dtype[Any]:
    """Return the record type of a task's constants, with `more` fields of the body's own."""
    return np.dtype(
        [
            ("reach", "f8", (gait,)), ("lead", "f8"),  # of an action of 1; of a command [s]
            ("half", "f8", (gait,)),  # of a range
            ("low", "f8", (gait,)), ("high", "f8", (gait,)),  # within these
            ("middle", "f8", (gait,)), ("rate_bound", "f8", (gait,)),  # (value - middle) / half is observed
            ("weights", "f8", (terms,)), ("episode_seconds", "f8"),  # of the reward
            ("h", "f8"), ("substeps", "i8"), ("dt", "f8"), ("episode_steps", "i8"),
            ("height", "f8"), ("lowest", "f8"), ("highest", "f8"),  # of the trunk: nominal and extreme [m]
            ("stays", "?"),  # a fixed trunk
            ("observation_size", "i8"),
            ("observation_columns", "i8", (entries,)),  # of the observation; -1: not observed
            *more,
        ],
        align=True,
    )  # fmt: skip
