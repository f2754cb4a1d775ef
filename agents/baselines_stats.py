"""Interquartile means over seeds with stratified bootstrap 95 % intervals, by rliable.

Agarwal et al. 2021, Deep reinforcement learning at the edge of the statistical precipice.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

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
        if math.isnan(self.mean):
            return ""
        mean, low, high = (f"{factor * x:.{digits}f}" for x in (self.mean, self.low, self.high))
        return mean if math.isnan(self.low) else f"{mean} [{low}, {high}]"

    def above(self, other: Interval) -> bool:
        """Whether the whole interval lies above another; False where one is not known."""
        return self.low > other.high


REPS = 5000
"""Of a bootstrap."""


def library() -> Any:
    """rliable's bootstrap.

    Raises:
        ParameterError: it is not installed.
    """
    try:
        from rliable.library import get_interval_estimates  # type: ignore[import-untyped]
    except ImportError as error:
        raise ParameterError(
            f"intervals: expected rliable (pip install 'hoof-env[baselines]'): {error}"
        ) from None
    return get_interval_estimates


def iqm(scores: ArrayLike) -> Floats:
    """Interquartile mean over seeds and its interval.

    Args:
        scores: of each seed, shape (seeds,), or several numbers of each, shape (seeds, n), that are
            resampled apart.

    Returns:
        Mean, low and high, shape (3,) or (3, n); low and high are NaN for one seed. The bootstrap draws the
        same numbers each time.

    Raises:
        ParameterError: rliable is not installed.
    """
    from scipy.stats import trim_mean

    get_interval_estimates = library()
    values = np.asarray(scores, np.float64)
    curve = values.reshape(len(values), 1, -1)  # rliable's runs, tasks, points

    def over_seeds(some: Floats) -> Floats:
        """rliable's `aggregate_iqm` of every point at once."""
        return np.asarray(trim_mean(some[:, 0], 0.25, axis=0))

    if len(values) < 2:
        found = np.stack([over_seeds(curve), *[np.full(curve.shape[2], np.nan)] * 2])
    else:
        np.random.seed(0)  # noqa: NPY002  rliable draws from here whatever generator it is given
        means, bounds = get_interval_estimates({"": curve}, over_seeds, reps=REPS)
        found = np.stack([means[""], *bounds[""]])
    return found.reshape(3, *values.shape[1:])


def over_seeds(each: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """`iqm` of every figure that the seeds have in common, by name."""
    names = [name for name in each[0] if all(name in one for one in each)]
    found = iqm([[one[name] for name in names] for one in each])
    return {name: Interval(*map(float, column)) for name, column in zip(names, found.T, strict=True)}
