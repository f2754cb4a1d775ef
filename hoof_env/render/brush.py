"""Brush of pictures: lettering and smooth shapes."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pygame

from hoof_env.render.colours import Colour

FINE = 2  # resolution of smooth painting / resolution of the picture
MIN_LETTERS = 12  # least size of letters in pictures from 576 pixels of width on [pixels]
MIN_LETTERS_SHARE = 20  # least size in smaller pictures, whose panel holds no larger letters, in `Brush.unit`

Position = tuple[float, float]


_fonts: dict[int, Any] = {}


def _font(size: int) -> Any:
    """Return pygame's built-in font, the same on all systems; load it again after a `pygame.quit()`."""
    if not pygame.font.get_init():  # an older font crashes pygame, and pygame-ce refuses it
        _fonts.clear()
        pygame.font.init()
    if not _fonts:
        pygame.register_quit(_fonts.clear)
    if size not in _fonts:
        _fonts[size] = pygame.font.Font(None, size)
    return _fonts[size]


class Brush:
    """Lettering and smooth shapes for a picture of `size` pixels.

    Attributes:
        unit: 1 for a picture of 960 x 540 pixels; line widths and letters grow with it, and letters shrink
            to `MIN_LETTERS`, or below in a picture that is too small for them.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.unit = min(size[0] / 960, size[1] / 540)
        self._letters = lru_cache(maxsize=1024)(self._paint_letters)
        self._frame = pygame.Rect((0, 0), size)

    def write(
        self, canvas: Any, text: str, at: Position, size: int, colour: Colour, side: str = "midleft"
    ) -> None:
        """Write a text whose corner or edge `side`, an attribute of `pygame.Rect`, is `at` a pixel."""
        image = self._letters(text, size, colour)
        place = image.get_rect(**{side: (round(at[0]), round(at[1]))})
        canvas.blit(image, place, special_flags=pygame.BLEND_PREMULTIPLIED)

    def width(self, text: str, size: int) -> float:
        """Return the width of a text [pixels]."""
        return float(self._font(size).size(text)[0] / FINE)

    def _font(self, size: int) -> Any:
        """Return the font of letters of a size, at `FINE` times the resolution."""
        least = min(MIN_LETTERS, MIN_LETTERS_SHARE * self.unit)
        return _font(round(max(size * self.unit, least) * FINE))

    def _paint_letters(self, text: str, size: int, colour: Colour) -> Any:
        image = self._font(size).render(text, True, colour)
        image = image.copy().premul_alpha()  # the copy: pygame (not pygame-ce) misreads rows with padding
        return pygame.transform.smoothscale(image, (image.get_width() // FINE, image.get_height() // FINE))

    def smooth(
        self,
        canvas: Any,
        points: Any,
        margin: float,
        paint: Callable[[Any, Callable[[complex], Position]], None],
    ) -> None:
        """Paint at `FINE` times the resolution into the box around pixels (complex), `margin` wider on every
        side, then scale down onto `canvas`; parts outside the picture are clipped.

        `paint` is called with the fine surface and the map from a pixel (complex) to a position on it.
        """
        x = np.real(points)
        y = np.imag(points)
        left = int(np.floor(x.min() - margin))
        top = int(np.floor(y.min() - margin))
        right = int(np.ceil(x.max() + margin))
        bottom = int(np.ceil(y.max() + margin))
        box = pygame.Rect(left, top, right - left, bottom - top).clip(self._frame)
        if not box.width or not box.height:
            return
        fine = pygame.Surface((box.width * FINE, box.height * FINE), pygame.SRCALPHA, 32)
        paint(fine, lambda z: ((z.real - box.left) * FINE, (z.imag - box.top) * FINE))
        # opaque paint on transparent black is premultiplied by its alpha, and so is an average of it
        small = pygame.transform.smoothscale(fine, box.size)
        canvas.blit(small, box, special_flags=pygame.BLEND_PREMULTIPLIED)

    def disc(self, canvas: Any, colour: Colour, at: Position, radius: float) -> None:
        """Paint a smooth disc around a pixel."""

        def paint(fine: Any, place: Callable[[complex], Position]) -> None:
            pygame.draw.circle(fine, colour, place(complex(*at)), radius * FINE)

        self.smooth(canvas, [complex(*at)], radius + 1, paint)


def bar(surface: Any, colour: Colour, a: Position, b: Position, radius_a: float, radius_b: float) -> None:
    """Draw a bar from `a` to `b` with round ends."""
    one = complex(*a)
    two = complex(*b)
    side = 1j * (two - one) / max(abs(two - one), 1e-9)
    corners = (one + radius_a * side, two + radius_b * side, two - radius_b * side, one - radius_a * side)
    pygame.draw.polygon(surface, colour, [(z.real, z.imag) for z in corners])
    pygame.draw.circle(surface, colour, a, radius_a)
    pygame.draw.circle(surface, colour, b, radius_b)


def arrow(surface: Any, colour: Colour, a: Position, b: Position, width: float, grow: float = 0.0) -> None:
    """Draw an arrow from `a` to `b`, wider by `grow` on all sides; a short arrow has a smaller head."""
    tail = complex(*a)
    tip = complex(*b)
    along = (tip - tail) / max(abs(tip - tail), 1e-9)
    head = min(3.0 * width, abs(tip - tail))
    neck = tip - (head + grow) * along
    half = (width / 2 + grow) * 1j * along
    wide = (0.45 * head + 1.6 * grow) * 1j * along
    tip += 1.6 * grow * along
    shape = (tail + half, neck + half, neck + wide, tip, neck - wide, neck - half, tail - half)
    pygame.draw.polygon(surface, colour, [(z.real, z.imag) for z in shape])
