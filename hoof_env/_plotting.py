"""Style of pictures with matplotlib, for pages: colours and type."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from hoof_env.errors import MissingExtraError

# Okabe and Ito's colours, which colour-blind readers can distinguish
BLUE = "#0072B2"
ORANGE = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
SKY = "#56B4E9"
AMBER = "#E69F00"
GREY = "#666666"
SOIL = "#EFE6D8"
"""Colour of the ground; the colours above are Okabe and Ito's, and a grey."""

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "svg.hashsalt": "hoof-env",
    "savefig.dpi": 200,
}
"""Settings of matplotlib for pictures on a page."""


def check_matplotlib(instead: str = "") -> None:
    """Raise `MissingExtraError`, which says what to do, unless matplotlib can be imported; `instead` is what
    else helps."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise MissingExtraError(f'figures need matplotlib: pip install "hoof-env[plot]"{instead}') from None


def save_png(figure: Any, path: Path, dpi: int = 110) -> None:
    """Write a picture of curves with a palette: the same to the eye, in a third of the bytes."""
    # matplotlib needs Pillow, too
    from PIL import Image

    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=dpi)
    with Image.open(drawn) as picture:
        # Few pixels of a thin line must not lose their colour to large areas, as with the median cut
        few = picture.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
        few.save(path, format="png", optimize=True)
