"""Figures 5 and 6 of the paper, redrawn: ground reaction force over time and along the stance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hoof_env.paper.figure_style import (
    CONDITION_COLOURS,
    GAITS,
    SOLVER,
    draw_ground,
    draw_travel_arrow,
    elastic_cycles,
    legend_below,
)
from hoof_env.paper.measure import measure_stance

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction


def draw_forces(figure: Any, reproduction: Reproduction) -> None:
    """Figure 5: ground reaction force over time in the four conditions, with the published peaks."""
    figure.set_size_inches(7.5, 3.8)
    axes = figure.subplots(1, 2)
    for ax, gait in zip(axes, GAITS, strict=True):
        for condition, colour in CONDITION_COLOURS.items():
            trace = reproduction.traces[gait, condition, SOLVER]
            stance = measure_stance(trace)
            ax.plot(
                trace["t"],
                trace["grf"],
                color=colour,
                lw=0.9,
                ls=(0, (2, 1.5)),
                label=f"{condition}, resultant",
            )
            ax.plot(trace["t"], trace["normal"], color=colour, lw=1.6, label=f"{condition}, normal")
            peak = reproduction.published.row(f"{gait}.peak_{condition}").value
            ax.plot(
                stance.peak_time,
                peak,
                "D",
                mfc="none",
                mec=colour,
                mew=1.5,
                ms=7,
                label=f"{condition}, published peak (no time in print)",
            )
        margin = 0.15 * (stance.end - stance.start)
        ax.set(
            title=GAITS[gait],
            xlabel="time [s]",
            xlim=(stance.start - margin, stance.end + margin),
            ylim=(0, None),
        )
    axes[0].set_ylabel("force of the ground on the hoof [N]")
    legend_below(figure, axes[0], columns=2)


def draw_vectors(figure: Any, reproduction: Reproduction) -> None:
    """Figure 6: the ground reaction force at the centre of pressure along the stance, elastic.

    The scale is the same along both axes, so that directions are true.
    """
    figure.set_size_inches(7.5, 2.9)
    figure.set_layout_engine("compressed")
    axes = figure.subplots(1, 2)
    for ax, (gait, (trace, stance)) in zip(axes, elastic_cycles(reproduction).items(), strict=True):
        rows = trace[np.searchsorted(trace["t"], np.linspace(stance.start, stance.end, 42)[1:-1])]
        rows = rows[rows["normal"] > 0]
        reach = 0.6 * float(np.ptp(rows["cop_x"]))  # length of the longest arrow [m]
        scale = float(rows["grf"].max()) / reach
        arrows = ax.quiver(
            rows["cop_x"], np.zeros(len(rows)), rows["friction"], rows["normal"],
            100 * (rows["t"] - stance.start) / (stance.end - stance.start),
            angles="xy", scale_units="xy", scale=scale, cmap="viridis", clim=(0, 100), width=0.006, zorder=3,
        )  # fmt: skip
        spread = np.concatenate([rows["cop_x"], rows["cop_x"] + rows["friction"] / scale])
        ax.set(
            title=f"{GAITS[gait]}, elastic", xlabel="centre of pressure, x forward of O [m]",
            aspect="equal", yticks=[],
            xlim=(spread.min() - 0.3 * reach, spread.max() + 0.3 * reach), ylim=(-0.2 * reach, 1.2 * reach),
        )  # fmt: skip
        ax.spines["left"].set_visible(False)
        draw_ground(ax, -0.2 * reach)
        bar = 10 ** np.floor(np.log10(scale * reach)) / scale
        at = spread.min() - 0.2 * reach
        ax.plot([at, at], [0.05 * reach, 0.05 * reach + bar], color="black", lw=1.5)
        ax.text(at + 0.04 * reach, 0.05 * reach + bar / 2, f"{bar * scale:.0f} N", va="center", fontsize=8)
        draw_travel_arrow(ax, 0.76, 0.86, 0.2)
    figure.colorbar(arrows, ax=axes, label="part of stance [%]", shrink=0.9)
