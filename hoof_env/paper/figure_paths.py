"""Figure 3 of the paper, redrawn: the paths of the hoof."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.linkage import BODIES
from hoof_env.paper.figure_layout import (
    GAP,
    HEAD,
    LEFT,
    WIDTH,
    draw_arrow,
    head,
    legend_below,
    name_height,
    name_travel,
    panel,
    set_size,
    write,
)
from hoof_env.paper.figure_style import (
    GAITS,
    GREY,
    HEEL,
    SKY,
    TOE,
    draw_ground,
    elastic_cycles,
    mark_published,
    points_at,
    row_at,
)
from hoof_env.paper.measure import Stance

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

HOOVES = 8
"""The hoof is drawn at this many equally spaced instants of the cycle."""

TALLEST, NEAR = 110.0, 26.0
"""Most height for the whole leg, height near the ground [mm]."""

Trace = NDArray[np.void]


def draw_paths(figure: Any, reproduction: Reproduction) -> None:
    """Figure 3: paths of toe and heel over the cycle, their parts in the ground heavy, with the published
    instants of contact, the leg at mid-stance and the hoof around the cycle; below, the same near the ground.

    Both gaits have the same scale. Above each other are the true shape and a stretched height.
    """
    cycles = elastic_cycles(reproduction)
    boxes = {gait: _extent(reproduction, *cycle) for gait, cycle in cycles.items()}
    low = min(box[0, 1] for box in boxes.values())
    rise = max(box[1, 1] for box in boxes.values()) - low
    spans = {gait: float(np.ptp(box[:, 0])) for gait, box in boxes.items()}
    room = WIDTH - LEFT - GAP - 2
    scale = min(room / sum(spans.values()), TALLEST / rise)
    tall = scale * rise
    set_size(figure, HEAD + 5 + tall + 4 + NEAR + 19)
    head(
        figure, reproduction, "Figure 3. Paths of the hoof", "elastic",
        "Marks lie on the paths at the published instants of contact. Below, heights are stretched.",
    )  # fmt: skip
    left = LEFT
    for letter, (gait, (trace, stance)) in zip("ab", cycles.items(), strict=True):
        width = room * spans[gait] / sum(spans.values())
        middle = boxes[gait][:, 0].mean()
        across = (middle - width / scale / 2, middle + width / scale / 2)
        write(figure, left, HEAD, f"({letter}) {GAITS[gait]}")
        name_travel(figure, left, HEAD, width)
        whole = panel(
            figure, left, HEAD + 5, width, tall, xlim=across, ylim=(low, low + rise), xticklabels=[]
        )
        near = panel(
            figure,
            left,
            HEAD + 9 + tall,
            width,
            NEAR,
            xlim=across,
            xlabel="x forward of crank centre O [m]",
        )
        contacts = _published_contacts(reproduction, gait, trace, stance)
        deepest = max(trace["toe_penetration"].max(), trace["heel_penetration"].max())
        near.set_ylim(-1.15 * deepest, max(0.6 * deepest, 1.15 * contacts[:, 1].max()))
        near.locator_params(axis="y", nbins=4)
        _draw_leg(whole, points_at(reproduction.geometry, row_at(trace, stance.middle)))
        _draw_hooves(whole, reproduction, trace, stance)
        for ax in (whole, near):
            draw_ground(ax, -2)
            _draw_hoof_paths(ax, trace)
            mark_published(ax, *contacts.T)
        if gait == "walk":
            name_height(whole, "height above the ground [m]", width)
            name_height(near, "height [m]", width)
            axes = whole, near
        left += width + GAP
    legend_below(figure, *axes, columns=4)


def _extent(reproduction: Reproduction, trace: Trace, stance: Stance) -> NDArray[np.float64]:
    """Lower left and upper right corner [m] of what is drawn of a gait, with a margin."""
    leg = points_at(reproduction.geometry, row_at(trace, stance.middle)).values()
    hooves = [points_at(reproduction.geometry, row_at(trace, t))["G"] for t in _instants(stance)]
    paths = [np.stack([trace[f"{name}_x"], -trace[f"{name}_penetration"]], 1) for name in ("toe", "heel")]
    shown = np.concatenate([*paths, np.array([*leg, *hooves])])
    return np.array([shown.min(axis=0) - 0.1, shown.max(axis=0) + 0.1])


def _instants(stance: Stance) -> NDArray[np.float64]:
    return np.arange(HOOVES) / HOOVES * stance.period


def _draw_leg(ax: Any, at: dict[str, NDArray[np.float64]]) -> None:
    for body in BODIES:
        line = np.array([at[body.tail], at[body.head]])
        ax.plot(*line.T, color=GREY, lw=0.9, label="leg at mid-stance", zorder=6, solid_capstyle="round")
    for name in ("O", "C"):
        ax.plot(*at[name], "^", ms=4.5, mfc="black", mec="black", zorder=7)
        ax.annotate(name, at[name], (-7, 0), textcoords="offset points", ha="center", va="center")


def _draw_hooves(ax: Any, reproduction: Reproduction, trace: Trace, stance: Stance) -> None:
    for t in _instants(stance):
        at = points_at(reproduction.geometry, row_at(trace, t))
        bears = stance.start <= t <= stance.end
        look = {"fc": SKY, "alpha": 0.6, "label": "hoof in stance"} if bears else {"fc": "#CCCCCC"}
        look = {"alpha": 0.5, "label": "hoof in swing", "ec": GREY, "lw": 0.4, "zorder": 3} | look
        ax.fill(*np.array([at[corner] for corner in "GJI"]).T, **look)


def _draw_hoof_paths(ax: Any, trace: Trace) -> None:
    for name, colour in (("toe", TOE), ("heel", HEEL)):
        x, y = trace[f"{name}_x"], -trace[f"{name}_penetration"]
        ax.plot(x, y, color=colour, lw=0.9, label=f"path of the {name}", zorder=4)
        ground = np.where(y < 0, y, np.nan)
        ax.plot(x, ground, color=colour, lw=2.4, label=f"{name} in the ground", zorder=5)
        k = int(np.argmax(y))  # far from the ground: an arrow shows which way round
        tip = min(k + len(x) // 200, len(x) - 1)
        draw_arrow(ax, (x[k], y[k]), (x[tip], y[tip]), colour, lw=0.9, clip_on=True)


def _published_contacts(
    reproduction: Reproduction, gait: str, trace: Trace, stance: Stance
) -> NDArray[np.float64]:
    """Where the points that touch first and leave last are at the published instants of contact [m]."""
    places = []
    for row, points in (("contact_start", stance.first_points), ("contact_end", stance.last_points)):
        t = reproduction.published.row(f"{gait}.{row}").value
        for name in sorted(points):
            x, depth = (np.interp(t, trace["time"], trace[f"{name}_{part}"]) for part in ("x", "penetration"))
            places.append((x, -depth))
    return np.array(places)
