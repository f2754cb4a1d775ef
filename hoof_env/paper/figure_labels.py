"""Where labels go so that they cover neither each other nor what is drawn, whatever the leg (in mm)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_POINT = 25.4 / 72
"""A typographic point [mm]."""


def text_size(text: str, size: float, weight: str = "normal") -> tuple[float, float]:
    """Width and height [mm] of a line of text at `size` points."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    box = TextPath((0, 0), text, size=size, prop=FontProperties(weight=weight)).get_extents()
    return box.width * _POINT, size * _POINT


def spread(centres: Sequence[float], widths: Sequence[float], low: float, high: float) -> list[float]:
    """Centres of labels in a row, moved as little as keeps them apart and, if they fit, within [low, high].

    Args:
        centres: where the labels would like to be, increasing [mm].
        widths: their widths, with the gap to the next [mm].
        low, high: ends of the row [mm].
    """
    placed = []
    for centre, width in zip(centres, widths, strict=True):
        placed.append(max(centre, low + width / 2))
        low = placed[-1] + width / 2
    for k in reversed(range(len(placed))):
        placed[k] = min(placed[k], high - widths[k] / 2)
        high = placed[k] - widths[k] / 2
    return placed


def dots_along(lines: Sequence[Array], step: float = 0.4) -> Array:
    """Points every `step` [mm] along polylines of shape (k, 2), for `Room`."""
    dots = []
    for line in lines:
        for one, two in pairwise(line):
            count = max(int(np.hypot(*(two - one)) / step), 1)
            dots.append(one + np.linspace(0, 1, count + 1)[:, None] * (two - one))
    return np.concatenate(dots) if dots else np.empty((0, 2))


class Room:
    """A panel that labels are put into one after the other.

    Args:
        width, height: of the panel, its origin at the lower left corner [mm].
        dots: what is drawn, as points, shape (k, 2) [mm].
    """

    def __init__(self, width: float, height: float, dots: Array) -> None:
        self._size = np.array([width, height])
        self._dots = dots
        self._taken: list[tuple[Array, Array]] = []

    def put(
        self, candidates: Array, size: tuple[float, float], costs: Array, dots: Array | None = None
    ) -> Array:
        """Take the candidate that covers least.

        Args:
            candidates: possible centres, shape (k, 2) [mm].
            size: width and height of the label [mm].
            costs: what each candidate costs beforehand, shape (k,); covering one dot costs 1.
            dots: shape (j, 2), what must not be covered, if not everything drawn.

        Returns:
            The centre, shape (2,) [mm].
        """
        half = np.array(size) / 2
        dots = self._dots if dots is None else dots
        covered = (np.abs(dots[None] - candidates[:, None]) < half).all(axis=2).sum(axis=1)
        outside = np.clip(half - candidates, 0, None) + np.clip(candidates + half - self._size, 0, None)
        cost = costs + covered + 100 * outside.sum(axis=1)
        for centre, other in self._taken:
            overlap = np.clip(half + other - np.abs(candidates - centre), 0, None)
            cost = cost + 30 * overlap.prod(axis=1)
        best = candidates[int(np.argmin(cost))]
        self._taken.append((best, half))
        return best

    def put_beside(self, anchor: Array, size: tuple[float, float], gap: float) -> Array:
        """Put a label beside a point, `gap` [mm] off it or a little more, on the side with the most room."""
        angles = np.arange(24) * np.pi / 12
        sides = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        reach = np.abs(sides) @ (np.array(size) / 2)
        gaps = gap * np.array([1, 1.8, 3])
        candidates = np.concatenate([anchor + sides * (reach + g)[:, None] for g in gaps])
        return self.put(candidates, size, np.repeat(3 * (gaps - gap), len(sides)))
