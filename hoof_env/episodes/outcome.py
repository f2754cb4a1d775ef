"""Outcome of a control step, and end of the episode: parts of the kernels of `step`."""

from __future__ import annotations

from typing import Any

from hoof_env.dynamics.layout import LegMemory, StrideSums, TrunkMemory
from hoof_env.dynamics.limits import has_moved
from hoof_env.simd import Lanes, Mask, Number, block_at, maximum, minimum, rounded, where
from hoof_env.tasks.episode import FAILED, TRUNCATED, Episode, Memories
from hoof_env.tasks.reward import BEARING, MAX_STRIDE, Outcome


def credit_bearing(episode: Episode, impulse: Lanes, seconds: Number) -> Lanes:
    """Return the part of an impulse, divided by the weight, that is credited as bearing [s]: all within the
    allowance, less the part beyond it. The allowance grows with time, and the impulse uses it up; see
    `reward.BEARING`."""
    allowance = minimum(episode.allowance + BEARING * seconds, BEARING * MAX_STRIDE)
    within = minimum(impulse, allowance)
    episode.allowance = allowance - within
    return within - (impulse - within)


def sum_up(first_leg: LegMemory, layouts: Memories, works: Mask, sums: StrideSums) -> None:
    """Write the sums over all legs of the step into `sums`, 0 where the engine failed."""
    for k in range(layouts.sums):
        total = first_leg.sums[k]
        for i in range(1, layouts.legs):
            other = block_at(first_leg, i).sums[k]
            total = put_together(layouts, k, total, other)
        sums[k] = where(works, total, 0.0)


def put_together(layouts: Memories, k: int, one: Lanes, other: Lanes) -> Lanes:
    """Return the sum of two values of the k-th of `StrideSums`, of a peak the larger value."""
    if (layouts.peaks >> k) & 1:
        return maximum(one, other)
    return one + other


def find_outcome(
    task: Any, trunk: TrunkMemory, leg: LegMemory, episode: Episode, layouts: Memories, sums: StrideSums
) -> Outcome:
    """Return the outcome of the step; `sums` is memory for `StrideSums`."""
    # Where the engine failed the state is the one before the step: nothing is rewarded.
    works = has_moved(trunk.result)
    x = trunk.report.place.real
    y = trunk.report.place.imag
    sum_up(leg, layouts, works, sums)
    progress = x - episode.x_before
    # A fixed trunk does not travel: what counts is how far hooves in stance slide backward.
    if task.is_fixed:
        progress = leg.sums.backward_travel
    episode.x_before = x
    seconds = where(works, task.dt, 0.0)
    credited = credit_bearing(episode, sums.normal_impulse / episode.weight, seconds)
    return Outcome(
        seconds=seconds,
        progress=where(works, progress, 0.0),
        commanded_progress=rounded(task.dt * episode.target),
        sums=sums,
        credited=credited,
        failed=where((trunk.result == 0.0) & (y > task.lowest) & (y < task.highest), 0.0, 1.0),
        episode_seconds=task.episode_seconds,
        weight=episode.weight,
        trunk=trunk,
        leg=leg,
        episode=episode,
    )


def add_up(outcome: Outcome, episode: Episode, layouts: Memories) -> None:
    """Add the step to the sums of the episode."""
    episode.time = episode.time + outcome.seconds
    episode.distance = episode.distance + outcome.progress
    episode.commanded = episode.commanded + outcome.commanded_progress
    for k in range(layouts.sums):
        episode.sums[k] = put_together(layouts, k, episode.sums[k], outcome.sums[k])


def decide(task: Any, outcome: Outcome, episode: Episode) -> tuple[Mask, Mask, Mask]:
    """Count the step, and return masks of the rows in which the episode ends, in which another speed is
    commanded from the next step on, and in which the trunk is pushed after this step."""
    steps = episode.steps + 1.0
    late = where(steps >= task.episode_steps, float(TRUNCATED), 0.0)
    # A failure in the last step counts as a failure, not as the end of the time.
    ended = where(outcome.failed > 0.0, float(FAILED), late)
    switched = steps >= episode.switch
    episode.steps = steps
    episode.ended = ended
    episode.target = where(switched, episode.next_target, episode.target)
    return ended > 0.0, switched, steps >= episode.push_at
