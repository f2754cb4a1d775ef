"""Figure 1 (b) of the paper, redrawn: the hoof in the ground with the quantities of Eqs. 10 to 15."""

from __future__ import annotations

from typing import Any

import numpy as np

from hoof_env.paper.figure_layout import draw_arrow
from hoof_env.paper.figure_links import Point, Scene, link_lines
from hoof_env.paper.figure_style import BLUE, GREEN, GREY, HEEL, ORANGE, TOE, draw_ground


def draw_contact(
    ax: Any, size: tuple[float, float], at: dict[str, Point], sole: dict[str, str], tip: str, row: np.void
) -> None:
    """Forces, slip, penetration and hoof angle at one instant.

    Arrows and the ground's spring and damper are drawn in parts of the hoof's longest side.

    Args:
        ax: axes of `size` [mm].
        at: points by name [m]. sole: names of the points that are "toe" and "heel".
        tip: "toe" or "heel", which of them presses. row: of the trace at this instant.
    """
    toe, heel, press = at[sole["toe"]], at[sole["heel"]], at[sole[tip]]
    corners = np.array([at["G"], toe, heel])
    side = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max())
    low = np.array([corners[:, 0].min() - 0.2 * side, corners[:, 1].min() - 0.5 * side])
    high = np.maximum(corners.max(axis=0), press + np.array([0.6, 0.85]) * side) + 0.1 * side
    scene = Scene(ax, size, low, high)
    draw_ground(ax, low[1] - 1)
    scene.draw_links(at, 2.2)
    for point, colour in ((toe, TOE), (heel, HEEL), (at["G"], "white")):
        ax.plot(*point, "o", ms=4.5, mfc=colour, mec="black", mew=0.8, zorder=9)

    force = np.array([row[f"{tip}_friction"], row[f"{tip}_normal"]]) * 0.75 * side / row[f"{tip}_normal"]
    slip = np.array([np.sign(row[f"{tip}_slide"]) * 0.3 * side, 0])
    below = press + np.array([np.sign(slip[0]) * 0.14 * side, -0.3 * side])
    arrows = [
        (press, force * (0, 1), "$F_n$", BLUE), (press, force * (1, 0), "$F_f$", BLUE),
        (press, force, "GRF", ORANGE), (below, slip, "$v_t$", GREEN),
    ]  # fmt: skip
    for start, vector, _, colour in arrows:
        draw_arrow(ax, start, start + vector, colour)
    gauge = np.array([[press[0] + 0.5 * side, 0], press + np.array([0.5 * side, 0])])
    level, arc = _angle(toe, heel, row["hoof_angle"])
    lines = [level, np.array([press, gauge[1]])]
    for line in lines:
        ax.plot(*line.T, color="black", lw=0.6, ls=":", zorder=4)
    ax.plot(*gauge.T, color="black", lw=0.8, marker="_", ms=5)
    ax.plot(*arc.T, color="black", lw=0.8)
    element = _ground_element(press, 0.42 * side)
    for line in element:
        ax.plot(*line.T, color=GREY, lw=1, zorder=2)

    shafts = [np.array([start, start + vector]) for start, vector, _, _ in arrows]
    scene.keep_clear([*link_lines(at), *shafts, *lines, arc, gauge, *element])
    for name, point in (("K", toe), ("H", heel), ("G", at["G"])):
        scene.name(point, name, 1.2, weight="bold")
    for start, vector, name, colour in arrows:
        scene.name(start + vector, name, 0.8, color=colour, fontsize=8)
    scene.name(arc[len(arc) // 2], r"$\alpha$", 0.8, fontsize=8)
    scene.name(gauge.mean(axis=0), r"$\delta$", 0.8, fontsize=8)


def _angle(toe: Point, heel: Point, angle: float) -> tuple[Point, Point]:
    """The level through the toe, and the arc from it to the sole: the hoof angle, heel up positive [rad]."""
    sole = float(np.linalg.norm(heel - toe))
    turn = np.linspace(np.pi - angle, np.pi, 30)
    arc = toe + 0.75 * sole * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.array([toe - (sole, 0), toe]), arc


def _ground_element(top: Point, depth: float) -> list[Point]:
    """The spring and the damper of Eq. 14 from a point down, as polylines."""
    zigzag = np.array([[0, 0], [0, -2], [1, -3], [-1, -4], [1, -5], [-1, -6], [1, -7], [0, -8], [0, -10]])
    spring = zigzag * (0.5, 1) + (-1.5, 0)
    damper = [[[1.5, 0], [1.5, -5]], [[0.9, -5], [2.1, -5]], [[1.5, -6.5], [1.5, -10]],
              [[0.6, -3.8], [0.6, -6.5], [2.4, -6.5], [2.4, -3.8]]]  # fmt: skip
    ends = [[[-1.5, 0], [1.5, 0]], [[-3, -10], [3, -10]]]
    return [top + depth / 10 * np.array(line) for line in (spring, *damper, *ends)]
