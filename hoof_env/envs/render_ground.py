"""The ground: its heights, its kinds by colour, and the footprint of the hoof."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pygame
from numpy.typing import NDArray

from hoof_env.envs.render_instant import Instant
from hoof_env.envs.render_paint import PAPER, Brush, Colour, mix
from hoof_env.ground.terrain import Terrain

SOIL, SOIL_LINE = (214, 200, 174), (112, 95, 66)
STIFFER, SOFTER = (150, 152, 158), (238, 226, 170)
SLIPPERY, ROUGHER = (86, 180, 233), (90, 50, 20)
"""Body of the soil where it is stiffer or softer; its skin where it is more slippery or rougher."""

STRONG = 4.0
"""A factor of stiffness or friction of this, or its inverse, has the full colour [-]."""

ALIKE = 0.02
"""Relative difference of a factor from 1 below which the ground counts as usual [-]."""

FLANK_M = 0.09
"""How far from the hoof the ground is drawn down by the footprint; the model has no width [m]."""


PRESSED = ((0.5, 0.12), (0.33, 0.24), (0.17, 0.36))
"""How far below the footprint the soil is darker, in parts of its depth, and how much."""


class Patch(NamedTuple):
    """A stretch of ground of one kind: from and to [m], factors of stiffness and friction [-]."""

    start: float
    end: float
    stiffness: float
    friction: float


class GroundPainter:
    """Draws a terrain.

    Args:
        brush: the paint box.
        terrain: what to draw.
        size: of the picture [pixels].
        scale: pixels per metre.
        clear: width on the left where labels go [pixels].
    """

    def __init__(
        self, brush: Brush, terrain: Terrain, size: tuple[int, int], scale: float, clear: float
    ) -> None:
        self._brush, self._size, self._scale, self._clear = brush, size, scale, clear
        self._knots, self._heights = terrain.x, np.array(terrain.height)
        self._level = bool(np.ptp(self._heights) == 0)
        self.patches = find_patches(terrain)
        self._starts = np.array([patch.start for patch in self.patches])
        self._column = np.linspace(0, size[0], size[0] // 6 + 1)  # where the surface is drawn [pixels]

    def height(self, x: Any) -> Any:
        """Height of the undisturbed ground [m]."""
        return np.interp(x, self._knots, self._heights)

    def kinds(self) -> list[tuple[str, Colour]]:
        """Name and colour of every kind of ground in the terrain but the usual."""
        found = []
        for name, colour, there in (
            ("stiffer ground", STIFFER, any(p.stiffness > 1 + ALIKE for p in self.patches)),
            ("softer ground", SOFTER, any(p.stiffness < 1 - ALIKE for p in self.patches)),
            ("more slippery", SLIPPERY, any(p.friction < 1 - ALIKE for p in self.patches)),
            ("less slippery", ROUGHER, any(p.friction > 1 + ALIKE for p in self.patches)),
        ):
            if there:
                found.append((name, colour))
        return found

    def draw(self, canvas: Any, now: Instant, corner: complex) -> None:
        """Draw the ground.

        Args:
            canvas: the picture.
            now: where the hoof is and what it bears.
            corner: place in the world of the picture's left edge at pixel row 0 [m].
        """
        columns = self._column
        dent = None
        if max(now.toe_depth, now.heel_depth) > 0:
            at = (min(now.toe_x, now.heel_x) - corner.real) * self._scale
            width = (abs(now.toe_x - now.heel_x) + 6 * FLANK_M) * self._scale
            columns = np.unique(
                np.concatenate([columns, np.arange(at - 3 * FLANK_M * self._scale, at + width, 2)])
            )
            columns = columns[(columns >= 0) & (columns <= self._size[0])]
            dent = footprint(now, corner.real + columns / self._scale)
        x = corner.real + columns / self._scale
        y = self.height(x) if not self._level else np.full(len(x), self._heights[0])
        free = (corner.imag - y) * self._scale
        if self._level:
            free = np.round(free)  # a sharp line
        surface = free if dent is None else free + dent * self._scale
        self._fill(canvas, columns, surface, SOIL)
        for patch in self._visible(x[0], x[-1]):
            inside = (x >= patch.start) & (x <= patch.end)
            ends = np.clip([patch.start, patch.end], x[0], x[-1])
            edge = (ends - corner.real) * self._scale
            part = np.concatenate([edge[:1], columns[inside], edge[1:]])
            self._fill(canvas, part, np.interp(part, columns, surface), body(patch.stiffness))
        if dent is not None and now.normal > 0:
            self._press(canvas, columns, free, surface)
        self._draw_skin(canvas, columns, surface, x, corner)
        self._draw_ticks(canvas, corner)

    def _fill(self, canvas: Any, columns: Any, surface: Any, colour: Colour) -> None:
        if len(columns) > 1:
            bottom = self._size[1] + 1
            line = list(zip(columns.tolist(), surface.tolist(), strict=True))
            pygame.draw.polygon(canvas, colour, [(line[0][0], bottom), *line, (line[-1][0], bottom)])

    def _visible(self, left: float, right: float) -> list[Patch]:
        first = max(int(np.searchsorted(self._starts, left)) - 1, 0)
        last = int(np.searchsorted(self._starts, right))
        return [p for p in self.patches[first:last] if p.end > left]

    def _press(self, canvas: Any, columns: Any, free: Any, surface: Any) -> None:
        """Darken the soil under the footprint, in bands that fade with depth."""
        dent = surface - free
        pressed = np.flatnonzero(dent > 0.5)
        if len(pressed):
            part = slice(max(pressed[0] - 1, 0), pressed[-1] + 2)
            x, top, deep = columns[part].tolist(), surface[part], dent[part]
            above = list(zip(x, top.tolist(), strict=True))
            for reach, shade in PRESSED:
                below = list(zip(x, (top + reach * deep).tolist(), strict=True))
                pygame.draw.polygon(canvas, mix(SOIL, SOIL_LINE, shade), [*above, *below[::-1]])

    def _draw_skin(self, canvas: Any, columns: Any, surface: Any, x: Any, corner: complex) -> None:
        thick = max(1, round(2 * self._brush.unit))
        for patch in self._visible(x[0], x[-1]):
            colour = skin(patch.friction)
            if colour is None:
                continue
            ends = (np.clip([patch.start, patch.end], x[0], x[-1]) - corner.real) * self._scale
            inside = columns[(columns > ends[0]) & (columns < ends[1])]
            part = np.concatenate([ends[:1], inside, ends[1:]])
            top = np.interp(part, columns, surface)
            deep = top + 8 * self._brush.unit
            band = [*zip(part.tolist(), top.tolist(), strict=True)]
            band += [*zip(part[::-1].tolist(), deep[::-1].tolist(), strict=True)]
            pygame.draw.polygon(canvas, colour, band)
        line = list(zip(columns.tolist(), surface.tolist(), strict=True))
        for shift in range(thick):
            pygame.draw.aalines(canvas, SOIL_LINE, False, [(a, b + shift) for a, b in line])

    def _draw_ticks(self, canvas: Any, corner: complex) -> None:
        unit, scale = self._brush.unit, self._scale
        thick = max(1, round(2 * unit))
        first, last = corner.real, corner.real + self._size[0] / scale
        for half in range(int(np.floor(2 * first)), int(np.ceil(2 * last)) + 1):
            x, metre = half / 2, half % 2 == 0
            at = (x - first) * scale
            top = round((corner.imag - float(self.height(x))) * scale)
            length = round((10 if metre else 6) * unit)
            canvas.fill(SOIL_LINE, (round(at - thick / 2), top, thick if metre else 1, length))
            if metre:
                self._brush.write(canvas, f"{half // 2} m", (at, top + 13 * unit), 17, SOIL_LINE, "midtop")
        last = first + self._clear / scale
        for patch in self._visible(first, last):
            ends = np.clip([patch.start, patch.end], first, last)
            words = [
                f"{sign} × {factor:.2g}"
                for sign, factor in (("stiffness", patch.stiffness), ("friction", patch.friction))
                if abs(factor - 1) > ALIKE
            ]
            if (ends[1] - ends[0]) * scale < 90 * unit:
                continue
            middle = float(ends.mean())
            x = (middle - first) * scale
            y = (corner.imag - float(self.height(middle))) * scale + 36 * unit
            for k, text in enumerate(words):
                self._brush.write(canvas, text, (x, y + 15 * k * unit), 16, SOIL_LINE, "midtop")


def footprint(now: Instant, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far the ground at `x` is pressed down [m]: as deep as the sole, running out on both sides.

    The contact knows two points without width; the flanks are there for the eye alone.
    """
    (a, deep_a), (b, deep_b) = sorted(((now.toe_x, now.toe_depth), (now.heel_x, now.heel_depth)))
    inside = np.interp(x, [a, max(b, a + 1e-9)], [deep_a, deep_b])
    outside = np.maximum(a - x, x - b)
    fall = np.exp(-np.square(np.maximum(outside, 0.0) / FLANK_M))
    return np.maximum(inside, 0.0) * np.where(outside > 0, fall, 1.0)


