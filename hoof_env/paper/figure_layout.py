"""Where things stand on a printed figure: everything in millimetres from its upper left corner."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hoof_env.paper.figure_style import GREY, SMALL, SOLVER

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

WIDTH = 175.0
"""Two columns of a journal [mm]."""

LEFT, GAP = 14.0, 13.0
"""Room for the vertical axis of the first panel and of the second [mm]."""

HEAD = 13.0
"""Height of the lines above the panels [mm]."""

INCH = 25.4
"""[mm]"""


def set_size(figure: Any, height: float) -> None:
    """Make the figure `WIDTH` wide and `height` high [mm]; its axes stand where `panel` puts them."""
    figure.set_layout_engine("none")
    figure.set_size_inches(WIDTH / INCH, height / INCH)


def _place(figure: Any, left: float, top: float) -> tuple[float, float]:
    """A place in parts of the figure."""
    across, down = figure.get_size_inches() * INCH
    return left / across, 1 - top / down


def panel(figure: Any, left: float, top: float, width: float, height: float, **settings: Any) -> Any:
    """New axes by their upper left corner and their size [mm]."""
    (x, low), (right, y) = (_place(figure, left, top + height), _place(figure, left + width, top))
    axes = figure.add_axes((x, low, right - x, y - low))
    axes.set(**settings)
    return axes


def write(figure: Any, left: float, top: float, text: str, **settings: Any) -> None:
    """Plain text by its upper left corner [mm]."""
    figure.text(*_place(figure, left, top), text, va="top", parse_math=False, **settings)


def head(figure: Any, reproduction: Reproduction, title: str, ground: str, note: str) -> None:
    """What the figure shows; below, that the leg is identified, its preset, solver and ground; a note."""
    write(figure, 1, 1, title, weight="bold")
    preset = Path(reproduction.geometry.name).name
    leg = f"Identified leg, not published (preset {preset}); {SOLVER} solver; {ground} ground."
    write(figure, 1, 5, leg, fontsize=SMALL, color=GREY)
    write(figure, 1, 8.4, note, fontsize=SMALL, color=GREY)


def name_height(ax: Any, text: str, width: float) -> None:
    """Name the vertical axis of a panel `width` [mm], clear of the numbers whatever their length."""
    ax.set_ylabel(text, va="bottom")
    ax.yaxis.set_label_coords(-9.5 / width, 0.5)


def name_travel(figure: Any, left: float, top: float, width: float) -> None:
    """The direction of travel at the right end of the line that names a panel [mm]."""
    write(figure, left + width - 17.5, top + 0.3, "travel", fontsize=SMALL, color=GREY)
    start, end = (_place(figure, left + width - off, top + 1.7) for off in (8, 0))
    draw_arrow(figure, start, end, GREY, transform=figure.transFigure, lw=0.9)


def draw_arrow(where: Any, start: Any, end: Any, colour: str, **settings: Any) -> None:
    """An arrow on a figure or on axes."""
    from matplotlib.patches import FancyArrowPatch

    settings = {"lw": 1.3, "zorder": 8} | settings
    head: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 7, "shrinkA": 0, "shrinkB": 0}
    where.add_artist(FancyArrowPatch(tuple(start), tuple(end), color=colour, **head, **settings))


def legend_below(figure: Any, *axes: Any, columns: int) -> None:
    """One legend at the foot of the figure, every label once."""
    entries = {
        label: line for ax in axes for line, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc="lower center", ncols=columns, borderaxespad=0.2)
