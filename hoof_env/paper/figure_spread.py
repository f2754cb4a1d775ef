"""What the published numbers leave open, drawn: lengths, hoof paths, crank torques, forces of an ensemble."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hoof_env.paper.figure_ensemble import EnsembleCurves, band
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
from hoof_env.paper.figure_phases import mark_contacts, time_limits
from hoof_env.paper.figure_style import (
    CONDITION_COLOURS,
    GAITS,
    GREY,
    SOLVER,
    draw_ground,
    elastic_cycles,
)

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

LENGTHS_HIGH, PATHS_HIGH, CURVES_HIGH = 42.0, 36.0, 36.0
"""Heights of the panels [mm]."""

NAMES, NAMED, LEGEND = 5.0, 12.0, 9.0
"""Height of the line that names a panel, of the axis below it, and of the legend [mm]."""

RIGHT = 4.0
"""Margin at the right [mm]."""


def draw_spread(figure: Any, reproduction: Reproduction, ensemble: EnsembleCurves) -> None:
    """Lengths of all members over their medians; below for each gait, in columns, the path of the sole's
    middle, the crank torque over the cycle and the ground force through stance. Dark: the preset itself.

    Args:
        reproduction: of the preset. ensemble: with lengths and crank torques.
    """
    width, whole = (WIDTH - LEFT - GAP - RIGHT) / 2, WIDTH - LEFT - RIGHT
    rows = (PATHS_HIGH, CURVES_HIGH, CURVES_HIGH)
    set_size(figure, HEAD + LENGTHS_HIGH + sum(rows) + 4 * (NAMES + NAMED) + LEGEND)
    head(
        figure, reproduction, "What the published numbers leave open", "elastic and inelastic",
        f"Dark lines and filled marks: that leg. Light: {ensemble.label}, which fit the same numbers.",
    )  # fmt: skip
    write(figure, LEFT, HEAD, "(a) Lengths")
    lengths = panel(figure, LEFT, HEAD + NAMES, whole, LENGTHS_HIGH)
    _draw_lengths(lengths, reproduction, ensemble)
    name_height(lengths, "over the median [-]", whole)
    axes = []
    cycles = elastic_cycles(reproduction)
    for column, (gait, (_, stance)) in enumerate(cycles.items()):
        left, top = LEFT + column * (width + GAP), HEAD + LENGTHS_HIGH + NAMES + NAMED
        limits = time_limits(reproduction, gait, stance, 0.1)
        shown: list[Any] = []
        for number, (name, high) in enumerate(
            zip(("path of the sole", "crank torque", "ground force"), rows, strict=True)
        ):
            write(figure, left, top, f"({'bcdefg'[2 * number + column]}) {GAITS[gait]}, {name}")
            shown.append(panel(figure, left, top + NAMES, width, high))
            if not number:
                name_travel(figure, left, top, width)
            top += NAMES + high + NAMED
        paths, torque, force = shown
        _draw_paths(paths, reproduction, ensemble, gait)
        _draw_bands(torque, reproduction, gait, "crank_torque", ensemble, ensemble.crank_torque)
        torque.set(xlabel="time [s]", xlim=(0, 1))
        torque.axhline(0, color=GREY, lw=0.5, zorder=1)
        _draw_bands(force, reproduction, gait, "normal", ensemble, ensemble.normal)
        force.set(xlabel="time [s]", xlim=limits, ylim=(0, None))
        mark_contacts(force, reproduction, gait, 0)
        if not column:
            name_height(paths, "height, stretched [m]", width)
            name_height(torque, "crank torque [N m]", width)
            name_height(force, "normal force [N]", width)
            axes = shown
    legend_below(figure, lengths, *axes, columns=5)


def _draw_lengths(ax: Any, reproduction: Reproduction, ensemble: EnsembleCurves) -> None:
    own = dict(reproduction.geometry.lengths) | {"hip": reproduction.geometry.hip_height}
    members = dict(ensemble.lengths)
    if ensemble.hip_height is not None:
        members["hip"] = ensemble.hip_height
    aside = 0.22 * np.linspace(-1, 1, ensemble.members)
    for place, (name, values) in enumerate(members.items()):
        median = np.median(values)
        low, high = np.quantile(values / median, [0.25, 0.75])
        ax.bar(
            place, high - low, 0.62, bottom=low, fc="#DDDDDD", ec=GREY, lw=0.5, zorder=2, label="middle half"
        )
        ax.plot(
            place + aside, values / median, "o", ms=2.2, mfc="none", mec="black", mew=0.4, alpha=0.7,
            zorder=3, label="a leg of the ensemble",
        )  # fmt: skip
        ax.plot(place, own[name] / median, "s", ms=3.6, color="black", zorder=4, label="the preset's leg")
    ax.axhline(1, color=GREY, lw=0.5, zorder=1)
    ax.set_xticks(range(len(members)), [name.replace("hip", "hip\nheight") for name in members])
    ax.tick_params(axis="x", length=0)
    ax.set_xlim(-0.6, len(members) - 0.4)


def _draw_paths(ax: Any, reproduction: Reproduction, ensemble: EnsembleCurves, gait: str) -> None:
    trace = reproduction.traces[gait, "elastic", SOLVER]
    x, y = ensemble.height_paths(gait, float(trace["trunk_y"][0]))
    for one in range(ensemble.members):
        ax.plot(x[one], y[one], color="black", alpha=0.3, lw=0.4, zorder=2, label="path of such a leg")
    sole = (trace["toe_x"] + trace["heel_x"]) / 2, -(trace["toe_penetration"] + trace["heel_penetration"]) / 2
    ax.plot(*sole, color="black", lw=0.9, zorder=4)
    ax.set_xlabel("x forward of crank centre O [m]")
    low, high = ax.get_ylim()
    draw_ground(ax, low)
    ax.set_ylim(low, high)


def _draw_bands(
    ax: Any, reproduction: Reproduction, gait: str, column: str, ensemble: EnsembleCurves, curves: Any
) -> None:
    for condition, colour in CONDITION_COLOURS.items():
        trace = reproduction.traces[gait, condition, SOLVER]
        ax.fill_between(
            ensemble.time, *band(curves[gait, condition]), color=colour, alpha=0.25, lw=0, zorder=2,
            label=f"range, {condition}",
        )  # fmt: skip
        ax.plot(trace["t"], trace[column], color=colour, lw=1.1, zorder=3, label=f"preset, {condition}")
