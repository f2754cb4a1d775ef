"""Many short rounds, each with every case once in a new order, so that a busy machine slows all alike."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def interleave(runs: Mapping[str, Callable[[], float]], rounds: int, seed: int = 0) -> dict[str, Floats]:
    """Return the seconds that each of `runs` took, shape (rounds,), after one round to warm up."""
    rng = np.random.default_rng(seed)
    names = list(runs)
    seconds = {name: np.empty(rounds) for name in names}
    for run in runs.values():
        run()
    # No collection in the midst of a round
    gc.collect()
    gc.disable()
    try:
        for k in range(rounds):
            for i in rng.permutation(len(names)):
                seconds[names[i]][k] = runs[names[i]]()
    finally:
        gc.enable()
    return seconds


def timed(clock: Callable[[], float], before: Callable[[], Any], work: Callable[[], Any]) -> float:
    """Return the time of `work` [s], after `before`, which does not count."""
    before()
    begin = clock()
    work()
    return clock() - begin


def spread(values: Floats) -> dict[str, float]:
    """Return median, quartiles and extremes."""
    low, q1, median, q3, high = np.quantile(values, [0, 0.25, 0.5, 0.75, 1]).tolist()
    return {"median": median, "q1": q1, "q3": q3, "min": low, "max": high}


def describe(s: Mapping[str, Any]) -> str:
    """Format a spread as 'median (q1 to q3; min to max)'."""
    number = {name: f"{value:.3g}" for name, value in s.items()}
    return f"{number['median']} ({number['q1']} to {number['q3']}; {number['min']} to {number['max']})"


def bar_text(bar: float, s: Mapping[str, float] | None) -> str:
    """Format a bar and the verdict on the median."""
    if s is None:
        return f"{bar:g}: not measured"
    return f"{bar:g}: {'met' if s['median'] >= bar else 'not met'}"
