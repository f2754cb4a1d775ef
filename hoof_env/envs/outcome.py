"""What a control step brought, and whether the episode goes on: see `step`."""

from __future__ import annotations

from hoof_env.dynamics.limits import has_moved
from hoof_env.simd import block_at, lane_of, maximum, minimum, where
from hoof_env.simd.compile import inline_llvm
from hoof_env.tasks.episode import FAILED, TRUNCATED
from hoof_env.tasks.reward import BEARING, LONGEST_STRIDE, Outcome


@inline_llvm
def bear(episode, impulse, seconds):  # type: ignore[no-untyped-def]
    """What of an impulse over the weight [s] bearing is paid for: all within the allowance, and what goes
    beyond it is taken off again. The allowance grows with time and is used up by the impulse."""
    allowance = minimum(episode.allowance + BEARING * seconds, BEARING * LONGEST_STRIDE)
    borne = minimum(impulse, allowance)
    episode.allowance = allowance - borne
    return borne - (impulse - borne)


@inline_llvm
def sum_up(first_leg, layouts):  # type: ignore[no-untyped-def]
    """What all legs did in the step, and the highest of their forces."""
    sums = first_leg.sums
    slip = first_leg.sums.slip
    running_peak_increase = sums.running_peak_increase
    peak_grf_increase = sums.peak_grf_increase
    loading_rate_increase = sums.loading_rate_increase
    highest_grf = sums.highest_grf
    positive_work = sums.positive_work
    normal_impulse = sums.normal_impulse
    loaded_time = sums.loaded_time
    stances = sums.stances
    for i in range(1, layouts.legs):
        sums = block_at(first_leg, i).sums
        running_peak_increase = running_peak_increase + sums.running_peak_increase
        peak_grf_increase = peak_grf_increase + sums.peak_grf_increase
        loading_rate_increase = loading_rate_increase + sums.loading_rate_increase
        highest_grf = maximum(highest_grf, sums.highest_grf)
        positive_work = positive_work + sums.positive_work
        normal_impulse = normal_impulse + sums.normal_impulse
        loaded_time = loaded_time + sums.loaded_time
        stances = stances + sums.stances
        slip = slip + sums.slip
    return (
        running_peak_increase, peak_grf_increase, loading_rate_increase, highest_grf, positive_work,
        normal_impulse, loaded_time, stances, slip,
    )  # fmt: skip


@inline_llvm
def find_outcome(task, trunk, leg, episode, layouts):  # type: ignore[no-untyped-def]
    """What the step brought."""
    works = has_moved(trunk.result)  # else the state is of before: nothing is paid
    x = trunk.report.place.real
    y = trunk.report.place.imag
    running, peak, loading, highest, work, impulse, loaded, stances, slip = sum_up(leg, layouts)
    progress = x - episode.x_before
    if task.stays:
        progress = leg.sums.travel
    episode.x_before = x
    seconds = where(works, task.dt, 0.0)
    impulse = where(works, impulse, 0.0)
    borne = bear(episode, impulse / episode.weight, seconds)
    return Outcome(
        seconds=seconds,
        progress=where(works, progress, 0.0),
        commanded_progress=task.dt * episode.target,
        running_peak_increase=where(works, running, 0.0),
        peak_grf_increase=where(works, peak, 0.0),
        loading_rate_increase=where(works, loading, 0.0),
        highest_grf=where(works, highest, 0.0),
        positive_work=where(works, work, 0.0),
        normal_impulse=impulse,
        borne=borne,
        loaded_time=where(works, loaded, 0.0),
        stances=where(works, stances, 0.0),
        slip=where(works, slip, 0.0),
        failed=where((trunk.result == 0.0) & (y > task.lowest) & (y < task.highest), 0.0, 1.0),
        episode_seconds=task.episode_seconds,
        weight=episode.weight,
        trunk=trunk,
        leg=leg,
        episode=episode,
    )


@inline_llvm
def add_up(outcome, episode):  # type: ignore[no-untyped-def]
    """The sums of the episode."""
    episode.time = episode.time + outcome.seconds
    episode.distance = episode.distance + outcome.progress
    episode.work = episode.work + outcome.positive_work
    episode.impulse = episode.impulse + outcome.normal_impulse
    episode.loaded_time = episode.loaded_time + outcome.loaded_time
    episode.stances = episode.stances + outcome.stances
    episode.peak_sum = episode.peak_sum + outcome.peak_grf_increase
    episode.loading_rate_sum = episode.loading_rate_sum + outcome.loading_rate_increase
    episode.highest = maximum(episode.highest, outcome.highest_grf)
    episode.slip = episode.slip + outcome.slip


@inline_llvm
def decide(task, outcome, episode):  # type: ignore[no-untyped-def]
    """Whether the episode ends, and whether another speed is commanded from the next step on."""
    steps = episode.steps + 1.0
    late = where(steps >= task.episode_steps, float(TRUNCATED), 0.0)
    ended = where(outcome.failed > 0.0, float(FAILED), late)
    switched = steps >= episode.switch
    episode.steps = steps
    episode.ended = ended
    episode.target = where(switched, episode.next_target, episode.target)
    return ended > 0.0, switched


@inline_llvm
def outcome_of_one(outcome, lane, trunk, leg, episode):  # type: ignore[no-untyped-def]
    """One lane of an `Outcome`, ordinary numbers."""
    return Outcome(
        lane_of(outcome.seconds, lane), lane_of(outcome.progress, lane),
        lane_of(outcome.commanded_progress, lane), lane_of(outcome.running_peak_increase, lane),
        lane_of(outcome.peak_grf_increase, lane), lane_of(outcome.loading_rate_increase, lane),
        lane_of(outcome.highest_grf, lane), lane_of(outcome.positive_work, lane),
        lane_of(outcome.normal_impulse, lane), lane_of(outcome.borne, lane),
        lane_of(outcome.loaded_time, lane), lane_of(outcome.stances, lane), lane_of(outcome.slip, lane),
        lane_of(outcome.failed, lane),
        outcome.episode_seconds, lane_of(outcome.weight, lane), trunk, leg, episode,
    )  # fmt: skip
