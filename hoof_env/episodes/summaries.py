"""Infos of a batch of episodes, summaries of episodes that ended, and reasons of failures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.layout import stride_sums
from hoof_env.dynamics.parts import broken
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.episodes.infos import name_columns
from hoof_env.tasks.episode import FAILED, TRUNCATED

Floats = NDArray[np.float64]

SUCCESS_SPEED = 0.9
"""Least distance of a successful episode relative to the commanded distance, where a speed is commanded
[-]."""

SUMMARY = {
    "seconds": ("s", "how long it lasted"),
    "distance_m": ("m", "forward travel"),
    "speed_m_s": ("m/s", "its mean speed"),
    "highest_grf_n": ("N", "highest resultant GRF of any substep"),
    "mean_normal_n": ("N", "mean normal force over the whole time"),
    "stance_peak_sum_n": ("N", "sum of the peaks of all stances"),
    "stances": ("-", "how many"),
    "loading_rate_n_s": (
        "N/s",
        "steepest rise of the normal force in a stance while its peak grew, mean of all stances",
    ),
    "duty_factor": ("-", "part of the time with load on the hoof, mean of all legs"),
    "slip_m": ("m", "distance that hooves slide in a stance, in both directions, mean of all stances"),
    "positive_work_j": ("J", "positive work of both drives"),
    "cost_of_transport": ("-", "work per weight and distance; infinite without forward progress"),
    "weight_share": ("-", "mean normal force divided by the weight: the share of it that the leg bore"),
    "support_share": (
        "-",
        "the rest, which rail or suspension bore: a mean, for a suspension also pulls",
    ),
    "failed": ("-", "0 or 1"),
    "success": (
        "-",
        f"1 if it lasted, at {SUCCESS_SPEED} of the commanded speed or more, if there is one;"
        " `target_speed` counts as commanded",
    ),
}
"""Figures of an episode by name: unit and meaning, as the manual has them. `summaries_of` computes them. A
horse's mean force and sum of peaks are sums over its legs, its duty factor is the mean of its legs."""


def infos_of(batch: EpisodeBatch, ended: bool = True) -> dict[str, NDArray[Any]]:
    """Return the infos of all environments: start values, measurements, and terms of the last reward.

    Args:
        batch: an `EpisodeBatch`.
        ended: False if no episode ended, so that all environments were simulated.

    Returns:
        Arrays by name, shape (num_envs,); "gait", "measured", "unweighted" and "parameters" are
        `NamedArray` of shape (num_envs, numbers).
    """
    n = batch.num_envs
    values = batch.rows.start_values.copy()
    memory = batch.engine.arrays[0]
    measured = batch.measurements.read(memory[:, :n])
    for env, before_push in batch.unpushed.items():
        measured[:, env] = before_push
    # A step that failed was taken back: it has no sums.
    if ended:
        failed = broken(batch.engine.results)
        measured[np.ix_(batch.measurements.last_step, failed)] = 0.0
    body = batch.plan.body
    first = len(batch.plan.start_names)
    names = body.start_names
    infos: dict[str, NDArray[Any]] = dict(zip(names, values, strict=False))
    infos["gait"] = name_columns(values[len(names) : first].T, body.gait_names)
    if batch.drawn_names:
        infos["parameters"] = name_columns(values[first:].T, tuple(batch.drawn_names))
    if batch.plan.commands.speeds:
        infos["target_speed"] = batch.rows.named.target[:n].copy()
    infos["measured"] = measured.T.view(batch.measurements.kind)
    infos.update(zip(batch.terms, batch.rows.named.terms[:, :n].copy(), strict=True))
    infos["unweighted"] = name_columns(batch.rows.unweighted[:, :n].copy().T, batch.term_names)
    if batch.plan.costs.names:
        infos["cost"] = batch.rows.costs.sum(axis=0)
        infos.update(zip(batch.plan.costs.keys, batch.rows.costs.copy(), strict=True))
    return infos


def summary_of(batch: EpisodeBatch, env: int) -> dict[str, float]:
    """Return the figures of one episode by name; see `summaries_of`."""
    return {name: float(values[0]) for name, values in summaries_of(batch, [env]).items()}


