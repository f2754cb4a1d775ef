"""The ground: its heights, its kinds by colour, and the footprint of the hoof."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pygame
from numpy.typing import NDArray

from hoof_env.ground.terrain import Terrain
from hoof_env.record.instant import Instant
from hoof_env.render.brush import Brush
from hoof_env.render.colours import SOIL_LINE, Colour
from hoof_env.render.kinds import BODY, SKIN, TOLERANCE, find_patches, kinds_of, shade

FLANK_M = 0.09  # reach of the drawn footprint beyond the hoof, as the model has no width [m]
COLUMN = 6  # distance between drawn points of the surface [pixels of a picture of 960 x 540]
LABEL = 90  # least width of a labelled patch [pixels of a picture of 960 x 540]

Point = tuple[float, float]


class GroundPainter:
    """Draws a terrain into pictures of `size`, `scale` pixels per metre; labels go left of pixel `clear`."""

    def __init__(
        self, brush: Brush, terrain: Terrain, size: tuple[int, int], scale: float, clear: float
    ) -> None:
        self._terrain = terrain
        self._brush = brush
        self._size = size
        self._scale = scale
        self._clear = clear
        self._knots = terrain.x
        self._heights = terrain.height_at(terrain.x)
        self._stiffness = np.array(terrain.stiffness)
        self._friction = np.array(terrain.friction)
        self._level = bool(np.ptp(self._heights) == 0)
        self._labelled = [p for p in find_patches(terrain) if p.end - p.start > LABEL * brush.unit / scale]
        self._grid = COLUMN * brush.unit / scale

    def height(self, x: Any) -> Any:
        """Return the height of the undisturbed ground [m]."""
        return np.interp(x, self._knots, self._heights)

    def kinds(self) -> list[tuple[str, Colour]]:
        """Return the name and colour of each unusual kind of ground in the terrain."""
        return kinds_of(self._terrain)

    def draw(self, canvas: Any, feet: Sequence[Instant], corner: complex) -> None:
        """Draw the ground under some legs; `corner` is the place of the picture's upper left corner in the
        world [m]."""
        pressing = [now for now in feet if max(now.toe_depth, now.heel_depth) > 0]
        x = self._places(pressing, corner.real)
        surface = (corner.imag - self.height(x)) * self._scale
        if self._level:
            surface = np.round(surface)  # a sharp line
        if pressing:
            surface += np.max([footprint(now, x) for now in pressing], axis=0) * self._scale
        line = list(zip(((x - corner.real) * self._scale).tolist(), surface.tolist(), strict=True))
        middle = (x[1:] + x[:-1]) / 2
        for part, colour in self._runs(line, middle, self._stiffness, BODY):
            bottom = self._size[1] + 1
            pygame.draw.polygon(canvas, colour, [(part[0][0], bottom), *part, (part[-1][0], bottom)])
        deep = 8 * self._brush.unit
        for part, colour in self._runs(line, middle, self._friction, SKIN):
            pygame.draw.polygon(canvas, colour, [*part, *((a, b + deep) for a, b in reversed(part))])
        for shift in range(max(1, round(2 * self._brush.unit))):
            pygame.draw.aalines(canvas, SOIL_LINE, False, [(a, b + shift) for a, b in line])
        self._draw_ticks(canvas, corner)
        self._draw_labels(canvas, corner)

    def _places(self, feet: Sequence[Instant], left: float) -> NDArray[np.float64]:
        """Return the x of the drawn surface [m]: fixed to the ground, so that it does not shimmer."""
        right = left + self._size[0] / self._scale
        grid = self._grid
        x = [np.arange(np.floor(left / grid), np.ceil(right / grid) + 1) * grid]
        for now in feet:
            near, far = sorted((now.toe_x, now.heel_x))
            x.append(np.arange(near - 3 * FLANK_M, min(far, near + 1) + 3 * FLANK_M, 2 / self._scale))
        return np.unique(np.concatenate(x))

    def _runs(
        self, line: list[Point], middle: Any, factors: Any, colours: tuple[Colour | None, ...]
    ) -> Iterator[tuple[list[Point], Colour]]:
        """Yield stretches of the surface line with their colour, by the factor amid each piece."""
        shades = shade(np.interp(middle, self._knots, factors))
        changes = [0, *(np.flatnonzero(np.diff(shades)) + 1).tolist(), len(shades)]
        for start, end in pairwise(changes):
            colour = colours[int(shades[start])]
            if colour is not None:
                yield line[start : end + 1], colour

    def _draw_ticks(self, canvas: Any, corner: complex) -> None:
        unit = self._brush.unit
        scale = self._scale
        thick = max(1, round(2 * unit))
        first = corner.real
        last = corner.real + self._size[0] / scale
        halves = np.arange(np.floor(2 * first), np.ceil(2 * last) + 1)
        tops = (corner.imag - self.height(halves / 2)) * scale
        for half, top in zip(halves.astype(int).tolist(), tops.tolist(), strict=True):
            at, top = (half / 2 - first) * scale, round(top)
            metre = half % 2 == 0
            length = round((10 if metre else 6) * unit)
            canvas.fill(SOIL_LINE, (round(at - thick / 2), top, thick if metre else 1, length))
            text = f"{half // 2} m"
            room = self._brush.width(text, 17) / 2
            # A label that the picture's edge or the panel would cut could be read as another number.
            if metre and room <= at <= self._clear - room:
                self._brush.write(canvas, text, (at, top + 13 * unit), 17, SOIL_LINE, "midtop")

    def _draw_labels(self, canvas: Any, corner: complex) -> None:
        unit = self._brush.unit
        left = corner.real
        right = left + self._clear / self._scale
        for patch in self._labelled:
            start = max(patch.start, left)
            end = min(patch.end, right)
            if (end - start) * self._scale < LABEL * unit:
                continue
            middle = (start + end) / 2
            x = (middle - left) * self._scale
            y = (corner.imag - float(self.height(middle))) * self._scale + 36 * unit
            factors = [("stiffness", patch.stiffness), ("friction", patch.friction)]
            words = [f"{name} × {factor:.2g}" for name, factor in factors if abs(factor - 1) > TOLERANCE]
            room = max(self._brush.width(text, 16) for text in words) / 2
            x = min(max(x, room), self._clear - room)
            for k, text in enumerate(words):
                self._brush.write(canvas, text, (x, y + 15 * k * unit), 16, SOIL_LINE, "midtop")


def footprint(now: Instant, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far the ground at `x` is pressed down [m]: as deep as the sole, running out on both sides.

    The contact knows two points without width; the flanks are there for the eye alone.
    """
    (a, deep_a), (b, deep_b) = sorted(((now.toe_x, now.toe_depth), (now.heel_x, now.heel_depth)))
    inside = np.interp(x, [a, max(b, a + 1e-9)], [deep_a, deep_b])
    outside = np.maximum(a - x, x - b)
    fall = np.exp(-np.square(np.maximum(outside, 0.0) / FLANK_M))
    return np.maximum(inside, 0.0) * np.where(outside > 0, fall, 1.0)
