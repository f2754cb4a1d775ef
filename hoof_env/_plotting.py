"""How pictures with matplotlib look: colours and type, for pages."""

from __future__ import annotations

from typing import Any

from hoof_env.errors import HoofEnvError

BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER, GREY, SOIL = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#666666", "#EFE6D8",
)  # fmt: skip
"""Okabe and Ito's colours, told apart by colour-blind readers, a grey and the ground."""

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
"""For pictures on a page."""


def check_matplotlib() -> None:
    """Raise `HoofEnvError` with the way out unless matplotlib can be imported."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise HoofEnvError(
            'figures need matplotlib: pip install "hoof-env[plot]", or leave them out with --no-figures'
        ) from None