def summaries_of(batch: EpisodeBatch, envs: Sequence[int] | NDArray[np.int64]) -> dict[str, Floats]:
    """Return the figures `SUMMARY` of the episodes of some environments, by name, shape (len(envs),) each."""
    seconds = batch.rows.named.time[envs]
    distance = batch.rows.named.distance[envs]
    names = stride_sums(batch.engine.features)
    total = dict(zip(names, batch.rows.named.sums[:, envs], strict=True))
    work = total["positive_work"]
    stances = total["stances"]
    weight = batch.rows.named.weight[envs]
    # An episode of which no step was simulated has no duration.
    time = np.maximum(seconds, 1e-12)
    mean = total["normal_impulse"] / time
    each = np.maximum(stances, 1.0)
    steps = np.rint(seconds / batch.plan.dt)
    cost = np.full(len(work), np.inf)
    np.divide(work, weight * distance, out=cost, where=distance > 0)
    costs = dict(zip(batch.plan.costs.keys, batch.rows.cost_sums[:, envs], strict=True))
    return {
        # Rounded, because the sum of the steps of ten seconds is 9.99...
        "seconds": np.array([round(count * batch.plan.dt, 12) for count in steps]),
        "distance_m": distance,
        "speed_m_s": distance / time,
        "highest_grf_n": total["highest_grf"],
        "mean_normal_n": mean,
        "stance_peak_sum_n": total["peak_grf_increase"],
        "stances": stances,
        "loading_rate_n_s": total["loading_rate_increase"] / each,
        "duty_factor": total["loaded_time"] / time / batch.plan.legs,
        "slip_m": total["slip"] / each,
        "positive_work_j": work,
        "cost_of_transport": cost,
        "weight_share": mean / weight,
        "support_share": 1 - mean / weight,
        "failed": (batch.rows.named.ended[envs] == FAILED).astype(np.float64),
        "success": is_success(batch, envs).astype(np.float64),
        **({"cost": np.sum([*costs.values()], axis=0), **costs} if costs else {}),
    }


def is_success(batch: EpisodeBatch, envs: Sequence[int] | NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return a mask of the environments whose episodes ended at the time limit, at `SUCCESS_SPEED` of the
    commanded speed or more, on average; where a target is only the speed up to which progress is paid, it
    counts as commanded."""
    lasted = batch.rows.named.ended[envs] == TRUNCATED
    commanded = batch.rows.named.commanded[envs]
    asked = SUCCESS_SPEED * np.where(np.isfinite(commanded), commanded, -np.inf)
    successful: NDArray[np.bool_] = lasted & (batch.rows.named.distance[envs] >= asked)
    return successful


TIME_LIMIT = "time limit"
"""Reason in `info["end"]` of an episode that did not fail."""


def end_of(batch: EpisodeBatch, env: int) -> str:
    """Return why an episode ended, in words."""
    return failure_of(batch, env) if batch.rows.named.ended[env] == FAILED else TIME_LIMIT


def ending_of(batch: EpisodeBatch, env: int) -> dict[str, Any]:
    """Return the entries of the info of one environment whose episode ends.

    The reason is the name of a flag: where other steps lack an entry libraries pad a number with 0, but words
    with None, which Tianshou's trainer refuses as NaN.
    """
    summary = summary_of(batch, env)
    success = bool(summary["success"])
    return {"episode_summary": summary, "end": {end_of(batch, env): True}, "is_success": success}


def failure_of(batch: EpisodeBatch, env: int) -> str:
    """Return the reason why an episode failed, in words."""
    # The engine of one leg has no limits: the kernel of a step checks the height of its trunk.
    return batch.engine.failure(env) or "the trunk left its range of heights"


def endings_of(batch: EpisodeBatch, done: NDArray[np.bool_]) -> dict[str, Any]:
    """Return the entries of infos for episodes that end, in the form of Gymnasium's `_add_info`, which adds
    one environment after the other.

    Args:
        batch: an `EpisodeBatch`.
        done: True for environments that ended an episode, shape (num_envs,).
    """
    figures: dict[str, Any] = {}
    for name, values in summaries_of(batch, np.flatnonzero(done)).items():
        figures[name] = np.zeros(batch.num_envs)
        figures[f"_{name}"] = done.copy()
        figures[name][done] = values
    endings = {"episode_summary": figures, "_episode_summary": done.copy()}
    ends: dict[str, NDArray[np.bool_]] = {}
    for env in np.flatnonzero(done).tolist():
        reason = end_of(batch, env)
        for name in (reason, f"_{reason}"):
            ends.setdefault(name, np.zeros(batch.num_envs, bool))[env] = True
    success = is_success(batch, np.arange(batch.num_envs)) & done
    return endings | {"end": ends, "_end": done.copy(), "is_success": success, "_is_success": done.copy()}
