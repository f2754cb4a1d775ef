"""Figure 4 of the paper, redrawn: the hoof over the stance and its angle over the cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.paper.figure_layout import (
    GAP,
    HEAD,
    LEFT,
    WIDTH,
    head,
    legend_below,
    name_height,
    name_travel,
    panel,
    set_size,
    write,
)
from hoof_env.paper.figure_phases import STRIP, name_phases, shade, sub_phases
from hoof_env.paper.figure_style import (
    BLUE,
    GAITS,
    GREY,
    HEEL,
    SKY,
    SMALL,
    TOE,
    draw_ground,
    elastic_cycles,
    half_bar,
    mark_published,
    points_at,
    row_at,
)
from hoof_env.paper.measure import Stance

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

HOOVES = 7
"""The hoof is sketched at this many equally spaced instants of the stance, its ends included."""

SKETCH, ANGLE = 24.0, 52.0
"""Most height for the sketches, height of the angle [mm]."""


def draw_angles(figure: Any, reproduction: Reproduction) -> None:
    """Figure 4: above, the hoof over the stance at one scale for both gaits, with the sub-phases; below, its
    angle over the cycle with the published angles at their published times, and the sub-phases shaded.

    An angle printed without a time is marked at the middle of the time in which toe and heel both bear.
    """
    cycles = elastic_cycles(reproduction)
    width = (WIDTH - LEFT - GAP - 3) / 2
    hooves = {gait: _sketch_shapes(reproduction, *cycle) for gait, cycle in cycles.items()}
    extent = np.concatenate(list(hooves.values()))
    scale = min(0.92 * width / HOOVES / np.ptp(extent[..., 0], axis=1).max(), SKETCH / np.ptp(extent[..., 1]))
    span = scale * extent[..., 1].min() - 5, scale * extent[..., 1].max() + 1.5  # around the ground [mm]
    tall = span[1] - span[0]
    set_size(figure, HEAD + 23 + tall + ANGLE + 14)
    head(figure, reproduction, "Figure 4. Hoof angle over the cycle", "elastic", _readings(reproduction))
    for place, (gait, (trace, stance)) in enumerate(cycles.items()):
        left, top = LEFT + place * (width + GAP), HEAD
        phases = sub_phases(stance, gait)
        write(figure, left, top, f"({'ab'[place]}) {GAITS[gait]}")
        name_travel(figure, left, top, width)
        half = (stance.end - stance.start) / (HOOVES - 1) / 2
        limits = stance.start - half, stance.end + half
        name_phases(figure, left, top + 8, width, limits, phases)
        ax = panel(figure, left, top + 8 + STRIP, width, tall, xlim=limits, ylim=span)
        _draw_hooves(ax, hooves[gait] * scale, stance, width)
        _draw_scale(ax, scale, width)
        angle = panel(figure, left, top + 23 + tall, width, ANGLE, xlim=(0, stance.period))
        shade(angle, phases)
        angle.axhline(0, color=GREY, lw=0.6, zorder=1)
        angle.plot(
            trace["time"], np.degrees(trace["hoof_angle"]), color=BLUE, lw=1.3, label="simulated", zorder=3
        )
        _mark_angles(angle, reproduction, gait, stance)
        angle.set(xlabel="time [s]")
        if not place:
            name_height(angle, "hoof angle, heel up positive [deg]", width)
            axes = angle, ax
    legend_below(figure, *axes, columns=5)


def _readings(reproduction: Reproduction) -> str:
    """Which printed angles are read as something else."""
    changed = [
        f"{row.printed:g}° in print is read as {row.value:+g}°.".replace("-", "\N{MINUS SIGN}")
        for row in reproduction.published.rows
        if row.unit == "deg" and row.printed != row.value
    ]
    phases = "Flat, roll-over: toe and heel in the ground."
    return " ".join([phases, "Bars: margin of each row; flat has no time in print.", *changed])


def _sketch_shapes(reproduction: Reproduction, trace: Any, stance: Stance) -> NDArray[np.float64]:
    """Corners G, toe, heel at the instants of the sketches, x from the middle of each hoof,
    shape (HOOVES, 3, 2) [m]."""
    geometry = reproduction.geometry
    shapes = []
    for t in np.linspace(stance.start, stance.end, HOOVES):
        at = points_at(geometry, row_at(trace, t))
        shape = np.array([at["G"], at[geometry.toe], at[geometry.heel]])
        shape[:, 0] -= (shape[:, 0].min() + shape[:, 0].max()) / 2
        shapes.append(shape)
    return np.array(shapes)


def _draw_hooves(ax: Any, shapes: NDArray[np.float64], stance: Stance, width: float) -> None:
    """Sketches [mm] in a panel `width` [mm] whose horizontal axis is time."""
    instants = np.linspace(stance.start, stance.end, HOOVES)
    second = width / np.ptp(ax.get_xlim())  # [mm/s]
    ax.set(yticks=[], xticks=instants, xlabel="time [s]")
    ax.set_xticklabels([f"{t:.3f}" for t in instants])
    ax.spines["left"].set_visible(False)
    draw_ground(ax, ax.get_ylim()[0])
    for t, shape in zip(instants, shapes, strict=True):
        x, y = t + shape[:, 0] / second, shape[:, 1]
        ax.fill(x, y, fc=SKY, ec=BLUE, lw=0.7, alpha=0.9, zorder=3)
        for corner, colour, label in ((1, TOE, "toe"), (2, HEEL, "heel")):
            ax.plot(x[corner], y[corner], "o", color=colour, ms=3, label=label, zorder=4, ls="none")


def _draw_scale(ax: Any, scale: float, width: float) -> None:
    """A bar of 0.2 m in the lower left corner; `scale` in mm/m."""
    left, right = ax.get_xlim()
    second, y = width / (right - left), ax.get_ylim()[0] + 2
    start, end = left + 1.5 / second, left + (1.5 + 0.2 * scale) / second
    ax.plot([start, end], [y, y], color="black", lw=1.2)
    ax.text(end + 1 / second, y, "0.2 m", fontsize=SMALL, va="center")


def _mark_angles(ax: Any, reproduction: Reproduction, gait: str, stance: Stance) -> None:
    rows = {row.id.removeprefix(f"{gait}."): row for row in reproduction.published.rows if row.gait == gait}
    for time, angle in (("contact_start", "angle_contact"), ("contact_end", "angle_liftoff")):
        t, value = rows[time], rows[angle]
        mark_published(ax, t.value, value.value, xerr=half_bar(t), yerr=half_bar(value))
    if "angle_flat" in rows:
        middle = sum(stance.double) / 2 if stance.double else stance.middle
        mark_published(ax, middle, rows["angle_flat"].value, yerr=half_bar(rows["angle_flat"]))
