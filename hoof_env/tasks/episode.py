"""Memory of an episode, which changes from step to step, and record of a task's constants. The kernels of
`episodes.step` read both and write the first."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from hoof_env.dynamics.layout import (
    PLAIN,
    Features,
    LegMemory,
    StrideSums,
    TrunkMemory,
    engine_layout,
    stride_peaks,
)
from hoof_env.gait import PARAMETERS
from hoof_env.simd.layout import Block, Layout, Row, Size, Vector, extended
from hoof_env.tasks.reward import TERMS
from hoof_env.tasks.user_parts import Declarations

ACTIONS = len(PARAMETERS)
"""Number of actions of one leg."""

FAILED = 1
TRUNCATED = 2
"""Values of `Episode.ended` at the end of an episode."""

ACTION = Size("action", ACTIONS)
REWARD = Size("reward", len(TERMS))

NOTHING = Declarations()
"""Declarations of a task without constants and state."""

MAX_PARTS = 3
"""Largest number of parts of a control step: an action and an observation may each divide it."""


class Episode(Layout):
    """Memory of an episode. Units are in the comments."""

    # Saved states hold these rows: with another row, or another order, older states are not readable.
    steps: Row  # control steps so far
    allowance: Row  # impulse / weight that bearing is still paid for [s]; see `reward.BEARING`
    x_before: Row  # x of the trunk before this step [m]
    target: Row  # commanded speed [m/s]; infinite without a command
    weight: Row  # weight of trunk and leg [N]
    time: Row  # simulated time [s]
    distance: Row  # forward travel [m]
    sums: StrideSums  # sums over all legs and steps so far
    terms: Annotated[Block, REWARD]  # terms of the last reward
    ended: Row  # 0, `FAILED` or `TRUNCATED`
    switch: Row  # control step after which another speed is commanded
    next_target: Row  # that speed [m/s]
    commanded: Row  # distance at the commanded speeds so far [m]; infinite without a command
    strength: Row  # factor of all disturbances [-]
    observation_delay: Row  # whole control steps
    action_delay: Row  # whole control steps
    noise_key: Row  # key of the random numbers of noise and bias; see `simd.noise`
    push_at: Row  # control step after which the trunk is pushed next; infinite if it is not
    next_push: Vector  # impulse of that push [N s]


@cache
def episode_layout(
    layout: type[Episode],
    terms: int,
    features: Features = PLAIN,
    legs: int = 1,
    declared: Declarations = NOTHING,
) -> type[Episode]:
    """Return the layout of an episode's memory, sized for an engine.

    Args:
        layout: `Episode` or a subclass with more fields.
        terms: number of the reward's terms.
        features: features of the engine.
        legs: number of legs.
        declared: declarations of the terms; their state is the last field, `own`.
    """
    made: type[Episode] = features.of(layout).sized(action=legs * ACTIONS, reward=terms)
    if not declared.state:
        return made
    longer: type[Episode] = extended(
        made, "own", {term: dict.fromkeys(names, Row) for term, names in declared.state}
    )
    return longer


class Memories(NamedTuple):
    """Layouts of the memory that a step works on, constants of its kernels.

    Attributes:
        episode, trunk, leg: layouts of the memory of episode, trunk and leg.
        trunk_rows: number of rows of the trunk's memory.
        legs: number of legs.
        gait: number of gait parameters of a leg.
        has_limits: True if the engine has limits.
        stride_sums: layout of `StrideSums`.
        sums: number of stride sums.
        peaks: bit mask of the stride sums that are peaks.
        own_first, own_rows: first row of the terms' state in the memory of an episode, and number of rows.
    """

    episode: type[Episode]
    trunk: type[TrunkMemory]
    leg: type[LegMemory]
    trunk_rows: int
    legs: int
    gait: int
    has_limits: bool
    stride_sums: type[StrideSums]
    sums: int
    peaks: int
    own_first: int
    own_rows: int


@cache
def memories_of(
    layout: type[Episode],
    terms: int,
    features: Features,
    legs: int = 1,
    declared: Declarations = NOTHING,
) -> Memories:
    """Return the layouts of an engine with these features and of episodes with a number of terms and legs."""
    form = engine_layout(features)
    episode = episode_layout(layout, terms, features, legs, declared)
    state = episode.rows("own") if declared.state else slice(0, 0)
    return Memories(
        episode=episode,
        trunk=form.trunk_memory,
        leg=form.leg_memory,
        trunk_rows=form.trunk_rows,
        legs=legs,
        gait=form.gait,
        has_limits=form.has_limits,
        stride_sums=features.of(StrideSums),
        sums=form.sums,
        peaks=sum(is_peak << k for k, is_peak in enumerate(stride_peaks(features))),
        own_first=state.start,
        own_rows=state.stop - state.start,
    )


def task_type(terms: int, entries: int, gait: int = ACTIONS, more: tuple[Any, ...] = ()) -> np.dtype[Any]:
    """Return the record type of a task's constants.

    Args:
        terms: number of the reward's terms.
        entries: number of slots of the observation; see `episodes.scene.Slots`.
        gait: number of gait parameters of a leg.
        more: further fields of the body's own.
    """
    return np.dtype(
        [
            ("reach", "f8", (gait,)),  # distance at which an action of 1 puts the command; see `OneLeg.reach`
            ("lead", "f8"),  # time by which a command is ahead of the gait [s]; see `one_leg.lead_of`
            ("half", "f8", (gait,)),  # half range of a parameter, for a horse span of an action
            ("low", "f8", (gait,)),  # lowest command
            ("high", "f8", (gait,)),  # highest command
            ("middle", "f8", (gait,)),  # middle of the range: (value - middle) / half is observed
            ("rate_bound", "f8", (gait,)),  # largest rate of a parameter, by which its rate is scaled
            ("weights", "f8", (terms,)),  # weights of the reward's terms
            ("episode_seconds", "f8"),
            ("h", "f8"),  # substep [s]
            ("substeps", "i8"),  # substeps of a control step
            ("dt", "f8"),  # control step [s]
            ("episode_steps", "i8"),  # control steps after which an episode is truncated
            ("height", "f8"),  # nominal height of the trunk [m]
            ("lowest", "f8"),  # height of the trunk at or below which an episode fails [m]
            ("highest", "f8"),  # height of the trunk at or above which an episode fails [m]
            ("is_fixed", "?"),  # True if the trunk cannot move
            ("observation_size", "i8"),
            ("observation_columns", "i8", (entries,)),  # column of the entry in each slot; -1: not observed
            ("frame_size", "i8"),  # numbers that are observed of one instant, a frame
            ("frames", "i8"),  # frames stored of a row; 0: the observation is the present frame
            ("first_frame", "i8"),  # stored frame that is observed without delay, 1 for a frame within a step
            ("history", "i8"),  # frames that are observed
            ("has_actions", "?"),
            ("action_size", "i8"),  # numbers of an action
            ("kept_actions", "i8"),  # actions stored of a row
            ("last_actions", "i8"),  # actions that are observed
            ("has_privileged", "?"),
            (
                "privileged_columns",
                "i8",
                (entries,),
            ),  # column of the true number of each slot; -1: not observed
            ("parts", "i8"),  # parts of a control step; see `episodes.delays.Parts`
            ("part_substeps", "i8", (MAX_PARTS,)),
            ("acting_part", "i8"),  # part at whose start an action takes effect
            ("seeing_part", "i8"),  # part after which a frame within the step is observed; -1: no such frame
            ("is_noisy", "?"),  # True with noise or bias
            ("noise", "f8", (entries,)),  # largest error of each slot in a step
            ("bias", "f8", (entries,)),  # largest error of each slot that stays for an episode
            ("usual_weight", "f8"),  # weight of trunk and legs by the settings [N]
            ("usual_stiffness", "f8"),  # stiffness of the ground by the settings [N/m^n]
            ("usual_friction", "f8"),  # friction by the settings [-]
            ("force_threshold", "f8"),  # load of a hoof point below which it is observed as 0 [N]
            *more,
        ],
        # The kernels read every field with one aligned load.
        align=True,
    )
