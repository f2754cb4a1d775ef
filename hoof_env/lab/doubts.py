"""Doubtful stances: stances of odd length, and stances that run into each other under a baseline that
drifts."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hoof_env.lab.stances import Spans, loaded_spans

Floats = NDArray[np.float64]

ODD_SHARE = 0.25
"""Largest difference of a stance's duration from the median, as a share of the median."""

MIN_STANCES = 3
"""Least number of stances that have a usual duration."""

MAX_BASELINE_SHARE = 0.5
"""Largest force in swing, and largest change of it, as a share of the threshold of a stance."""

LONG_STANCES = 1.5
"""Longest loaded time that an end of the record cuts off, in median stances."""


def odd_stances(durations: Floats) -> NDArray[np.bool_]:
    """Return a mask of the durations, shape (n,), that differ from their median by more than `ODD_SHARE`."""
    if len(durations) < MIN_STANCES:
        return np.zeros(len(durations), bool)
    usual = float(np.median(durations))
    return np.asarray(np.abs(durations - usual) > ODD_SHARE * usual)


def cut_spans(vertical: Floats, level: float, rate: float) -> Spans:
    """Return the loaded times that an end of the record cuts off; arguments are as for `whole_stances`."""
    return [(i, j) for i, j in loaded_spans(vertical, level, rate) if i == 0 or j == len(vertical)]


def baseline(vertical: Floats, stances: Spans, level: float, time: Floats, unit: str) -> list[str]:
    """Return messages about a force in swing that drifts or is not 0, with the remedy.

    Args:
        vertical: vertical force of a limb, shape (n,).
        stances: its whole stances.
        level: threshold of a stance [unit].
        time: times, shape (n,) [s].
        unit: unit of the force.
    """
    rate = (len(time) - 1) / float(time[-1] - time[0])
    # The middle half of swing, as forces near its ends may be the limb's.
    middles = [((3 * j + k) // 4, (j + 3 * k) // 4 + 1) for (_, j), (k, _) in pairwise(stances)]
    levels = np.array([np.median(vertical[j:k]) for j, k in middles])
    remedy = "subtract it, or raise --threshold"
    found = []
    if len(levels) > 1 and np.ptp(levels) > MAX_BASELINE_SHARE * level:
        found.append(
            f"the force in swing drifts from {levels.min():.4g} to {levels.max():.4g} {unit}; {remedy}"
        )
    elif len(levels) and abs(float(np.median(levels))) > MAX_BASELINE_SHARE * level:
        found.append(f"the force in swing is {np.median(levels):.4g} {unit} instead of 0; {remedy}")
    usual = float(np.median([j - i for i, j in stances])) if stances else 0.0
    for i, j in cut_spans(vertical, level, rate):
        if stances and j - i > LONG_STANCES * usual:
            low = float(np.percentile(vertical[i:j], 5))
            found.append(
                f"no stance is found from {time[i]:.4g} to {time[j - 1]:.4g} s, {(j - i) / usual:.1f} times "
                f"the duration of one: the force stays above {level:.4g} {unit}, and hardly falls below "
                f"{low:.4g} {unit}; if the baseline drifts, {remedy}"
            )
    return found
