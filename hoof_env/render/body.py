"""The body, painted with smooth edges: the trunk with what holds it, and the leg with flesh, links and
joints."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pygame

from hoof_env.leg.geometry import Geometry
from hoof_env.leg.linkage import BODIES
from hoof_env.leg.linkage import CRANK as CRANK_BODY

COAT, COAT_EDGE, PASTERN, HOOF = (226, 210, 194), (186, 163, 141), (196, 170, 146), (104, 74, 54)
LINK, PLATE = (64, 78, 92), (186, 195, 205)

TRUNK_M = (1.05, 0.42, 0.16)
"""The trunk about O: half its length, its height above and below [m]."""

HOLD_M = {"suspended": 0.0, "rail": 0.1, "fixed": 0.16}
"""Height above the trunk of what holds it and is painted with it: nothing, wheels, a bolted plate [m]."""

PLATE_M, BRACKET_M = 0.09, 0.2
"""Height of the plate's hatching, and length of each bracket between plate and trunk [m]."""

FLESH_M = (("O", "C", 0.13, 0.15), ("C", "F", 0.15, 0.095), ("F", "G", 0.085, 0.055))
"""Flesh around the rigid links where a horse's leg has its bones: from, to, radius at both ends [m]."""

HORN_SHARE = 0.45
"""Part of the hoof triangle, from the sole up, that is horn; above it is the pastern."""


class Body:
    """Draws trunk and leg, `scale` pixels per metre; by its kind the trunk is on a spring, on wheels under a
    rail, or bolted to a plate."""

    def __init__(self, brush: Brush, geometry: Geometry, scale: float, trunk: str) -> None:
        self._brush, self._scale, self._kind = brush, scale, trunk
        self._hold = HOLD_M[trunk] * scale
        self._crank = geometry.lengths["OP"]
        self._trunk = self._paint_trunk()

    def _paint_trunk(self) -> Any:
        half, above, below = (self._scale * length for length in TRUNK_M)
        hold, ends = self._hold, (half / 2, 3 * half / 2)
        image = pygame.Surface((round(2 * half), round(hold + above + below)), pygame.SRCALPHA, 32)

        def paint(fine: Any, place: Any) -> None:
            if self._kind == "rail":
                for x in ends:
                    pygame.draw.circle(fine, GREY, place(complex(x, hold / 2)), hold / 2 * FINE)
            elif self._kind == "fixed":
                self._paint_mount(fine, place, ends)
            hollow = round(hold * FINE)
            barrel = pygame.Rect(0, hollow, fine.get_width(), fine.get_height() - hollow)
            for colour, inset in ((COAT_EDGE, 0), (COAT, round(1.5 * FINE))):
                radius = round(0.25 * self._scale * FINE) - inset
                pygame.draw.rect(fine, colour, barrel.inflate(-2 * inset, -2 * inset), border_radius=radius)

        self._brush.smooth(image, [0j, complex(*image.get_size())], 0, paint)
        return image

    def _paint_mount(self, fine: Any, place: Any, ends: tuple[float, float]) -> None:
        """The plate that holds a fixed trunk, hatched as drawings have it, and its brackets."""
        plate, line = PLATE_M * self._scale, round(2 * self._brush.unit * FINE)
        for x in np.arange(-plate, fine.get_width() / FINE, plate).tolist():
            pygame.draw.line(fine, GREY, place(complex(x, plate)), place(complex(x + plate, 0)), line)
        left, top = place(complex(0, plate))
        pygame.draw.rect(fine, GREY, (left, top - line, fine.get_width(), 2 * line))
        for x in ends:
            long = BRACKET_M * self._scale
            corner = place(complex(x - long / 2, plate))
            pygame.draw.rect(fine, GREY, (*corner, long * FINE, (self._hold - plate + 1) * FINE))

    def draw_support(self, canvas: Any, hip: complex) -> None:
        """Draw the spring or the rail that holds a trunk around O at pixel `hip`."""
        top = hip - 1j * self._scale * TRUNK_M[1]
        if self._kind == "suspended":
            coil = np.linspace(complex(hip.real, 0), top, 17)
            coil[2:-2] += 0.06 * self._scale * np.resize([1, -1], 13)

            def paint(fine: Any, place: Any) -> None:
                width = round(2 * self._brush.unit * FINE)
                pygame.draw.lines(fine, GREY, False, [place(z) for z in coil.tolist()], width)

            self._brush.smooth(canvas, coil, 3, paint)
        elif self._kind == "rail":
            rail = top.imag - self._hold
            thick = max(2, round(4 * self._brush.unit))
            canvas.fill(GREY, (0, round(rail) - thick, canvas.get_width(), thick))

    def draw_trunk(self, canvas: Any, hip: complex, pitch: float = 0.0) -> None:
        """Draw the trunk around O at pixel `hip`, turned by `pitch` [rad]."""
        half, above, below = (self._scale * length for length in TRUNK_M)
        high = above + self._hold
        image = self._trunk
        corner = hip - complex(half, high)
        if pitch:
            image = pygame.transform.rotozoom(image, float(np.degrees(pitch)), 1.0)
            middle = hip + 0.5j * (below - high) * np.exp(-1j * pitch)
            corner = middle - complex(*image.get_size()) / 2
        at = round(corner.real), round(corner.imag)
        canvas.blit(image, at, special_flags=pygame.BLEND_PREMULTIPLIED)

    def draw_leg(self, canvas: Any, pixels: dict[str, complex]) -> None:
        """Draw the leg; `pixels` holds every named point."""
        metre = self._scale * FINE  # on the fine surface
        edge = 1.5 * FINE

        def paint(fine: Any, place: Any) -> None:
            at = {name: place(z) for name, z in pixels.items()}
            horn = [place(pixels[n] + HORN_SHARE * (pixels["G"] - pixels[n])) for n in "JI"]
            for colour, grow in ((COAT_EDGE, edge), (COAT, 0.0)):
                for a, b, radius_a, radius_b in FLESH_M:
                    bar(fine, colour, at[a], at[b], radius_a * metre + grow, radius_b * metre + grow)
            pygame.draw.polygon(fine, PASTERN, [at["G"], at["I"], at["J"]])
            pygame.draw.polygon(fine, HOOF, [at["I"], at["J"], *horn])
            pygame.draw.circle(fine, CRANK, at["O"], self._crank * metre, round(1.3 * FINE))
            bar(fine, PLATE, at["O"], at["C"], 0.02 * metre, 0.02 * metre)
            pygame.draw.polygon(fine, PLATE, [at["C"], at["B"], at["D"]])
            for i, link in enumerate(BODIES):
                colour, radius = (CRANK, 0.024 * metre) if i == CRANK_BODY else (LINK, 0.015 * metre)
                bar(fine, colour, at[link.tail], at[link.head], radius, radius)
            for name, where in at.items():
                radius = (0.038 if name in "OC" else 0.025) * metre
                pygame.draw.circle(fine, INK, where, radius)
                pygame.draw.circle(fine, PAPER, where, radius - edge)
            for pivot in "OC":
                pygame.draw.circle(fine, INK, at[pivot], 0.013 * metre)

        turn = self._crank * self._scale * (1 + 1j)
        box = [*pixels.values(), pixels["O"] - turn, pixels["O"] + turn]
        self._brush.smooth(canvas, box, 0.16 * self._scale + 2, paint)
        for pivot, side, shift in (("O", "midbottom", -0.05j), ("C", "midleft", 0.06)):
            letter = pixels[pivot] + shift * self._scale
            self._brush.write(canvas, pivot, (letter.real, letter.imag), 18, INK, side)


