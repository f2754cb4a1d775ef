"""What the redrawn figures share: colours, type sizes, the look of published values, ground, poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS
from hoof_env.paper.measure import Stance, measure_stance
from hoof_env.paper.published import PublishedRow

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

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
"""For print over two columns (`hoof_env.paper.figure_layout.WIDTH`); in SVG text stays text."""


def points_at(geometry: Geometry, row: np.void) -> dict[str, NDArray[np.float64]]:
    """World position (x, y) [m] of every named point at one row of a trace."""
    frame = FrameMotion(phi=float(row["phi"]), position=(float(row["x"]), float(row["y"])))
    return dict(zip(POINTS, pose(geometry, float(row["theta"]), frame=frame).points, strict=True))


def row_at(trace: NDArray[np.void], t: float) -> np.void:
    """The row of a trace nearest to an instant [s]."""
    return trace[int(np.argmin(np.abs(trace["time"] - t)))]


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
