"""What the redrawn figures share: colours, type, layout, ground, poses, published values and sub-phases.

Panels and lines of text stand in millimetres from the upper left corner of the figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS as JOINTS
from hoof_env.paper.measure import POINTS, Stance, measure_stance
from hoof_env.paper.rows import PublishedRow, Reproduction

BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER, GREY, SOIL = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#666666", "#EFE6D8",
)  # fmt: skip
"""Okabe and Ito's colours, told apart by colour-blind readers, a grey and the ground."""

GAITS = {"walk": "Walking", "run": "Running"}
CONDITION_COLOURS = {"elastic": BLUE, "inelastic": ORANGE}
TOE, HEEL = PURPLE, GREEN
SOLVER = "exact"
"""The figures show this solver; the other one differs by its time step."""

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

SMALL = 7.0
"""Smallest type but for the numbers of links [points]."""

PRINT: dict[Any, Any] = {
    **STYLE,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "sans-serif"],
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "axes.labelpad": 2,
    "axes.linewidth": 0.6,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.fontsize": SMALL,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.4,
    "svg.fonttype": "none",
    "savefig.dpi": 300,
}
"""For print over two columns (`WIDTH`); in SVG text stays text."""


def points_at(geometry: Geometry, row: np.void) -> dict[str, NDArray[np.float64]]:
    """World position (x, y) [m] of every named point at one row of a trace."""
    frame = FrameMotion(phi=float(row["phi"]), position=(float(row["x"]), float(row["y"])))
    return dict(zip(JOINTS, pose(geometry, float(row["theta"]), frame=frame).points, strict=True))


def leg_at(reproduction: Reproduction, trace: NDArray[np.void], t: float) -> dict[str, NDArray[np.float64]]:
    """`points_at` the row of a trace nearest to an instant [s]."""
    return points_at(reproduction.geometry, trace[int(np.argmin(np.abs(trace["time"] - t)))])


def elastic_cycles(reproduction: Reproduction) -> dict[str, tuple[NDArray[np.void], Stance]]:
    """Trace and stance of each gait on elastic ground."""
    traces = {gait: reproduction.traces[gait, "elastic", SOLVER] for gait in GAITS}
    return {gait: (trace, measure_stance(trace)) for gait, trace in traces.items()}


def draw_ground(ax: Any, low: float) -> None:
    """Level ground y = 0, shaded down to `low`."""
    ax.axhspan(low, 0, color=SOIL, zorder=0, lw=0)
    ax.axhline(0, color=GREY, lw=0.8, zorder=1)


def mark_published(ax: Any, x: Any, y: Any, *, xerr: Any = None, yerr: Any = None) -> None:
    """Published values: one mark in all figures, with the bars within which they count as reproduced."""
    ax.errorbar(
        x, y, yerr, xerr, fmt="D", ms=4.2, mfc="white", mec="black", mew=0.9, ecolor="black",
        elinewidth=0.7, capsize=1.8, capthick=0.7, clip_on=False, zorder=9, label="published",
    )  # fmt: skip


def half_bar(row: PublishedRow) -> float:
    """How far a value may lie from the published one, in the row's unit; 0 where it is only reported."""
    limit = row.bar.limit or 0.0
    return abs(row.value) * limit / 100 if row.bar.measure == "%" else limit


WIDTH = 175.0  # two columns of a journal [mm]
LEFT, GAP = 14.0, 13.0  # room for the vertical axis of the first panel and of the second [mm]
HEAD = 13.0  # height of the lines above the panels [mm]
INCH = 25.4  # [mm]


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


def head(figure: Any, height: float, reproduction: Reproduction, title: str, ground: str, note: str) -> None:
    """Make the figure `WIDTH` wide and `height` high [mm] and head it: what it shows; that the leg is
    identified, its preset, solver and ground; a note."""
    figure.set_layout_engine("none")
    figure.set_size_inches(WIDTH / INCH, height / INCH)
    write(figure, 1, 1, title, weight="bold")
    preset = Path(reproduction.geometry.name).name
    leg = f"Identified leg, not published (preset {preset}); {SOLVER} solver; {ground} ground."
    write(figure, 1, 5, leg, fontsize=SMALL, color=GREY)
    write(figure, 1, 8.4, note, fontsize=SMALL, color=GREY)


def panel_title(figure: Any, left: float, text: str, width: float) -> None:
    """Name a panel `width` [mm], with the direction of travel at the right end of the line."""
    write(figure, left, HEAD, text)
    write(figure, left + width - 17.5, HEAD + 0.3, "travel", fontsize=SMALL, color=GREY)
    start, end = (_place(figure, left + width - off, HEAD + 1.7) for off in (8, 0))
    draw_arrow(figure, start, end, GREY, transform=figure.transFigure, lw=0.9)


