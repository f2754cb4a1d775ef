"""Interquartile means over seeds with bootstrap 95 % intervals.

Agarwal et al. 2021, Deep reinforcement learning at the edge of the statistical precipice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A mean and the bounds of its 95 % interval; NaN where there is none."""

    mean: float
    low: float
    high: float

    def text(self, digits: int = 1, factor: float = 1.0) -> str:
        """As a table shows it."""
        if math.isnan(self.mean):
            return ""
        mean, low, high = (f"{factor * x:.{digits}f}" for x in (self.mean, self.low, self.high))
        return mean if math.isnan(self.low) else f"{mean} [{low}, {high}]"

    def above(self, other: Interval) -> bool:
        """Whether the whole interval lies above another; False where one is not known."""
        return self.low > other.high


REPS = 5000
"""Of a bootstrap."""


def iqm(scores: ArrayLike) -> Floats:
    """Interquartile mean over seeds and the percentile bootstrap's interval of it, which draws whole seeds.

    Args:
        scores: of each seed, shape (seeds,), or several numbers of each, shape (seeds, n).

    Returns:
        Mean, low and high, shape (3,) or (3, n); low and high are NaN for one seed. The bootstrap draws the
        same seeds each time.
    """
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
    found = iqm([[one[name] for name in names] for one in each])
    return {name: Interval(*map(float, column)) for name, column in zip(names, found.T, strict=True)}
