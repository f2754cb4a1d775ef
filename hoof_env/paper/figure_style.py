"""What the redrawn figures share: colours, type sizes, ground, travel arrow, legend."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS
from hoof_env.paper.measure import Stance, measure_stance

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

BLUE, ORANGE, GREEN, PURPLE, SKY, GREY, SOIL = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#666666", "#EFE6D8",
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


def points_at(geometry: Geometry, row: np.void) -> dict[str, NDArray[np.float64]]:
    """World position (x, y) [m] of every named point at one row of a trace."""
    frame = FrameMotion(phi=float(row["phi"]), position=(float(row["trunk_x"]), float(row["trunk_y"])))
    return dict(zip(POINTS, pose(geometry, float(row["theta"]), frame=frame).points, strict=True))


def row_at(trace: NDArray[np.void], t: float) -> np.void:
    """The row of a trace nearest to an instant [s]."""
    return trace[int(np.argmin(np.abs(trace["t"] - t)))]


def draw_ground(ax: Any, low: float) -> None:
    """Level ground y = 0, shaded down to `low` [m]."""
    ax.axhspan(low, 0, color=SOIL, zorder=0, lw=0)
    ax.axhline(0, color=GREY, lw=0.8, zorder=1)


def draw_travel_arrow(ax: Any, x: float, y: float, length: float) -> None:
    """An arrow in the direction of travel, at (x, y) in parts of the axes."""
    ax.annotate(
        "", xy=(x + length, y), xytext=(x, y), xycoords="axes fraction",
        arrowprops={"arrowstyle": "-|>", "color": GREY, "lw": 1.2},
    )  # fmt: skip
    ax.text(
        x + length / 2,
        y + 0.02,
        "travel",
        transform=ax.transAxes,
        ha="center",
        va="bottom",
        color=GREY,
        fontsize=8,
    )


def elastic_cycles(reproduction: Reproduction) -> dict[str, tuple[NDArray[np.void], Stance]]:
    """Trace and stance of each gait on elastic ground."""
    traces = {gait: reproduction.traces[gait, "elastic", SOLVER] for gait in GAITS}
    return {gait: (trace, measure_stance(trace)) for gait, trace in traces.items()}


def legend_below(figure: Any, *axes: Any, columns: int) -> None:
    """One legend below the figure, every label once."""
    entries = {
        label: line for ax in axes for line, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=columns)