def find_patches(terrain: Terrain) -> list[Patch]:
    """Stretches of one kind, all but the usual; a change over one spacing counts half to either side."""
    factors = np.array([terrain.stiffness, terrain.friction])
    kind = np.round(factors / ALIKE).astype(np.int64)
    edges = np.flatnonzero((np.diff(kind, axis=1) != 0).any(axis=0)) + 1
    bounds = [0, *edges.tolist(), factors.shape[1]]
    patches = []
    for first, end in pairwise(bounds):
        stiffness, friction = factors[:, first:end].mean(axis=1).tolist()
        if max(abs(stiffness - 1), abs(friction - 1)) > ALIKE:
            left = -np.inf if first == 0 else terrain.start + (first - 0.5) * terrain.spacing
            right = np.inf if end == factors.shape[1] else terrain.start + (end - 0.5) * terrain.spacing
            patches.append(Patch(left, right, stiffness, friction))
    return patches


def body(stiffness: float) -> Colour:
    """Colour of soil by its factor of stiffness."""
    return mix(SOIL, STIFFER if stiffness > 1 else SOFTER, _strength(stiffness))


def skin(friction: float) -> Colour | None:
    """Colour of the surface by its factor of friction; None where it is usual."""
    if abs(friction - 1) <= ALIKE:
        return None
    return mix(PAPER, SLIPPERY if friction < 1 else ROUGHER, 0.35 + 0.65 * _strength(friction))


def _strength(factor: float) -> float:
    return min(abs(float(np.log(max(factor, 1e-3)))) / float(np.log(STRONG)), 1.0)
