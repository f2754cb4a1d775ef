"""Statistics of episodes: means, their intervals, and the columns of the tables.

Intervals are 95 % intervals of the bootstrap: bias-corrected and accelerated over episodes (Efron 1987,
Better bootstrap confidence intervals), percentiles of the interquartile mean over seeds (Agarwal et al. 2021,
Deep reinforcement learning at the edge of the statistical precipice).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

RESAMPLES = 9999  # of a bootstrap over episodes
REPS = 5000  # resamples of a bootstrap over seeds
TAIL = 0.025  # probability beyond each bound of an interval

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
"""Figures from which the cost of transport over several episodes is computed; the force divided by
the share is the weight."""

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
    episodes or over seeds, and each seed's."""

    name: str
    intervals: Mapping[str, Interval]
    seeds: Sequence[Mapping[str, float]] = ()


def mean_figures(episodes: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the means over episodes of the `FIGURES` that an id has; the cost of transport is of the
    distance and work of all episodes together, NaN without forward progress."""
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


def bca_interval(count: int, statistic: Callable[[NDArray[np.int64]], Floats]) -> tuple[float, float]:
    """Return the bias-corrected and accelerated bootstrap's 95 % interval of a statistic (Efron 1987).

    Args:
        count: number of values of which the statistic is one, 2 or more.
        statistic: function of the indices of drawn values, shape (n, m), that returns shape (n,).

    Returns:
        The bounds, NaN where the statistic of some draws is not finite.
    """
    normal = NormalDist()
    drawn = np.random.default_rng(0).integers(0, count, (RESAMPLES, count))
    values = statistic(drawn)
    everything = np.arange(count)
    (whole,) = statistic(everything[np.newaxis])
    # Half of the ties count as less; at least half a draw lies on each side, so that the bias is finite.
    less = (np.sum(values < whole) + np.sum(values <= whole)) / (2 * RESAMPLES)
    bias = normal.inv_cdf(float(np.clip(less, 0.5 / RESAMPLES, 1 - 0.5 / RESAMPLES)))
    left_out = np.array([np.delete(everything, i) for i in range(count)])
    one_less = statistic(left_out)
    spread = np.mean(one_less) - one_less
    skewness = np.sum(spread**3) / max(np.sum(spread**2) ** 1.5, 1e-300)
    bounds = []
    for tail in (TAIL, 1 - TAIL):
        z = bias + normal.inv_cdf(tail)
        bounds.append(100 * normal.cdf(float(bias + z / (1 - skewness / 6 * z))))
    # A statistic that is not finite without one of the values has no interval.
    if not np.isfinite(bounds).all():
        return math.nan, math.nan
    low, high = np.percentile(values, bounds)
    return float(low), float(high)


def estimate(values: Sequence[float]) -> Interval:
    """Return the mean of `values` and the bias-corrected bootstrap's 95 % interval of it."""
    sample = np.asarray(values, dtype=float)
    mean = float(sample.mean())
    if len(sample) < 2 or not math.isfinite(mean):
        return Interval(mean)
    if np.ptp(sample) <= 1e-12 * abs(mean):  # the bootstrap is undefined without variance
        return Interval(mean, mean, mean)
    return Interval(mean, *bca_interval(len(sample), lambda drawn: sample[drawn].mean(-1)))


def over_episodes(episodes: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """Return the bootstrap's intervals around `mean_figures`; the cost of transport is one of sums, of which
    whole episodes are drawn."""
    means = mean_figures(episodes)
    intervals = {
        key: estimate([episode[key] for episode in episodes]) for key in means if key != "cost_of_transport"
    }
    if "cost_of_transport" in means:
        intervals["cost_of_transport"] = transport(episodes)
    return intervals


def transport(episodes: Sequence[Mapping[str, float]]) -> Interval:
    """Return the cost of transport over episodes, of their distance and work together, with the
    bootstrap's interval, which draws whole episodes; NaN if they do not get forward."""
    parts = np.array([[episode[name] for episode in episodes] for name in TRANSPORT])

    def cost(drawn: NDArray[np.int64]) -> Floats:
        distance, work, force, share = parts[:, drawn].sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):  # a draw that gets nowhere divides by 0
            return np.asarray(work * share / (force * distance))

    mean = mean_figures(episodes)["cost_of_transport"]
    if not math.isfinite(mean) or len(episodes) < 2:
        return Interval(mean)
    return Interval(mean, *bca_interval(len(episodes), cost))


def interquartile_mean(values: Floats) -> Floats:
    """Return the means along the first axis without the lowest and the highest quarter of the values."""
    cut = len(values) // 4
    return np.asarray(np.sort(values, axis=0)[cut : len(values) - cut].mean(0))


def iqm(scores: ArrayLike) -> Floats:
    """Return the interquartile mean over seeds and the percentile bootstrap's interval of it, which draws
    whole seeds.

    Args:
        scores: scores of shape (seeds,) or (seeds, n).

    Returns:
        Mean, low and high, shape (3,) or (3, n). Low and high are NaN for one seed. The bootstrap draws the
        same seeds each time.
    """
    values = np.asarray(scores, np.float64)
    mean = interquartile_mean(values)
    if len(values) < 2:
        return np.stack([mean, *[np.full_like(mean, np.nan)] * 2])
    drawn = np.random.default_rng(0).integers(0, len(values), (REPS, len(values)))
    resampled = interquartile_mean(np.moveaxis(values[drawn], 1, 0))
    return np.stack([mean, *np.percentile(resampled, (100 * TAIL, 100 * (1 - TAIL)), axis=0)])


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
