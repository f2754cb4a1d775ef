"""How far each length of a leg can change alone before the leg no longer assembles through its turn."""

from __future__ import annotations

from typing import NamedTuple

from hoof_env.errors import ParameterError, one_of
from hoof_env.leg.checks import MAX_LENGTH, MIN_LENGTH
from hoof_env.leg.geometry import Geometry

FIRST = 1e-6
"""First relative change that is tried, and the smallest that counts."""

PRECISION = 1e-3
"""Largest relative error of a change."""


class Span(NamedTuple):
    """Length of a leg [m], and the lowest and the highest one with which the leg still assembles [m]."""

    length: float
    low: float
    high: float


def length_ranges(geometry: Geometry) -> dict[str, Span]:
    """Return the range of each length, by name, in which the leg assembles while all other lengths stay.

    >>> import hoof_env
    >>> from hoof_env.leg.ranges import length_ranges
    >>> length, low, high = length_ranges(hoof_env.load_geometry("fourbar"))["PC"]
    >>> round(low, 2), round(length, 2), round(high, 2)
    (1.46, 1.55, 2.3)

    Raises:
        ParameterError: not a `Geometry`.
    """
    one_of("geometry", geometry, Geometry)
    ranges = {}
    for name, length in geometry.lengths.items():
        low = length * (1 - _farthest(geometry, name, -1.0, 1 - MIN_LENGTH / length))
        high = length * (1 + _farthest(geometry, name, 1.0, MAX_LENGTH / length - 1))
        ranges[name] = Span(length, low, high)
    return ranges


def _farthest(geometry: Geometry, name: str, sense: float, most: float) -> float:
    """Return the largest relative change of a length, upwards or downwards by `sense`, up to `most`: that
    next to the present length, should there be others beyond a gap."""
    good, bad = 0.0, FIRST
    while _assembles(geometry, name, sense * bad):
        if bad >= most:
            return most
        good, bad = bad, min(4 * bad, most)
    while bad - good > PRECISION * bad and bad > FIRST:
        middle = (good + bad) / 2
        if _assembles(geometry, name, sense * middle):
            good = middle
        else:
            bad = middle
    return good


def _assembles(geometry: Geometry, name: str, change: float) -> bool:
    """True if the leg assembles with a relative change of one length."""
    try:
        geometry.replace(lengths={name: geometry.lengths[name] * (1 + change)})
    except ParameterError:
        return False
    return True