INK, GREY, FAINT, PAPER = (34, 43, 53), (88, 99, 111), (216, 222, 228), (255, 255, 255)
FORCE, TOE, HEEL, CRANK = (213, 94, 0), (0, 114, 178), (204, 121, 167), (0, 158, 115)
"""Vermilion, blue, reddish purple and bluish green of Okabe and Ito's palette, which any colour vision tells
apart."""

FINE = 2
"""Resolution of smooth painting over that of the picture."""

Colour = tuple[int, int, int]
Position = tuple[float, float]


_fonts: dict[int, Any] = {}


def _font(size: int) -> Any:
    """The font that pygame brings along, the same everywhere; made anew after anybody's `pygame.quit()`."""
    if not pygame.font.get_init():  # a font of before crashes pygame; pygame-ce refuses it
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
        unit: 1 for a picture of 960 x 540 pixels; line widths and letters grow with it.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.unit = min(size[0] / 960, size[1] / 540)
        self._letters = lru_cache(maxsize=1024)(self._paint_letters)
        self._frame = pygame.Rect((0, 0), size)

    def write(
        self, canvas: Any, text: str, at: Position, size: int, colour: Colour, side: str = "midleft"
    ) -> None:
        """Write with the corner or edge `side` (a name of pygame.Rect's) of the text `at` a pixel."""
        image = self._letters(text, size, colour)
        place = image.get_rect(**{side: (round(at[0]), round(at[1]))})
        canvas.blit(image, place, special_flags=pygame.BLEND_PREMULTIPLIED)

    def _paint_letters(self, text: str, size: int, colour: Colour) -> Any:
        image = _font(round(size * self.unit * FINE)).render(text, True, colour)
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
        side, then scale down onto `canvas`; what lies outside the picture is left out.

        `paint` is called with the fine surface and the map from a pixel (complex) to a position on it.
        """
        x, y = np.real(points), np.imag(points)
        left, top = int(np.floor(x.min() - margin)), int(np.floor(y.min() - margin))
        right, bottom = int(np.ceil(x.max() + margin)), int(np.ceil(y.max() + margin))
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


def mix(one: Colour, two: Colour, part: float) -> Colour:
    """The colour `part` of the way from `one` to `two`."""
    red, green, blue = (round(a + part * (b - a)) for a, b in zip(one, two, strict=True))
    return red, green, blue


def bar(surface: Any, colour: Colour, a: Position, b: Position, radius_a: float, radius_b: float) -> None:
    """A bar from `a` to `b` with round ends."""
    one, two = complex(*a), complex(*b)
    side = 1j * (two - one) / max(abs(two - one), 1e-9)
    corners = (one + radius_a * side, two + radius_b * side, two - radius_b * side, one - radius_a * side)
    pygame.draw.polygon(surface, colour, [(z.real, z.imag) for z in corners])
    pygame.draw.circle(surface, colour, a, radius_a)
    pygame.draw.circle(surface, colour, b, radius_b)


def arrow(surface: Any, colour: Colour, a: Position, b: Position, width: float, grow: float = 0.0) -> None:
    """An arrow from `a` to `b`, grown on all sides by `grow`; the head of a short one shrinks with it."""
    tail, tip = complex(*a), complex(*b)
    along = (tip - tail) / max(abs(tip - tail), 1e-9)
    head = min(3.0 * width, abs(tip - tail))
    neck = tip - (head + grow) * along
    half, wide = (width / 2 + grow) * 1j * along, (0.45 * head + 1.6 * grow) * 1j * along
    tip += 1.6 * grow * along
    shape = (tail + half, neck + half, neck + wide, tip, neck - wide, neck - half, tail - half)
    pygame.draw.polygon(surface, colour, [(z.real, z.imag) for z in shape])
