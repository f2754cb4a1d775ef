"""Statistics of episodes: means, their intervals, and the columns of the tables.

Statistics over seeds: interquartile means with bootstrap 95 % intervals (Agarwal et al. 2021, Deep
reinforcement learning at the edge of the statistical precipice).

An agent dominates the scripted run if it is faster, its forces, its cost of transport and its loading rate
are lower by at least what `LOWER` says, and it bears between the run's share of the weight and all of it:
bearing less is a way to be soft, and with more the suspension pulls the animal down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env._output import markdown_table

Floats = NDArray[np.float64]

REPS = 5000  # resamples of a bootstrap over seeds

FIGURES = (
    "return",
    "speed_m_s",
    "highest_grf_n",
    "stance_peak_n",
    "loading_rate_n_s",
    "cost_of_transport",
    "weight_share",
    "failed",
)
"""Figures in the means that `mean_figures` gives."""

TRANSPORT = ("distance_m", "positive_work_j", "mean_normal_n", "weight_share")
"""Figures from which the cost of transport over several episodes is computed; the force over the share is the
weight."""

PUBLISHED = tuple(dict.fromkeys((*FIGURES, *TRANSPORT)))
"""Figures of an episode from which all figures over several are computed."""

TABLE: Mapping[str, tuple[str, int, float]] = {
    "speed_m_s": ("speed m/s", 2, 1.0),
    "highest_grf_n": ("highest GRF kN", 2, 1e-3),
    "stance_peak_n": ("stance peak kN", 2, 1e-3),
    "loading_rate_n_s": ("loading rate kN/s", 0, 1e-3),
    "cost_of_transport": ("cost of transport", 2, 1.0),
    "weight_share": ("weight share", 2, 1.0),
}
"""Title, digits and factor of the columns of the tables."""


@dataclass(frozen=True)
class Interval:
    """Mean and bounds of its 95 % interval; NaN bounds if there is none."""

    mean: float
    low: float = math.nan
    high: float = math.nan

    def parts(self, digits: int = 1, factor: float = 1.0) -> tuple[str, str]:
        """Format mean and interval; an empty text for a mean that is NaN, and for an interval that is unknown
        or has no width."""
        if not math.isfinite(self.mean):
            return "" if math.isnan(self.mean) else "∞", ""
        mean, low, high = (f"{factor * x:.{digits}f}" for x in (self.mean, self.low, self.high))
        return mean, "" if self.low == self.high or math.isnan(self.low) else f"[{low}, {high}]"

    def text(self, digits: int = 1, factor: float = 1.0) -> str:
        """Format mean and interval in one text."""
        return " ".join(filter(None, self.parts(digits, factor)))

    def above(self, other: Interval) -> bool:
        """True if the whole interval is above another; False if one is not known."""
        return self.low > other.high


@dataclass(frozen=True)
class Scored:
    """Policy without learning, or the seeds of an entry, on the episodes of the final score: figures over
    episodes or over seeds, and those of each seed."""

    name: str
    intervals: Mapping[str, Interval]
    seeds: Sequence[Mapping[str, float]] = ()


def mean_figures(episodes: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return means over episodes of `FIGURES`, those that an id has; the cost of transport is that of the
    distance and work of all of them, NaN if they do not get forward."""
    means = {
        name: float(np.mean([episode[name] for episode in episodes]))
        for name in FIGURES
        if name in episodes[0]
    }
    if "cost_of_transport" in means:
        distance, work, force, share = (sum(episode[name] for episode in episodes) for name in TRANSPORT)
        # Without progress the cost is not defined
        moved = share and distance > 0
        means["cost_of_transport"] = work * share / (force * distance) if moved else float("nan")
    return means


def estimate(values: Sequence[float]) -> Interval:
    """Return the mean of `values` and the bias-corrected bootstrap's 95 % interval of it."""
    from scipy.stats import bootstrap

    sample = np.asarray(values, dtype=float)
    mean = float(sample.mean())
    if len(sample) < 2 or not math.isfinite(mean):
        return Interval(mean)
    if np.ptp(sample) <= 1e-12 * abs(mean):  # the bootstrap is undefined without variance
        return Interval(mean, mean, mean)
    bounds = bootstrap((sample,), np.mean, rng=np.random.default_rng(0)).confidence_interval
    return Interval(mean, float(bounds.low), float(bounds.high))


