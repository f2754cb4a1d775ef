"""Means with intervals as plain data, and the comparison of agents with the scripted run.

An agent dominates the scripted run if it is faster, its forces, its cost of transport and its loading rate
are lower by at least what `LOWER` says, and it bears between the run's share of the weight and all of it:
bearing less is a way to be soft, and with more the suspension pulls the animal down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hoof_env._output import markdown_table
from hoof_env.evaluation.statistics import TABLE, Scored, cells, estimate

LOWER = {"stance_peak_n": 0.75, "highest_grf_n": 0.85, "cost_of_transport": 0.7, "loading_rate_n_s": 1.0}
"""Largest ratios to the run's figures for an agent that dominates; chosen values of this project."""


def described(values: Sequence[float]) -> dict[str, float]:
    """Return mean and bounds of the 95 % interval of values over episodes as plain data; equal values, which
    have no interval, and a single one have a mean alone."""
    found = estimate(values)
    has_interval = math.isfinite(found.low) and found.low < found.high
    return {"mean": found.mean, **({"low": found.low, "high": found.high} if has_interval else {})}


def spread(values: ArrayLike, digits: int, factor: float = 1.0) -> str:
    """Write the mean of values over trainings, times a factor, and in brackets their lowest and highest."""
    each = np.asarray(values, np.float64)
    mean, low, high = (f"{factor * x:.{digits}f}" for x in (each.mean(), each.min(), each.max()))
    return f"{mean} ({low} to {high})" if len(each) > 1 else mean


def dominates(figures: Mapping[str, float], run: Mapping[str, float]) -> bool:
    """True if means dominate the run's: `LOWER`, a share of the weight between the run's and 1, a
    higher speed."""
    lower = all(figures[key] <= part * run[key] for key, part in LOWER.items())
    # Neither softer by bearing less, nor pulled down by the suspension
    bears = run["weight_share"] <= figures["weight_share"] <= 1.0
    return lower and bears and figures["speed_m_s"] > run["speed_m_s"]


def dominates_with_confidence(agent: Scored, run: Scored) -> bool:
    """True if the 95 % intervals are apart, too; the interval of the weight share must lie neither below the
    run's nor above 1."""
    ours = agent.intervals
    theirs = run.intervals
    lower = all(theirs[key].above(ours[key]) for key in LOWER)
    bears = not theirs["weight_share"].above(ours["weight_share"]) and ours["weight_share"].low <= 1.0
    return lower and bears and ours["speed_m_s"].above(theirs["speed_m_s"])


def compare(agents: Sequence[Scored], run: Scored) -> str:
    """Return a table of the paper's run and of what is compared with it."""
    means = {key: interval.mean for key, interval in run.intervals.items()}
    lines = [["run", *cells(run)]]
    for agent in agents:
        mine = {key: interval.mean for key, interval in agent.intervals.items()}
        parts = [f"{mine[key] / means[key]:.2f}" for key in LOWER]
        verdict = "yes" if dominates(mine, means) and dominates_with_confidence(agent, run) else "no"
        count = sum(dominates(seed, means) for seed in agent.seeds)
        seeds = f"{count}/{len(agent.seeds)}" if agent.seeds else ""
        lines.append([agent.name, *cells(agent), *parts, verdict, seeds])
    of_run = [f"{TABLE[key][0].rpartition(' ')[0] or key} / run's" for key in LOWER]
    titles = [title for title, *_ in TABLE.values()]
    return markdown_table(["", *titles, *of_run, "dominates", "seeds that do"], lines)
