"""The figures of an episode, `info["episode_summary"]`."""

from __future__ import annotations

from typing import Any

from hoof_env.envs.episode import FAILED, SUMS


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
