"""Colours of pictures and pages, as red, green and blue from 0 to 255."""

from __future__ import annotations

Colour = tuple[int, int, int]

INK = (34, 43, 53)
GREY = (88, 99, 111)
FAINT = (216, 222, 228)
PAPER = (255, 255, 255)
FORCE = (213, 94, 0)
TOE = (0, 114, 178)
HEEL = (204, 121, 167)
CRANK = (0, 158, 115)
"""Vermilion, blue, reddish purple and bluish green of Okabe and Ito's palette, which people with any colour
vision can tell apart."""

SKY_TOP = (219, 231, 242)
SKY_BOTTOM = (249, 250, 252)
COAT = (226, 210, 194)
COAT_EDGE = (186, 163, 141)
PASTERN = (196, 170, 146)
HOOF = (104, 74, 54)
LINK = (64, 78, 92)
PLATE = (186, 195, 205)

SOIL = (214, 200, 174)
SOIL_LINE = (112, 95, 66)
STIFFER = (150, 152, 158)
SOFTER = (238, 226, 170)
SLIPPERY = (86, 180, 233)
ROUGHER = (90, 50, 20)
"""Body of the soil where it is stiffer or softer; its skin where it is more slippery or rougher."""

OF_LEGS: tuple[Colour, ...] = (TOE, (86, 180, 233), HEEL, (230, 159, 0))
"""Colours of a horse's legs: blue and sky blue for fore, reddish purple and orange for hind."""


def mix(one: Colour, two: Colour, part: float) -> Colour:
    """Return the colour `part` of the way from `one` to `two`."""
    red, green, blue = (round(a + part * (b - a)) for a, b in zip(one, two, strict=True))
    return red, green, blue