def name_height(ax: Any, text: str, width: float) -> None:
    """Name the vertical axis of a panel `width` [mm], clear of the numbers whatever their length."""
    ax.set_ylabel(text, va="bottom")
    ax.yaxis.set_label_coords(-9.5 / width, 0.5)


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


def text_size(text: str, size: float, weight: str = "normal") -> tuple[float, float]:
    """Width and height [mm] of a line of text at `size` points."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    box = TextPath((0, 0), text, size=size, prop=FontProperties(weight=weight)).get_extents()
    return box.width * INCH / 72, size * INCH / 72


BOTH = {"walk": "flat", "run": "roll-over"}
"""What the paper calls the part of the stance in which toe and heel both bear."""

TINTS = {("toe",): "#F6E4EE", ("heel",): "#D5EEE5", ("toe", "heel"): "#FBF2D3", (): "white"}
"""Light colours by the points that bear."""

STRIP = 2.0
"""Height of the strip that names the sub-phases [mm]."""


class Phase(NamedTuple):
    """One sub-phase of a stance: its name, start and end [s], and the hoof points that bear in it."""

    name: str
    start: float
    end: float
    bearing: tuple[str, ...]


def sub_phases(stance: Stance, gait: str) -> tuple[Phase, ...]:
    """The stance cut where toe or heel enters or leaves the ground.

    One point bearing alone is its strike at the start of the stance, its off at the end and otherwise
    'alone'; both bearing have the paper's name for the gait (`BOTH`).
    """
    instants = sorted({t for name in POINTS for interval in getattr(stance, name) for t in interval})
    pieces = list(pairwise(instants))
    phases = []
    for place, (start, end) in enumerate(pieces):
        bearing = tuple(
            name
            for name in POINTS
            if any(enter <= start and end <= leave for enter, leave in getattr(stance, name))
        )
        if len(bearing) == 1:
            part = " alone"
            if len(pieces) > 1:
                part = {0: "-strike", len(pieces) - 1: "-off"}.get(place, part)
            name = bearing[0] + part
        else:
            name = BOTH[gait] if bearing else "in the air"
        phases.append(Phase(name, start, end, bearing))
    return tuple(phases)


def shade(ax: Any, phases: tuple[Phase, ...]) -> None:
    """Shade the sub-phases behind curves over time [s]."""
    for phase in phases:
        ax.axvspan(phase.start, phase.end, fc=TINTS[phase.bearing], lw=0, zorder=0)


def time_limits(reproduction: Reproduction, gait: str, stance: Stance, margin: float) -> tuple[float, float]:
    """Interval [s] of the stance and the published instants of contact, and `margin` of it either side."""
    published = [row.value for row in _contact_rows(reproduction, gait)]
    start, end = min(stance.start, *published), max(stance.end, *published)
    return start - margin * (end - start), end + margin * (end - start)


def mark_contacts(ax: Any, reproduction: Reproduction, gait: str, y: float) -> None:
    """The published instants of contact on an axis of time [s]."""
    for row in _contact_rows(reproduction, gait):
        mark_published(ax, row.value, y, xerr=half_bar(row))


def _contact_rows(reproduction: Reproduction, gait: str) -> list[PublishedRow]:
    return [reproduction.published.row(f"{gait}.{name}") for name in ("contact_start", "contact_end")]


def spread(centres: Sequence[float], widths: Sequence[float], low: float, high: float) -> list[float]:
    """Centres of labels of these widths [mm], in order, moved as little as keeps them apart and, if they fit,
    within [low, high]."""
    placed = []
    for centre, width in zip(centres, widths, strict=True):
        placed.append(max(centre, low + width / 2))
        low = placed[-1] + width / 2
    for k in reversed(range(len(placed))):
        placed[k] = min(placed[k], high - widths[k] / 2)
        high = placed[k] - widths[k] / 2
    return placed


def name_phases(
    figure: Any, left: float, top: float, width: float, limits: tuple[float, float], phases: tuple[Phase, ...]
) -> None:
    """A strip of the sub-phases, `limits` [s] at its ends, with their names above it."""
    ax = panel(figure, left, top, width, STRIP, xlim=limits, ylim=(0, 1))
    ax.axis("off")
    shade(ax, phases)
    scale = width / (limits[1] - limits[0])
    sizes = [text_size(phase.name, SMALL)[0] + 1.5 for phase in phases]
    middles = [(phase.start + phase.end) / 2 for phase in phases]
    wanted = [scale * (middle - limits[0]) for middle in middles]
    for phase, middle, place in zip(phases, middles, spread(wanted, sizes, 0, width), strict=True):
        ax.plot([phase.start] * 2, [0, 1], color=GREY, lw=0.5)
        ax.plot([phase.end] * 2, [0, 1], color=GREY, lw=0.5)
        ax.plot([middle, limits[0] + place / scale], [0.9, 1.6], color=GREY, lw=0.5, clip_on=False)
        ax.text(limits[0] + place / scale, 1.7, phase.name, fontsize=SMALL, ha="center", va="bottom")
