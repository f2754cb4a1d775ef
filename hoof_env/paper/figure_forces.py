"""Figure 5 of the paper, redrawn: ground reaction force over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hoof_env.paper.figure_layout import (
    GAP,
    HEAD,
    LEFT,
    WIDTH,
    head,
    legend_below,
    name_height,
    panel,
    set_size,
    write,
)
from hoof_env.paper.figure_phases import STRIP, mark_contacts, name_phases, shade, sub_phases, time_limits
from hoof_env.paper.figure_style import (
    CONDITION_COLOURS,
    GAITS,
    GREY,
    HEEL,
    SOLVER,
    TOE,
    half_bar,
    mark_published,
)
from hoof_env.paper.measure import Stance, measure_stance
from hoof_env.paper.shapes import find_peaks

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

MEAN, FORCE, CONTACT = 12.0, 56.0, 7.0
"""Width of the means, height of the forces and of the contacts [mm]."""

DASHED = (0, (3, 2))


def draw_forces(figure: Any, reproduction: Reproduction) -> None:
    """Figure 5: force of the ground over time in the four conditions, with sub-phases, simulated peaks,
    published peaks at the times of the simulated ones, published instants of contact on the time axis; means
    over the cycle at the side; below, when toe and heel are in the ground."""
    width = (WIDTH - LEFT - GAP - 3) / 2
    set_size(figure, HEAD + 10 + FORCE + CONTACT + 23)
    head(
        figure, reproduction, "Figure 5. Ground reaction force", "elastic and inelastic",
        "Bars: margin of each row. Peaks have no time in print; marks stand at that of the simulated one.",
    )  # fmt: skip
    for place, gait in enumerate(GAITS):
        left, wide = LEFT + place * (width + GAP), width - MEAN - 1
        stance = measure_stance(reproduction.traces[gait, "elastic", SOLVER])
        phases = sub_phases(stance, gait)
        limits = time_limits(reproduction, gait, stance, 0.1)
        write(figure, left, HEAD, f"({'ab'[place]}) {GAITS[gait]}")
        name_phases(figure, left, HEAD + 8, wide, limits, phases)
        top = HEAD + 8 + STRIP
        ax = panel(figure, left, top, wide, FORCE, xlim=limits)
        shade(ax, phases)
        _draw_curves(ax, reproduction, gait)
        _explain(ax)
        mark_contacts(ax, reproduction, gait, 0)
        ax.set_ylim(0, None)
        ax.tick_params(labelbottom=False)
        mean = panel(figure, left + wide + 1, top, MEAN, FORCE, ylim=ax.get_ylim(), xlim=(-0.6, 1.6))
        _draw_means(mean, reproduction, gait)
        contact = panel(figure, left, top + FORCE + 3, wide, CONTACT, xlim=limits, xlabel="time [s]")
        _draw_contact(contact, stance)
        if not place:
            name_height(ax, "force of the ground on the hoof [N]", wide)
            axes = ax, mean
    legend_below(figure, *axes, columns=4)


def _draw_curves(ax: Any, reproduction: Reproduction, gait: str) -> None:
    for condition, colour in CONDITION_COLOURS.items():
        trace = reproduction.traces[gait, condition, SOLVER]
        t, force = trace["time"], trace["normal"]
        ax.plot(t, force, color=colour, lw=1.4, label=f"{condition}, normal force", zorder=4)
        ax.plot(t, trace["grf"], color=colour, lw=0.7, ls=DASHED, zorder=3)
        peaks = find_peaks(force)
        ax.plot(t[peaks], force[peaks], "o", color=colour, ms=2.8, zorder=5)
        row = reproduction.published.row(f"{gait}.peak_{condition}")
        mark_published(ax, measure_stance(trace).peak_time, row.value, yerr=half_bar(row))


def _explain(ax: Any) -> None:
    """Entries of the legend for what has the colour of its condition."""
    ax.plot([], [], color=GREY, lw=0.7, ls=DASHED, label="resultant")
    ax.plot([], [], "o", color=GREY, ms=2.8, label="simulated peak")
    ax.plot([], [], color=GREY, lw=2, label="simulated mean")


def _draw_means(ax: Any, reproduction: Reproduction, gait: str) -> None:
    """Simulated means over the cycle as ticks beside the published ones."""
    for place, (condition, colour) in enumerate(CONDITION_COLOURS.items()):
        mean = measure_stance(reproduction.traces[gait, condition, SOLVER]).mean
        ax.plot([place - 0.45, place + 0.45], [mean] * 2, color=colour, lw=2)
        row = reproduction.published.row(f"{gait}.mean_{condition}")
        mark_published(ax, place, row.value, yerr=half_bar(row))
    ax.set(xticks=[], yticks=[], xlabel="mean over\nthe cycle")
    ax.spines["left"].set_visible(False)


def _draw_contact(ax: Any, stance: Stance) -> None:
    """When each point is in the ground."""
    for height, (name, colour) in enumerate((("toe", TOE), ("heel", HEEL))):
        for interval in getattr(stance, name):
            ax.plot(interval, [height] * 2, color=colour, lw=3.5, solid_capstyle="butt")
    ax.set(ylim=(-0.7, 1.7), yticks=[0, 1])
    ax.set_yticklabels(["toe", "heel"])
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)
