"""The trunk of one leg and its support: a spring, a boom, a rail or a plate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pygame

from hoof_env.render.brush import FINE, Brush
from hoof_env.render.colours import COAT, COAT_EDGE, GREY
from hoof_env.render.outline import HOLD_M, TRUNK_M


class TrunkPainter:
    """Painter of a trunk of a `kind`, `metre` pixels per metre; it paints the trunk once and then copies it.

    Places are pixels as complex numbers, with y down.
    """

    def __init__(self, brush: Brush, kind: str, metre: float) -> None:
        self._brush = brush
        self._kind = kind
        self._metre = metre
        self._half, self._above, self._below = (metre * length for length in TRUNK_M)
        self._image = self._paint()

    def draw(self, canvas: Any, hip: complex, pitch: float) -> None:
        """Draw the trunk around the crank centre at `hip`, turned by `pitch` [rad]."""
        image = self._image
        corner = hip - complex(self._half, self._above)
        if pitch:
            image = pygame.transform.rotozoom(image, float(np.degrees(pitch)), 1.0)
            middle = hip + 0.5j * (self._below - self._above) * np.exp(-1j * pitch)
            corner = middle - complex(*image.get_size()) / 2
        at = round(corner.real), round(corner.imag)
        canvas.blit(image, at, special_flags=pygame.BLEND_PREMULTIPLIED)

    def draw_support(self, canvas: Any, hip: complex) -> None:
        """Draw the support of the trunk around the crank centre at `hip`; a floating one has none."""
        top = hip - 1j * self._above
        if self._kind == "suspended":
            self._draw_spring(canvas, top)
        elif self._kind == "boom":
            self._draw_boom(canvas, hip)
        elif self._kind != "floating":
            self._draw_rail_or_plate(canvas, top)

    def _draw_spring(self, canvas: Any, top: complex) -> None:
        coil = np.linspace(complex(top.real, 0), top, 17)
        coil[2:-2] += 0.06 * self._metre * np.resize([1, -1], 13)

        def paint(fine: Any, place: Any) -> None:
            width = round(2 * self._brush.unit * FINE)
            pygame.draw.lines(fine, GREY, False, [place(z) for z in coil.tolist()], width)

        self._brush.smooth(canvas, coil, 3, paint)

    def _draw_boom(self, canvas: Any, hip: complex) -> None:
        """Draw the end of a boom that comes towards the viewer, which keeps the trunk from pitching."""
        centre = hip - 0.5j * (self._above - self._below)
        for colour, share in ((GREY, 1.0), (COAT, 0.7), (GREY, 0.35)):
            self._brush.disc(canvas, colour, (centre.real, centre.imag), share * HOLD_M * self._metre)

    def _draw_rail_or_plate(self, canvas: Any, top: complex) -> None:
        """Draw a rail across the picture and wheels under it, or a hatched plate and two bolts."""
        hold = HOLD_M * self._metre
        thick = max(2, round(4 * self._brush.unit))
        rail = round(top.imag - hold)
        plate = canvas.get_rect()
        ends = [top - self._half / 2, top + self._half / 2]
        if self._kind == "rail":
            for end in ends:
                self._brush.disc(canvas, GREY, (end.real, end.imag - hold / 2), hold / 2)
        else:
            plate = pygame.Rect(round(top.real - self._half), 0, round(2 * self._half), 0)
            for x in np.arange(plate.left, plate.right, hold).tolist():  # hatched as drawings have it
                pygame.draw.aaline(canvas, GREY, (x, rail - thick), (x + hold, rail - thick - hold))
            for end in ends:
                canvas.fill(GREY, (round(end.real - hold), rail, round(2 * hold), round(hold) + 1))
        canvas.fill(GREY, (plate.left, rail - thick, plate.width, thick))

    def _paint(self) -> Any:
        size = round(2 * self._half), round(self._above + self._below)
        image = pygame.Surface(size, pygame.SRCALPHA, 32)

        def paint(fine: Any, place: Any) -> None:
            for colour, inset in ((COAT_EDGE, 0), (COAT, round(1.5 * FINE))):
                radius = round(0.25 * self._metre * FINE) - inset
                barrel = fine.get_rect().inflate(-2 * inset, -2 * inset)
                pygame.draw.rect(fine, colour, barrel, border_radius=radius)

        self._brush.smooth(image, [0j, complex(*image.get_size())], 0, paint)
        return image
