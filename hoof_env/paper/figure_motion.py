"""Figures 3 and 4 of the paper, redrawn: paths of the hoof and its angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.geometry import Geometry
from hoof_env.leg.linkage import BODIES
from hoof_env.paper.figure_style import (
    BLUE,
    GAITS,
    GREY,
    HEEL,
    ORANGE,
    SKY,
    SOIL,
    TOE,
    draw_ground,
    draw_travel_arrow,
    elastic_cycles,
    legend_below,
    points_at,
    row_at,
)
from hoof_env.paper.measure import Stance

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction


def draw_paths(figure: Any, reproduction: Reproduction) -> None:
    """Figure 3: paths of toe and heel over the cycle with the leg at mid-stance, its shank and hoof at
    eighteen instants; below, the same paths near the ground with the height stretched."""
    cycles = elastic_cycles(reproduction)
    limits = {
        gait: _horizontal_limits(reproduction.geometry, trace, stance)
        for gait, (trace, stance) in cycles.items()
    }
    figure.set_size_inches(7.5, 5.6)
    figure.set_layout_engine("compressed")
    axes = figure.subplots(
        2, 2, width_ratios=[float(np.ptp(x)) for x in limits.values()], height_ratios=(3, 1)
    )
    for (whole, near), (gait, (trace, stance)) in zip(axes.T, cycles.items(), strict=True):
        for t in np.arange(18) / 18 * stance.period:
            at = points_at(reproduction.geometry, row_at(trace, t))
            touching = stance.start <= t <= stance.end
            chain = np.array([at[name] for name in "EGJIG"])
            colour, alpha, label = (
                ("black", 0.7, "shank and hoof, stance") if touching else (GREY, 0.3, "shank and hoof, swing")
            )
            whole.plot(*chain.T, color=colour, lw=0.8, alpha=alpha, label=label, zorder=3)
        _draw_leg(whole, points_at(reproduction.geometry, row_at(trace, stance.middle)))
        for ax in (whole, near):
            draw_ground(ax, -1)
            for name, colour in (("toe", TOE), ("heel", HEEL)):
                x, y = trace[f"{name}_x"], -trace[f"{name}_penetration"]
                ax.plot(x, y, color=colour, lw=1, label=f"path of the {name}", zorder=4)
                ax.plot(
                    x,
                    np.where(y < 0, y, np.nan),
                    color=colour,
                    lw=2.5,
                    label=f"{name} in the ground",
                    zorder=5,
                )
            ax.set_xlim(limits[gait])
        draw_travel_arrow(whole, 0.04, 0.93, 0.35 / float(np.ptp(limits[gait])))
        deepest = max(trace["toe_penetration"].max(), trace["heel_penetration"].max())
        whole.set(title=GAITS[gait], aspect="equal", ylim=(-0.45, 2.15), xticklabels=[])
        near.set(xlabel="x forward of the crank centre O [m]", ylim=(-1.15 * deepest, 0.5 * deepest))
    axes[0, 0].set_ylabel("height above the ground [m]")
    axes[1, 0].set_ylabel("height, stretched [m]")
    legend_below(figure, axes[0, 0], columns=4)


def _horizontal_limits(geometry: Geometry, trace: NDArray[np.void], stance: Stance) -> tuple[float, float]:
    """Lowest and highest x [m] of the paths and of the leg at mid-stance, with a margin."""
    leg = [point[0] for point in points_at(geometry, row_at(trace, stance.middle)).values()]
    x = np.concatenate([trace["toe_x"], trace["heel_x"], leg])
    return float(x.min()) - 0.15, float(x.max()) + 0.25


def _draw_leg(ax: Any, at: dict[str, NDArray[np.float64]]) -> None:
    for body in BODIES:
        ax.plot(
            *np.array([at[body.tail], at[body.head]]).T,
            color=BLUE,
            lw=1.3,
            label="leg at mid-stance",
            zorder=6,
        )
    for name in ("O", "C"):
        ax.plot(*at[name], "^", ms=6, mfc="black", mec="black", zorder=7)
        ax.annotate(name, at[name], xytext=(-9, 0), textcoords="offset points", ha="center", va="center")


def draw_angles(figure: Any, reproduction: Reproduction) -> None:
    """Figure 4: hoof angle over the cycle; first contact, mid-stance and last contact beside the published
    ones; above, the hoof at these instants."""
    figure.set_size_inches(7.5, 5.0)
    axes = figure.subplots(2, 2, height_ratios=(1, 2))
    cycles = elastic_cycles(reproduction)
    for (hooves, ax), (gait, (trace, stance)) in zip(axes.T, cycles.items(), strict=True):
        instants = [stance.start, sum(stance.double) / 2 if stance.double else stance.middle, stance.end]
        angle = np.degrees(trace["hoof_angle"])
        ax.axvspan(stance.start, stance.end, color=SOIL, lw=0, zorder=0, label="stance")
        ax.axhline(0, color=GREY, lw=0.6, zorder=1)
        ax.plot(trace["t"], angle, color=BLUE, lw=1.5, zorder=2)
        ax.plot(
            instants,
            np.interp(instants, trace["t"], angle),
            "o",
            color=BLUE,
            ms=5,
            label="simulated",
            zorder=3,
        )
        published = _published_angles(reproduction, gait, instants[1])
        ax.plot(*published.T, "D", mfc="none", mec=ORANGE, mew=1.5, ms=7, label="published", zorder=4)
        ax.set(xlabel="time [s]", xlim=(0, stance.period))
        hooves.set_title(GAITS[gait])
        names = ("first contact", "mid-stance", "last contact")
        _draw_hooves(
            hooves,
            reproduction.geometry,
            [(n, row_at(trace, t)) for n, t in zip(names, instants, strict=True)],
        )
    axes[1, 0].set_ylabel("hoof angle, heel up positive [deg]")
    legend_below(figure, axes[1, 0], axes[0, 0], columns=5)


def _published_angles(reproduction: Reproduction, gait: str, middle: float) -> NDArray[np.float64]:
    """Published (time, angle) pairs; the angle at mid-stance, printed without a time, at `middle` [s]."""
    value = {
        row.id.removeprefix(f"{gait}."): row.value for row in reproduction.published.rows if row.gait == gait
    }
    pairs = [(value["contact_start"], value["angle_contact"]), (value["contact_end"], value["angle_liftoff"])]
    return np.array(pairs + ([(middle, value["angle_flat"])] if "angle_flat" in value else []))


def _draw_hooves(ax: Any, geometry: Geometry, rows: list[tuple[str, np.void]]) -> None:
    draw_ground(ax, -1)
    for place, (name, row) in enumerate(rows):
        at = points_at(geometry, row)
        shift = np.array([place - (at[geometry.toe][0] + at[geometry.heel][0]) / 2, 0])
        ax.fill(*np.array([at[corner] + shift for corner in "GJI"]).T, fc=SKY, ec=BLUE, lw=1, zorder=3)
        for point, colour, label in ((geometry.toe, TOE, "toe"), (geometry.heel, HEEL, "heel")):
            ax.plot(*(at[point] + shift), "o", color=colour, ms=4, label=label, zorder=4)
        ax.text(place, -0.4, f"{name}\n{row['t']:.3f} s", ha="center", va="top", fontsize=8, linespacing=1.1)
    ax.set(aspect="equal", xlim=(-0.6, 2.6), ylim=(-0.85, 0.55))
    ax.axis("off")
