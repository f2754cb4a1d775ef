"""Figure 6 of the paper, redrawn: the ground reaction force as a vector along the stance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.paper.figure_layout import HEAD, INCH, WIDTH, head, name_travel, panel, set_size, write
from hoof_env.paper.figure_phases import STRIP, mark_contacts, name_phases, sub_phases, time_limits
from hoof_env.paper.figure_style import (
    GAITS,
    SMALL,
    draw_ground,
    elastic_cycles,
)

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

ARROWS = 36
"""Equal parts of the stance; an arrow in the middle of each."""

BRIGHTEST = 1.1 * ARROWS
"""End of the colours, beyond the last arrow: the palest are hard to see on white."""

LEFT, GAP, HIGH, LONGEST = 5.0, 12.0, 43.0, 36.0
"""Margin, room between the gaits, height of the vectors' panel, length of the longest vector [mm]."""


def draw_vectors(figure: Any, reproduction: Reproduction) -> None:
    """Figure 6: the ground reaction force at the centre of pressure at equal steps of the stance, elastic,
    lengths to scale and directions true; below, the colours' times, sub-phases, published contact times."""
    width = (WIDTH - 2 * LEFT - GAP) / 2
    set_size(figure, HEAD + 5 + HIGH + 31)
    head(
        figure, reproduction, "Figure 6. Ground reaction force on the leg along the stance", "elastic",
        "A vector that leans forward propels, one that leans back brakes. Marks: published contact times.",
    )  # fmt: skip
    for place, (gait, (trace, stance)) in enumerate(elastic_cycles(reproduction).items()):
        left = LEFT + place * (width + GAP)
        write(figure, left, HEAD, f"({'ab'[place]}) {GAITS[gait]}")
        name_travel(figure, left, HEAD, width)
        ax = panel(figure, left, HEAD + 5, width, HIGH, xlabel="centre of pressure, x forward of O [m]")
        edges = np.linspace(stance.start, stance.end, ARROWS + 1)
        _draw_arrows(ax, trace, (edges[1:] + edges[:-1]) / 2, width)
        limits = time_limits(reproduction, gait, stance, 0.03)
        top = HEAD + 5 + HIGH + 17
        name_phases(figure, left + 4, top, width - 8, limits, sub_phases(stance, gait))
        times = panel(figure, left + 4, top + STRIP, width - 8, 3, xlim=limits, yticks=[], xlabel="time [s]")
        times.pcolormesh(
            edges, [0, 1], np.arange(ARROWS)[None], cmap="viridis", vmax=BRIGHTEST, edgecolors="face", lw=0.1
        )
        times.spines["left"].set_visible(False)
        mark_contacts(times, reproduction, gait, 0.5)


def _draw_arrows(ax: Any, trace: NDArray[np.void], times: NDArray[np.float64], width: float) -> None:
    """Vectors at the given times [s] in a panel `width` [mm], coloured by their number."""
    picked = np.searchsorted(trace["time"], times)
    loaded = np.flatnonzero(trace["normal"][picked] > 0)
    rows = trace[picked[loaded]]
    scale = LONGEST / float(rows["grf"].max())  # [mm/N]
    lean = scale * rows["friction"]  # [mm]
    left, right = max(-lean.min(), 0.0) + 13, max(lean.max(), 0.0) + 3
    low, high = float(rows["cop_x"].min()), float(rows["cop_x"].max())
    metre = (width - left - right) / max(high - low, 0.02)  # [mm/m]
    bottom = low - left / metre
    ax.set(xlim=(bottom, bottom + width / metre), ylim=(-5, HIGH - 5), yticks=[])
    ax.spines["left"].set_visible(False)
    draw_ground(ax, -5)
    ax.quiver(
        rows["cop_x"], np.zeros(len(rows)), rows["friction"], rows["normal"], loaded,
        angles="uv", scale_units="inches", scale=INCH / scale, units="inches", width=0.45 / INCH,
        cmap="viridis", clim=(0, BRIGHTEST), zorder=3, headwidth=4, headlength=5, headaxislength=4.5,
    )  # fmt: skip
    force = _round_number(0.4 * LONGEST / scale)
    at = bottom + 2 / metre
    ax.plot([at, at], [2, 2 + scale * force], color="black", lw=1.2)
    ax.text(at + 1 / metre, 2 + scale * force / 2, f"{force:g} N", va="center", fontsize=SMALL)


def _round_number(limit: float) -> float:
    """The largest of 1, 2, 5 times a power of ten up to `limit`."""
    power = 10 ** np.floor(np.log10(limit))
    return float(power * max(step for step in (1, 2, 5) if step * power <= limit))
