"""Parts of all redrawn figures of the paper: type, names, colours, headings, legends, the ground, arrows and
published values."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, SOIL, STYLE
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.paper.measure import POINTS, Stance, Trace, measure_stance
from hoof_env.paper.rows import CONDITIONS, EXACT, NOT_DETERMINABLE, PublishedRow, Reproduction

SMALL = 7.0
"""Smallest size of type [points]."""

PRINT: dict[Any, Any] = {
    **STYLE,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "sans-serif"],
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
    "svg.fonttype": "none",
    "savefig.dpi": 300,
}
"""Settings of matplotlib for print over two columns; text stays text in SVG."""

WIDTH = 6.9
"""Width of two columns of a journal [inch]."""

HEAD = 0.5
"""Height of the lines above the panels [inch]."""

GAITS = {"walk": "(a) Walking", "run": "(b) Running"}
CONDITION_COLOURS = dict(zip(CONDITIONS, (BLUE, ORANGE), strict=True))
POINT_COLOURS = {"toe": PURPLE, "heel": GREEN}
PHASES = {
    ("heel",): ("#D5EEE5", "heel alone: strike or off"),
    ("toe", "heel"): ("#FBF2D3", "toe and heel: flat or roll-over"),
    ("toe",): ("#F6E4EE", "toe alone: strike or off"),
}
"""Colours and names of the sub-phases of stance, by the points that bear load."""

FORWARD = "x forward of O [m]"
HEIGHT = "height above the ground [m]"
Point = NDArray[np.float64]


def leg_at(geometry: Geometry, trace: Trace, t: float) -> dict[str, Point]:
    """Return the world position (x, y) [m] of every named point, at the row of a trace nearest to `t` [s]."""
    row = trace[int(np.argmin(np.abs(trace["time"] - t)))]
    frame = FrameMotion(phi=float(row["swing_angle"]), position=(float(row["x"]), float(row["y"])))
    points = pose(geometry, float(row["crank_angle"]), frame=frame).points
    return dict(zip(geometry.mechanism.points, points, strict=True))


def elastic_cycles(reproduction: Reproduction) -> dict[str, tuple[Trace, Stance]]:
    """Return the trace and stance of each gait on elastic ground with the exact solver."""
    traces = {gait: reproduction.traces[gait, "elastic", EXACT] for gait in GAITS}
    return {gait: (trace, measure_stance(trace)) for gait, trace in traces.items()}


def head(figure: Any, height: float, reproduction: Reproduction, title: str, ground: str, note: str) -> None:
    """Set a figure's size and write its heading.

    Args:
        figure: the figure.
        height: its height [inch].
        reproduction: the reproduction, for the name of its preset.
        title: first line.
        ground: condition of the ground, for the second line, after the note that the leg is identified.
        note: third line.
    """
    figure.set_size_inches(WIDTH, height)
    figure.set_layout_engine("constrained", rect=(0, 0, 1, 1 - HEAD / height))
    preset = Path(reproduction.geometry.name).name
    leg = f"Identified leg, not published (preset {preset}); {EXACT} solver; {ground} ground"
    figure.text(0.01, 1 - 0.05 / height, title, va="top", weight="bold")
    for top, text in ((0.2, f"{leg}; travel to the right."), (0.34, note)):
        place = 0.01, 1 - top / height
        figure.text(*place, text, va="top", fontsize=SMALL, color=GREY, parse_math=False)


def panel_height(*boxes: Point) -> float:
    """Return the common height [inch] at which panels side by side fill the figure.

    Args:
        boxes: lower left and upper right corner of each panel [m], shape (2, 2).
    """
    # 1.2 inches are left for labels of the axes.
    return (WIDTH - 1.2) / float(sum(across / up for across, up in (high - low for low, high in boxes)))


def show_box(ax: Any, box: Point) -> None:
    """Limit axes to a box, its lower left and upper right corner [m], with equal scales."""
    ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal")


def legend_below(figure: Any, columns: int) -> None:
    """Draw one legend at the foot of the figure, with every label once."""
    entries = {
        label: line for ax in figure.axes for line, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=columns)


def draw_ground(ax: Any) -> None:
    """Draw level ground at y = 0, shaded down to the end of the axes."""
    # The shading must not widen the limits, which are set again below.
    low, high = ax.get_ylim()
    ax.axhspan(low - (high - low), 0, color=SOIL, zorder=0, lw=0)
    ax.axhline(0, color=GREY, lw=0.8, zorder=1)
    ax.set_ylim(low, high)


def draw_arrow(ax: Any, start: Any, end: Any, colour: str) -> None:
    """Draw an arrow from `start` to `end`, (x, y) in the units of the axes."""
    look = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
    ax.annotate("", end, start, arrowprops=look, zorder=8)


def mark_published(ax: Any, x: Any, y: Any, *, xerr: Any = None, yerr: Any = None) -> None:
    """Draw published values as diamonds, with the bars within which they count as reproduced."""
    ax.errorbar(
        x,
        y,
        yerr,
        xerr,
        fmt="D",
        ms=4.2,
        mfc="white",
        mec="black",
        mew=0.9,
        ecolor="black",
        elinewidth=0.7,
        capsize=1.8,
        capthick=0.7,
        clip_on=False,
        zorder=9,
        label="published",
    )


def half_bar(row: PublishedRow) -> float:
    """Return the largest accepted difference from the published value, in the row's unit; 0 if the row is
    only reported or not determinable."""
    limit = 0.0 if row.id in NOT_DETERMINABLE else row.bar.limit or 0.0
    return abs(row.value) * limit / 100 if row.bar.measure == "%" else limit


def contact_rows(reproduction: Reproduction, gait: str) -> list[PublishedRow]:
    """Return the published rows of the first and the last contact of a gait."""
    return [reproduction.published.row(f"{gait}.{name}") for name in ("contact_start", "contact_end")]


def mark_contacts(ax: Any, reproduction: Reproduction, gait: str, y: float) -> None:
    """Draw the published instants of contact at height `y` over an axis of time [s]."""
    for row in contact_rows(reproduction, gait):
        mark_published(ax, row.value, y, xerr=half_bar(row))


def shade(ax: Any, stance: Stance) -> None:
    """Shade the sub-phases of a stance behind curves plotted against time [s]."""
    intervals = {name: getattr(stance, name) for name in POINTS}
    # Sub-phases change where toe or heel enters or leaves the ground.
    instants = sorted({t for contacts in intervals.values() for contact in contacts for t in contact})
    for start, end in pairwise(instants):
        bearing = tuple(
            name
            for name, contacts in intervals.items()
            if any(enter <= start and end <= leave for enter, leave in contacts)
        )
        if bearing:
            colour, label = PHASES[bearing]
            ax.axvspan(start, end, fc=colour, lw=0, zorder=0, label=label)
