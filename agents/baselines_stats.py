"""Interquartile means over seeds with stratified bootstrap 95 % intervals, by rliable.

Agarwal et al. 2021, Deep reinforcement learning at the edge of the statistical precipice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.errors import ParameterError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Interval:
    """A mean and the bounds of its 95 % interval; NaN where there is none."""

    mean: float
    low: float
    high: float

    def text(self, digits: int = 1, factor: float = 1.0) -> str:
        """As a table shows it."""
        mean, low, high = (f"{factor * x:.{digits}f}" for x in (self.mean, self.low, self.high))
        return mean if math.isnan(self.low) else f"{mean} [{low}, {high}]"

    def above(self, other: Interval) -> bool:
        """Whether the whole interval lies above another; False where one is not known."""
        return self.low > other.high


def iqm(scores: ArrayLike, reps: int = 5000) -> Floats:
    """Interquartile mean over seeds and its interval.

    Args:
        scores: of each seed, shape (seeds,), or along a curve, shape (seeds, points).
        reps: of the bootstrap, which draws the same numbers each time.

    Returns:
        Mean, low and high, shape (3,) or (3, points); low and high are NaN for one seed.

    Raises:
        ParameterError: rliable is not installed.
    """
    try:
        from rliable.library import get_interval_estimates  # type: ignore[import-untyped]
    except ImportError as error:
        raise ParameterError(
            f"intervals: expected rliable (pip install 'hoof-env[baselines]'): {error}"
        ) from None
    from scipy.stats import trim_mean

    values = np.asarray(scores, np.float64)
    curve = values.reshape(len(values), 1, -1)  # rliable's runs, tasks, points

    def over_seeds(some: Floats) -> Floats:
        """rliable's `aggregate_iqm` of every point at once."""
        return np.asarray(trim_mean(some[:, 0], 0.25, axis=0))

    if len(values) < 2:
        found = np.stack([over_seeds(curve), *[np.full(curve.shape[2], np.nan)] * 2])
    else:
        np.random.seed(0)  # noqa: NPY002  rliable draws from here whatever generator it is given
        means, bounds = get_interval_estimates({"": curve}, over_seeds, reps=reps)
        found = np.stack([means[""], *bounds[""]])
    return found.reshape(3, *values.shape[1:])


def over_seeds(scores: Sequence[float]) -> Interval:
    """`iqm` of one number a seed."""
    return Interval(*map(float, iqm(scores)))
