"""The scene of a horse: the whole animal, far legs behind the trunk and near legs in front of it, and the
forces.

The camera follows the trunk along x and stays at a constant height over the ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pygame

from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry
from hoof_env.record.instant import BodyInstant, Instant
from hoof_env.render.brush import FINE, Brush, arrow, bar
from hoof_env.render.colours import COAT, COAT_EDGE, CRANK, FORCE, GREY, HEEL, TOE
from hoof_env.render.ground import GroundPainter
from hoof_env.render.outline import AROUND_M, ARROW_M, BODY, EAR, FAR, HORSE_HIP_M, TAIL, LegOutline
from hoof_env.render.scene import LegScene

FAR_COAT = 0.45  # opacity of far legs [-]
WIDE_M = (1.75, 2.25)
"""Visible width behind and ahead of the trunk's centre [m]."""

SOIL_M = 0.45
"""Visible depth below the ground [m]."""
ARROW_SHARE = 0.75  # length of a full-scale arrow / one leg's scene's, at the usual hips [-]


class HorseScene(LegScene):
    """Draws one instant into a picture of `size`, whose `right` pixels the animal leaves free."""

    def __init__(
        self, brush: Brush, geometry: Geometry, terrain: Terrain, size: tuple[int, int], right: int
    ) -> None:
        self._brush = brush
        self._geometry = geometry
        self._size = size
        self._animal = geometry.hip_height / HORSE_HIP_M
        self._centre = (size[0] - right) * WIDE_M[0] / sum(WIDE_M)
        self._scale = (size[0] - right) / sum(WIDE_M) / self._animal
        self._girth = self._animal
        self._share = ARROW_SHARE * self._animal
        self._level = size[1] - SOIL_M * self._animal * self._scale
        self._camera = 0j
        self._ground = GroundPainter(brush, terrain, size, self._scale, size[0] - right)
        self._leg = LegOutline(geometry)
        self._sky = self._paint_sky()
        self._key = lru_cache(maxsize=8)(self._paint_key)

    def reset(self) -> None:
        """Do nothing, as the scene shows no paths."""

    def add(self, instants: Sequence[Any]) -> None:
        """Do nothing, as the scene shows no paths."""

    def draw(self, canvas: Any, now: Any, full_scale: float) -> None:
        """Draw an instant; the arrow of a force of `full_scale` [N] is equally long in pictures of animals of
        all sizes."""
        level = float(self._ground.height(now.x + self._animal * AROUND_M).mean())
        self._camera = complex(now.x, level)
        canvas.blit(self._sky, (0, 0))
        self._ground.draw(canvas, self._soles(now.legs), self.corner)
        for i, leg in enumerate(now.legs):
            if i in FAR:
                self._draw_far_leg(canvas, leg)
        self._draw_body(canvas, now)
        for i, leg in enumerate(now.legs):
            if i not in FAR:
                self._draw_near_leg(canvas, leg)
        for leg in now.legs:
            self._draw_forces(canvas, leg, full_scale, self._share, is_told=False)
        canvas.blit(self._key(full_scale), (0, 0), special_flags=pygame.BLEND_PREMULTIPLIED)

    def _draw_near_leg(self, canvas: Any, leg: Instant) -> None:
        pixels = self.points_of(leg)
        self._draw_leg(canvas, pixels, self._sole(pixels, leg), lettered=False)

    def _draw_far_leg(self, canvas: Any, leg: Instant) -> None:
        far = pygame.Surface(self._size, pygame.SRCALPHA, 32)
        self._draw_near_leg(far, leg)
        far.fill((255, 255, 255, round(255 * FAR_COAT)), special_flags=pygame.BLEND_RGBA_MULT)
        far.fill((round(255 * FAR_COAT),) * 3 + (255,), special_flags=pygame.BLEND_RGBA_MULT)
        canvas.blit(far, (0, 0), special_flags=pygame.BLEND_PREMULTIPLIED)

    def _draw_body(self, canvas: Any, now: BodyInstant) -> None:
        centre = complex(now.x, now.y)
        turn = np.exp(1j * now.pitch)
        metre = self._scale * self._animal

        def at(point: tuple[float, float]) -> complex:
            return complex(self._pixels(centre + self._animal * turn * complex(*point)))

        parts = [(at(a), at(b), one * metre, other * metre) for a, b, one, other in (TAIL, EAR, *BODY)]

        def paint(fine: Any, place: Any) -> None:
            for colour, grow in ((COAT_EDGE, 1.5 * FINE), (COAT, 0.0)):
                for a, b, one, other in parts:
                    bar(fine, colour, place(a), place(b), one * FINE + grow, other * FINE + grow)

        self._brush.smooth(canvas, [z for part in parts for z in part[:2]], 0.4 * metre, paint)

    def _paint_key(self, full_scale: float) -> Any:
        unit = self._brush.unit
        force = full_scale / 5
        length = self._share * ARROW_M * self._scale / 5
        image = pygame.Surface(self._size, pygame.SRCALPHA, 32)
        rows = [(20 + (20 + 20 * k) * 1j) * unit for k in range(4)]

        def paint(fine: Any, place: Any) -> None:
            arrow(fine, FORCE, place(rows[0]), place(rows[0] + length), 7 * unit * FINE)
            for at, (colour, radius) in zip(rows[1:], ((TOE, 1.2), (HEEL, 1.2), (CRANK, 3.3)), strict=True):
                bar(fine, colour, place(at), place(at + length), radius * unit * FINE, radius * unit * FINE)

        self._brush.smooth(image, [*rows, rows[-1] + length], 10 * unit, paint)
        words = f"{force / 1000:g} kN on a hoof", "force on the toe", "force on the heel", "crank"
        for at, text in zip(rows, words, strict=True):
            where = at + length + 12 * unit
            self._brush.write(image, text, (where.real, where.imag), 19, GREY)
        return image
