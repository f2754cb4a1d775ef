"""Colours of pictures and pages, as red, green and blue from 0 to 255."""

from __future__ import annotations

Colour = tuple[int, int, int]

INK, GREY, FAINT, PAPER = (34, 43, 53), (88, 99, 111), (216, 222, 228), (255, 255, 255)
FORCE, TOE, HEEL, CRANK = (213, 94, 0), (0, 114, 178), (204, 121, 167), (0, 158, 115)
"""Vermilion, blue, reddish purple and bluish green of Okabe and Ito's palette, which any colour vision tells
apart."""

SKY_TOP, SKY_BOTTOM = (219, 231, 242), (249, 250, 252)
COAT, COAT_EDGE, PASTERN, HOOF = (226, 210, 194), (186, 163, 141), (196, 170, 146), (104, 74, 54)
LINK, PLATE = (64, 78, 92), (186, 195, 205)

SOIL, SOIL_LINE = (214, 200, 174), (112, 95, 66)
STIFFER, SOFTER = (150, 152, 158), (238, 226, 170)
SLIPPERY, ROUGHER = (86, 180, 233), (90, 50, 20)
"""Body of the soil where it is stiffer or softer; its skin where it is more slippery or rougher."""

OF_LEGS: tuple[Colour, ...] = (TOE, (86, 180, 233), HEEL, (230, 159, 0))
"""Colours of a horse's legs: blue and sky blue for fore, reddish purple and orange for hind."""


def mix(one: Colour, two: Colour, part: float) -> Colour:
    """Return the colour `part` of the way from `one` to `two`."""
    red, green, blue = (round(a + part * (b - a)) for a, b in zip(one, two, strict=True))
    return red, green, blue
