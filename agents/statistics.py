"""What episodes say: means, their intervals, and the columns of the tables.

Statistics over seeds: interquartile means with bootstrap 95 % intervals (Agarwal et al. 2021, Deep
reinforcement learning at the edge of the statistical precipice).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

REPS = 5000  # of a bootstrap over seeds

FIGURES = (
    "return",
    "speed_m_s",
    "peak_grf_n",
    "stance_peak_n",
    "loading_rate_n_s",
    "cost_of_transport",
    "weight_share",
    "failed",
)
"""Figures whose means `mean_figures` gives."""

TRANSPORT = ("distance_m", "drive_work_j", "mean_grf_n", "weight_share")
"""What a cost of transport over several episodes is made of; the force by the share is the weight."""

PUBLISHED = tuple(dict.fromkeys((*FIGURES, *TRANSPORT)))
"""Figures of an episode that all figures over several are made of."""

TABLE: Mapping[str, tuple[str, int, float]] = {
    "speed_m_s": ("speed m/s", 2, 1.0),
    "peak_grf_n": ("highest GRF kN", 2, 1e-3),
    "stance_peak_n": ("stance peak kN", 2, 1e-3),
    "loading_rate_n_s": ("loading rate kN/s", 0, 1e-3),
    "cost_of_transport": ("cost of transport", 2, 1.0),
    "weight_share": ("weight share", 2, 1.0),
}
"""Title, digits and factor of what the tables show."""


@dataclass(frozen=True)
class Interval:
    """A mean and the bounds of its 95 % interval; NaN where there is none."""

    mean: float
    low: float = math.nan
    high: float = math.nan

    def parts(self, digits: int = 1, factor: float = 1.0) -> tuple[str, str]:
        """Mean and interval as a person reads them; nothing for a mean that is NaN, and no interval where
        there is none or it has no width."""
        if not math.isfinite(self.mean):
            return "" if math.isnan(self.mean) else "∞", ""
        mean, low, high = (f"{factor * x:.{digits}f}" for x in (self.mean, self.low, self.high))
        return mean, "" if self.low == self.high or math.isnan(self.low) else f"[{low}, {high}]"

    def text(self, digits: int = 1, factor: float = 1.0) -> str:
        return " ".join(filter(None, self.parts(digits, factor)))

    def above(self, other: Interval) -> bool:
        """Whether the whole interval lies above another; False where one is not known."""
        return self.low > other.high


@dataclass(frozen=True)
class Scored:
    """A policy without learning, or the seeds of an entry, on the episodes of the final score: figures over
    episodes or over seeds, and those of each seed."""

    name: str
    intervals: Mapping[str, Interval]
    seeds: Sequence[Mapping[str, float]] = ()


def mean_figures(episodes: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Means over episodes of `FIGURES`, those that an id has; the cost of transport is that of the distance
    and work of all of them, NaN if they do not get forward."""
    means = {name: float(np.mean([one[name] for one in episodes])) for name in FIGURES if name in episodes[0]}
    if "cost_of_transport" in means:
        distance, work, force, share = (sum(one[name] for one in episodes) for name in TRANSPORT)
        moved = share and distance > 0
        means["cost_of_transport"] = work * share / (force * distance) if moved else float("nan")
    return means


def estimate(values: Sequence[float]) -> Interval:
    """The mean of `values` and the bias-corrected bootstrap's 95 % interval of it."""
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
    """The bootstrap's intervals around `mean_figures`; the cost of transport is one of sums, of which whole
    episodes are drawn."""
    from scipy.stats import bootstrap

    means = mean_figures(episodes)
    intervals = {key: estimate([one[key] for one in episodes]) for key in means if key != "cost_of_transport"}
    if "cost_of_transport" in means:
        mean = means["cost_of_transport"]
        intervals["cost_of_transport"] = Interval(mean)
        if math.isfinite(mean):
            parts = np.array([[one[name] for one in episodes] for name in TRANSPORT])

            def cost(drawn: Any, axis: int = -1) -> Any:
                distance, work, force, share = parts[:, drawn].sum(axis)
                with np.errstate(divide="ignore", invalid="ignore"):  # of a draw that gets nowhere
                    return work * share / (force * distance)

            rng = np.random.default_rng(0)
            rows = np.arange(len(episodes))
            bounds = bootstrap((rows,), cost, vectorized=True, rng=rng).confidence_interval
            intervals["cost_of_transport"] = Interval(mean, float(bounds.low), float(bounds.high))
    return intervals


def iqm(scores: ArrayLike) -> Floats:
    """Interquartile mean over seeds and the percentile bootstrap's interval of it, which draws whole seeds:
    mean, low and high, shape (3,) or (3, n), of scores of shape (seeds,) or (seeds, n). Low and high are NaN
    for one seed. The bootstrap draws the same seeds each time."""
    from scipy.stats import bootstrap, trim_mean

    def middle(some: Floats, axis: int) -> Floats:
        return np.asarray(trim_mean(some, 0.25, axis=axis))

    values = np.asarray(scores, np.float64)
    mean = middle(values, axis=0)
    if len(values) < 2:
        return np.stack([mean, *[np.full_like(mean, np.nan)] * 2])
    options = {"axis": 0, "n_resamples": REPS, "method": "percentile", "rng": np.random.default_rng(0)}
    bounds = bootstrap((values,), middle, **options).confidence_interval
    return np.stack([mean, bounds.low, bounds.high])


def over_seeds(each: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """`iqm` of every figure that the seeds have in common, by name."""
    names = [name for name in each[0] if all(name in one for one in each)]
    columns = iqm([[one[name] for name in names] for one in each]).T
    return {name: Interval(*map(float, column)) for name, column in zip(names, columns, strict=True)}


def cells(one: Scored) -> list[str]:
    known = one.intervals
    return [known[key].text(digits, by) if key in known else "" for key, (_, digits, by) in TABLE.items()]
