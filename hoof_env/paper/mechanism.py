"""Figure 1 of the paper: the mechanism with its names and numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from hoof_env._plotting import AMBER, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.paper.drawing import (
    FORWARD,
    HEIGHT,
    POINT_COLOURS,
    Point,
    draw_arrow,
    draw_ground,
    elastic_cycles,
    head,
    leg_at,
    legend_below,
    panel_height,
    show_box,
)
from hoof_env.paper.measure import POINTS
from hoof_env.paper.rows import Reproduction

# Links of one kind have one colour, and one entry in the legend.
ROLE_COLOURS = {
    "crank": ORANGE,
    "coupler": GREY,
    "upper triangle": AMBER,
    "connecting rod": GREY,
    "shank, upper part": GREEN,
    "shank, lower part": GREEN,
    "rocker": PURPLE,
    "strut": GREY,
    "hoof tie rod": GREY,
    "hoof triangle": BLUE,
    "hoof triangle, sole": BLUE,
}
NUMBER_AT = {8: 0.75, 10: 0.65, 12: 0.35}
"""Places of numbers along their links, from 0 at the tail to 1 at the head; 0.5 for other links."""

NAME_TO = {"C": (1.0, 0.3)}
"""Directions from a point to its name, for points without room on the side that their links leave free."""


def draw_mechanism(figure: Any, reproduction: Reproduction) -> None:
    """Draw figure 1: the whole leg in its walking stance, and its hoof with the forces on the point that
    bears most, its slip and penetration, and the hoof angle. Points are named, links are numbered as in Eq.
    2."""
    geometry = reproduction.geometry
    trace, _ = elastic_cycles(reproduction)["walk"]
    tip = max(POINTS, key=lambda point: trace[f"{point}_normal"].max())
    # An instant with a large force and a hoof angle that can be seen.
    row = trace[int(np.argmax(trace[f"{tip}_normal"] * (0.01 + np.abs(trace["hoof_angle"]))))]
    at = leg_at(geometry, trace, float(row["time"]))
    points = np.array(list(at.values()))
    hoof = np.array([at[name] for name in ("G", *geometry.corners)])
    side = float(np.ptp(hoof, axis=0).max())
    boxes = [
        np.array([np.minimum(points.min(axis=0) - 0.2, (np.inf, -0.2)), points.max(axis=0) + 0.2]),
        np.array([hoof.min(axis=0) - 0.45 * side, hoof.max(axis=0) + np.array([0.65, 0.1]) * side]),
    ]
    height = panel_height(*boxes) + 1.7
    title = "Figure 1. Mechanism of the leg and its contact with the ground"
    note = f"Walking at {row['time']:.3f} s. Links numbered as in Eq. 2."
    head(figure, height, reproduction, title, "elastic", note)
    axes = figure.subplots(1, 2, width_ratios=[across / up for across, up in np.ptp(boxes, axis=1)])
    sole = {geometry.toe, geometry.heel}
    hoof_points = {"G", *sole}
    titles = ("(a) the leg", f"(b) its hoof, the {tip} in the ground")
    for ax, box, names, title in zip(axes, boxes, (at.keys() - sole, hoof_points), titles, strict=True):
        show_box(ax, box)
        draw_ground(ax)
        _draw_links(ax, at, close=names == hoof_points)
        _name_points(ax, at, names, geometry)
        ax.set(title=title, xlabel=FORWARD, ylabel=HEIGHT)
    toe, heel = (at[name] for name in geometry.corners)
    _draw_contact(axes[1], at[getattr(geometry, tip)], toe, heel, tip, row, side)
    legend_below(figure, 4)


def _draw_links(ax: Any, at: dict[str, Point], *, close: bool) -> None:
    """Draw all links; number the hoof's links in the close view, and the remaining links in the view of the
    leg."""
    # The legend has the numbers of all links with the same role.
    numbers: dict[str, str] = {}
    for number, body in enumerate(PAPER.bodies, start=1):
        numbers[body.role] = f"{numbers[body.role]}, {number}" if body.role in numbers else str(number)
    for number, body in enumerate(PAPER.bodies, start=1):
        tail = at[body.tail]
        tip = at[body.head]
        colour = ROLE_COLOURS[body.role]
        label = f"{numbers[body.role]}  {body.role}"
        ax.plot(*np.array([tail, tip]).T, color=colour, lw=2, label=label, solid_capstyle="round")
        if close == body.role.startswith("hoof triangle"):
            ring = {"boxstyle": "circle,pad=0.2", "fc": "white", "ec": colour, "lw": 0.7}
            place = tail + NUMBER_AT.get(number, 0.5) * (tip - tail)
            ax.text(*place, str(number), fontsize=6, ha="center", va="center", bbox=ring, zorder=6)
    ax.plot(*np.array([at["C"], at["A"]]).T, color=ROLE_COLOURS["rocker"], lw=2)
    for corners, colour in (("CBD", AMBER), ("GJI", SKY)):
        ax.fill(*np.array([at[name] for name in corners]).T, color=colour, alpha=0.2, lw=0)


def _name_points(ax: Any, at: dict[str, Point], names: Any, geometry: Geometry) -> None:
    """Mark every joint, and write the names of some of them on the side that their links leave free."""
    sole = {geometry.toe: "toe", geometry.heel: "heel"}
    for name, point in at.items():
        fixed = name in ("O", "C")
        fill = POINT_COLOURS.get(sole.get(name, ""), "white")
        look = {"marker": "^", "ms": 6, "mfc": "black"} if fixed else {"marker": "o", "ms": 4, "mfc": fill}
        ax.plot(*point, mec="black", mew=0.8, zorder=7, **look)
        if name in names:
            ends = [(body.tail, body.head) for body in PAPER.bodies if name in (body.tail, body.head)]
            others = np.array([at[tip if tail == name else tail] - point for tail, tip in ends])
            # Away from the mean direction of the links at this point.
            free = -(others / np.linalg.norm(others, axis=1, keepdims=True)).sum(axis=0)
            away = np.array(NAME_TO.get(name, free))
            offset = 10 * away / max(float(np.linalg.norm(away)), 1e-9)
            text = {"toe": f"{name} = K (toe)", "heel": f"{name} = H (heel)"}.get(sole.get(name, ""), name)
            side = "right" if name in sole and offset[0] < 0 else "left" if name in sole else "center"
            ax.annotate(
                text, point, offset, textcoords="offset points", ha=side, va="center", weight="bold", zorder=9
            )


def _draw_contact(
    ax: Any, press: Point, toe: Point, heel: Point, tip: str, row: np.void, side: float
) -> None:
    """Draw forces, slip, penetration and hoof angle at the point that bears load.

    Args:
        ax: the axes.
        press, toe, heel: positions (x, y) of that point and of both ends of the sole [m].
        tip: name of the point, "toe" or "heel".
        row: row of the trace.
        side: size of the hoof, by which arrows are scaled [m].
    """
    # Arrows of fixed size; only the ratio of friction to the normal force is to scale.
    normal = 0.75 * side
    friction = normal * row[f"{tip}_friction"] / row[f"{tip}_normal"]
    slip = np.sign(row[f"{tip}_slide"]) * 0.3 * side
    below = press - (0, 0.15 * side)
    for start, vector, text, colour in (
        (press, (0, normal), "$F_n$", BLUE),
        (press, (friction, 0), "$F_f$", BLUE),
        (press, (friction, normal), "GRF", ORANGE),
        (below, (slip, 0), "$v_t$", GREEN),
    ):
        draw_arrow(ax, start, start + vector, colour)
        ax.annotate(text, start + vector, (3, 4), textcoords="offset points", color=colour, zorder=9)
    gauge = press[0] + 0.5 * side
    ax.plot([press[0], gauge], [press[1]] * 2, color="black", lw=0.6, ls=":")
    ax.plot([gauge] * 2, [press[1], 0], color="black", lw=0.8, marker="_", ms=5)
    ax.annotate(r"$\delta$", (gauge, press[1] / 2), (5, 0), textcoords="offset points", va="center")
    # The hoof angle is measured at the toe, from the ground behind it up to the sole.
    length = float(np.linalg.norm(heel - toe))
    turn = np.linspace(np.pi - row["hoof_angle"], np.pi, 30)
    arc = toe + 0.75 * length * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ax.plot([toe[0] - length, toe[0]], [toe[1]] * 2, color="black", lw=0.6, ls=":")
    ax.plot(*arc.T, color="black", lw=0.8)
    ax.annotate(r"$\alpha$", arc[-1], (-3, -8), textcoords="offset points", va="center")
