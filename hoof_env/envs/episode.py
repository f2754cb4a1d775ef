"""What an environment remembers of its episode, besides the engine's memory, and the figures of the
episode."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from hoof_env.envs.reward import TERMS
from hoof_env.gait import PARAMETERS
from hoof_env.simd.layout import Block, Layout, Row

ACTIONS = len(PARAMETERS)
FAILED, TRUNCATED = 1, 2
"""How an episode ended, in the place of 0."""

SUMS = ("time", "distance", "work", "impulse", "loaded_time", "stances", "peak_sum", "highest")
"""Fields of `Episode` that begin at 0 and are added to."""


class Episode(Layout):
    """Memory of an episode."""

    action: Annotated[Block, ACTIONS]  # the last one, clipped to its limits
    steps: Row  # control steps so far
    x_before: Row  # x of the trunk before this step [m]
    target: Row  # commanded speed [m/s]; infinite if there is none
    weight: Row  # of trunk and leg [N]
    time: Row  # simulated [s]
    distance: Row  # forward [m]
    work: Row  # positive, of both drives [J]
    impulse: Row  # of the normal force [N s]
    loaded_time: Row  # [s]
    stances: Row
    peak_sum: Row  # of the stances' peaks [N]
    highest: Row  # force of the episode [N]
    terms: Annotated[Block, len(TERMS)]  # of the last reward
    ended: Row  # 0, `FAILED` or `TRUNCATED`
    switch: Row  # the control step after which another speed is commanded
    next_target: Row  # and which [m/s]


@cache
def episode_layout(terms: int) -> Any:
    """`Episode` with room for so many terms."""
    if terms == len(TERMS):
        return Episode
    fields = {**Episode.__annotations__, "terms": Annotated[Block, terms]}
    make: Any = type(Layout)
    return make(f"Episode{terms}", (Layout,), {"__annotations__": fields, "__module__": __name__})


def summary_of(now: Any, env: int, dt: float) -> dict[str, float]:
    """Figures of the episode of an environment from `EpisodeBatch.now` and the control step [s].

    seconds, distance_m, speed_m_s, peak_grf_n (highest of the episode), mean_grf_n (normal force over the
    whole time), stance_peak_sum_n, stances, duty_factor, drive_work_j (braking is not recovered),
    cost_of_transport (work per weight and distance; infinite without forward progress), weight_share (mean
    normal force over weight: what the leg bore), support_share (the rest: what the rail or the suspension
    bore), failed (0 or 1).
    """
    seconds, distance, work, impulse, loaded, stances, peaks, highest = (
        float(getattr(now, name)[env]) for name in SUMS
    )
    weight, time = float(now.weight[env]), max(seconds, 1e-12)
    mean = impulse / time
    return {
        "seconds": round(round(seconds / dt) * dt, 12),  # a sum of steps, each rounded, is 9.99..., not 10
        "distance_m": distance,
        "speed_m_s": distance / time,
        "peak_grf_n": highest,
        "mean_grf_n": mean,
        "stance_peak_sum_n": peaks,
        "stances": stances,
        "duty_factor": loaded / time,
        "drive_work_j": work,
        "cost_of_transport": work / (weight * distance) if distance > 0 else float("inf"),
        "weight_share": mean / weight,
        "support_share": 1 - mean / weight,
        "failed": float(now.ended[env] == FAILED),
    }
