"""Sizes of pictures in pixels, without a library that draws."""

from __future__ import annotations

from typing import Any

from hoof_env.errors import ParameterError, brief, count

MIN_SIZE = (480, 270)  # below this the lettering is not readable [pixels]
USUAL_SIZE = 960, 540  # [pixels]
MAX_SIDE = 8192  # largest width and height [pixels]; a canvas of both takes 270 MB


def check_side(name: str, pixels: Any) -> int:
    """Return the "width" or "height" of a picture [pixels]; raise `ParameterError` if it is out of range."""
    return count(name, pixels, MIN_SIZE[name == "height"], MAX_SIDE)


def check_size(size: Any) -> tuple[int, int]:
    """Return the width and height of a picture [pixels]; raise `ParameterError` if they are out of range."""
    low_w, low_h = MIN_SIZE
    high = MAX_SIDE
    try:
        width, height = size
        good = high >= width == int(width) >= low_w and high >= height == int(height) >= low_h
    except (TypeError, ValueError):
        good = False
    if not good:
        raise ParameterError(
            f"size: expected (width, height) from {low_w} x {low_h} to {high} x {high} pixels, got"
            f" {brief(size)}"
        )
    return int(width), int(height)