def over_episodes(episodes: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """Return the bootstrap's intervals around `mean_figures`; the cost of transport is one of sums, of which
    whole episodes are drawn."""
    from scipy.stats import bootstrap

    means = mean_figures(episodes)
    intervals = {
        key: estimate([episode[key] for episode in episodes]) for key in means if key != "cost_of_transport"
    }
    if "cost_of_transport" in means:
        mean = means["cost_of_transport"]
        intervals["cost_of_transport"] = Interval(mean)
        if math.isfinite(mean):
            parts = np.array([[episode[name] for episode in episodes] for name in TRANSPORT])

            def cost(drawn: Any, axis: int = -1) -> Any:
                distance, work, force, share = parts[:, drawn].sum(axis)
                with np.errstate(divide="ignore", invalid="ignore"):  # a draw that gets nowhere divides by 0
                    return work * share / (force * distance)

            rng = np.random.default_rng(0)
            rows = np.arange(len(episodes))
            bounds = bootstrap((rows,), cost, vectorized=True, rng=rng).confidence_interval
            intervals["cost_of_transport"] = Interval(mean, float(bounds.low), float(bounds.high))
    return intervals


def iqm(scores: ArrayLike) -> Floats:
    """Return the interquartile mean over seeds and the percentile bootstrap's interval of it, which draws
    whole seeds.

    Args:
        scores: scores of shape (seeds,) or (seeds, n).

    Returns:
        Mean, low and high, shape (3,) or (3, n). Low and high are NaN for one seed. The bootstrap draws the
        same seeds each time.
    """
    from scipy.stats import bootstrap, trim_mean

    def middle(sample: Floats, axis: int) -> Floats:
        return np.asarray(trim_mean(sample, 0.25, axis=axis))

    values = np.asarray(scores, np.float64)
    # trim_mean cuts a quarter of the seeds at either end
    mean = middle(values, axis=0)
    if len(values) < 2:
        return np.stack([mean, *[np.full_like(mean, np.nan)] * 2])
    options = {"axis": 0, "n_resamples": REPS, "method": "percentile", "rng": np.random.default_rng(0)}
    bounds = bootstrap((values,), middle, **options).confidence_interval
    return np.stack([mean, bounds.low, bounds.high])


def over_seeds(each: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """Return `iqm` of every figure that the seeds have in common, by name."""
    names = [name for name in each[0] if all(name in figures for figures in each)]
    columns = iqm([[figures[name] for name in names] for figures in each]).T
    return {name: Interval(*map(float, column)) for name, column in zip(names, columns, strict=True)}


def cells(policy: Scored) -> list[str]:
    """Format the columns of `TABLE`; an empty cell for a figure that the id does not have."""
    intervals = policy.intervals
    return [
        intervals[key].text(digits, by) if key in intervals else "" for key, (_, digits, by) in TABLE.items()
    ]


# Comparison with the paper's run


LOWER = {"stance_peak_n": 0.75, "highest_grf_n": 0.85, "cost_of_transport": 0.7, "loading_rate_n_s": 1.0}
"""Largest ratios to the run's figures for an agent that dominates; chosen values of this project."""


def dominates(figures: Mapping[str, float], run: Mapping[str, float]) -> bool:
    """True if means dominate those of the run: `LOWER`, a share of the weight between the run's and 1, a
    higher speed."""
    lower = all(figures[key] <= part * run[key] for key, part in LOWER.items())
    # Neither softer by bearing less, nor pulled down by the suspension
    bears = run["weight_share"] <= figures["weight_share"] <= 1.0
    return lower and bears and figures["speed_m_s"] > run["speed_m_s"]


def dominates_with_confidence(agent: Scored, run: Scored) -> bool:
    """True if the 95 % intervals are apart, too; that of the weight share must lie neither below the run's
    nor above 1."""
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
