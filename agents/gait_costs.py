"""What gaits cost in searches for kinematic ones: what they miss of a horse's kinematics, and a criterion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agents.judges import Bars

Floats = NDArray[np.float64]

SCALES = {
    "lag": 0.02,
    "duty_fore": 0.02,
    "duty_hind": 0.02,
    "stride_over_hip": 0.1,
    "dip_fore": 0.05,
    "dip_hind": 0.05,
    "slip_fore": 0.02,
    "slip_hind": 0.02,
    "stances_per_turn_fore": 0.03,
    "stances_per_turn_hind": 0.03,
    "speed_ratio": 0.03,
}
"""Scale of the distance from a bar, by figure."""
MARGIN = 0.25  # distance within a bar from which on it costs nothing, in these
NEEDED: Bars = {
    "slip_fore": [(0.0, 0.09)],
    "slip_hind": [(0.0, 0.09)],
    "stances_per_turn_fore": [(0.96, 1.04)],
    "stances_per_turn_hind": [(0.96, 1.04)],
    "speed_ratio": [(0.95, 1.05)],
}
"""What a gait needs so that its figures count, well within the limits of `agents.rules`."""
MISS = 4.0  # cost of a scale beyond a bar
FALL = 60.0  # cost of a gait that always falls
CRITERIA = {
    "force": ("force", 40.0),
    "limbs": ("limb_work", 20.0),
    "work": ("transport", 4.0),
    "return": ("return", -0.02),
    "peak": ("peak", 4.0),
    "loading": ("loading", 0.1),
}
"""Figure that decides between gaits with the wanted kinematics, and the cost of 1 of it, by criterion.

They are the mean square of the forces on all hooves over the weight [-], positive work of single limbs on the
centre of mass or of the drives over weight and distance [-], return of an episode, mean of the stances' peaks
over the weight [-] and of their steepest rises [1/s].
"""
TWO_PEAKED = (0.12, 1.0)
ONE_PEAKED = (0.0, 0.02)
"""Depth of the dip between two peaks, over the higher one, of a force with two and of one with one."""


def misses_of(figures: dict[str, Floats], bars: Bars, fall: float = FALL) -> Floats:
    """Return what gaits cost by what they miss, shape (m,): distances from bars and from `NEEDED` over
    `SCALES`, and falls."""
    cost = np.zeros(len(figures["fell"]))
    for name, of_name in (bars | NEEDED).items():
        scale = SCALES[name]
        distances = [distance(figures[name], low, high, scale, name == "lag") for low, high in of_name]
        far = np.min(distances, axis=0)
        # Far from the bar a cost grows more slowly, so that no figure hides all others
        cost += MISS * np.where(np.isfinite(far), far / (1 + far / 20), 20.0)
    missed: Floats = cost + fall * figures["fell"]
    return missed


def costs_of(figures: dict[str, Floats], bars: Bars, criterion: str = "force", fall: float = FALL) -> Floats:
    """Return the cost of gaits, shape (m,): `misses_of`, and one of `CRITERIA`."""
    name, price = CRITERIA[criterion]
    total: Floats = misses_of(figures, bars, fall) + price * np.nan_to_num(figures[name], nan=10.0)
    return total


def distance(values: Floats, low: float, high: float, scale: float, is_lag: bool) -> Floats:
    """Return the distance from a bar, over a scale; it is 0 from `MARGIN` within the bar on, if that is wide
    enough. The lag is a number of strides within half of one, which is 0 again."""
    margin = min(MARGIN * scale, (high - low) / 4)
    # Slip and dips are never below 0
    below, above = low + margin * (low != 0), high - margin
    if is_lag:
        middle = (low + high) / 2
        values = middle + (values - middle + 0.25) % 0.5 - 0.25
    apart: Floats = np.maximum(np.maximum(below - values, values - above), 0.0) / scale
    return apart


def peaked(bars: Bars) -> Bars:
    """Return bars with the number of peaks as the depth of a dip, which changes smoothly with a gait."""
    dips_of = {}
    for name, of_name in bars.items():
        if name.startswith("two_peaked"):
            name = name.replace("two_peaked", "dip")
            of_name = [TWO_PEAKED if of_name[0][0] > 0.5 else ONE_PEAKED]
        dips_of[name] = of_name
    return dips_of
