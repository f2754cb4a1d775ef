"""Figure 1 of the paper, redrawn: the labelled mechanism in one pose, and its hoof on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hoof_env.leg.linkage import BODIES
from hoof_env.paper.figure_contact import draw_contact
from hoof_env.paper.figure_layout import (
    GAP,
    HEAD,
    INCH,
    LEFT,
    WIDTH,
    head,
    name_height,
    name_travel,
    panel,
    set_size,
    write,
)
from hoof_env.paper.figure_links import ROLE_COLOURS, Point, Scene, link_lines
from hoof_env.paper.figure_style import GAITS, HEEL, SOLVER, TOE, draw_ground, points_at
from hoof_env.paper.measure import POINTS

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

LEG, PANEL = 66.0, 92.0
"""Width of the panel with the whole leg, height of both panels [mm]."""

BADGE, NUMBER = 3.4, 6.0
"""Diameter of the circle around a link's number [mm], size of the number [points]."""


def draw_mechanism(figure: Any, reproduction: Reproduction) -> None:
    """Figure 1: the leg walking, its toe in the ground and its heel up: (a) all of it, with every point named
    and every link numbered as in Eq. 2; (b) the hoof with forces, slip, penetration and angle."""
    gait, tip, row = _instant(reproduction)
    geometry = reproduction.geometry
    at = points_at(geometry, row)
    set_size(figure, HEAD + 5 + PANEL + 22)
    head(
        figure, reproduction, "Figure 1. Mechanism of the leg and its contact with the ground", "elastic",
        f"{GAITS[gait]} at {row['time']:.3f} s. Bodies numbered as in Eq. 2.",
    )  # fmt: skip
    close = LEFT + LEG + GAP
    widths = {LEFT: LEG, close: WIDTH - close - 3}
    titles = ("(a) the leg", f"(b) its hoof, the {tip} in the ground")
    panels = []
    for title, (left, width) in zip(titles, widths.items(), strict=True):
        write(figure, left, HEAD, title)
        name_travel(figure, left, HEAD, width)
        panels.append(panel(figure, left, HEAD + 5, width, PANEL))
    name_height(panels[0], "height above the ground [m]", LEG)
    sole = {"toe": geometry.toe, "heel": geometry.heel}
    _draw_whole(panels[0], at, sole)
    draw_contact(panels[1], (widths[close], PANEL), at, sole, tip, row)
    figure.legend(*_role_legend(), loc="lower center", ncols=4, borderaxespad=0.2)


def _instant(reproduction: Reproduction) -> tuple[str, str, np.void]:
    """Gait, point and row of the trace to show: the toe deep with the heel up, walking if its toe presses at
    all, else running; the heel of a leg whose toe never does."""
    choices = [(gait, point) for point in POINTS for gait in GAITS]
    traces = {gait: reproduction.traces[gait, "elastic", SOLVER] for gait in GAITS}
    gait, point = next(choice for choice in choices if traces[choice[0]][f"{choice[1]}_normal"].any())
    trace = traces[gait]
    tilt = np.abs(trace["hoof_angle"]) if point == "heel" else trace["hoof_angle"].clip(0)
    weight = trace[f"{point}_penetration"] * (0.01 + tilt) * (trace[f"{point}_normal"] > 0)
    return gait, point, trace[int(np.argmax(weight))]


def _role_legend() -> tuple[list[Any], list[str]]:
    """A line and the name of each role, with the numbers of its bodies."""
    from matplotlib.lines import Line2D

    roles: dict[str, list[int]] = {}
    for number, body in enumerate(BODIES, start=1):
        roles.setdefault(body.role, []).append(number)
    lines = [Line2D([], [], color=ROLE_COLOURS[role], lw=1.8) for role in roles]
    return lines, [f"{', '.join(map(str, numbers))}  {role}" for role, numbers in roles.items()]


def _draw_whole(ax: Any, at: dict[str, Point], sole: dict[str, str]) -> None:
    points = np.array(list(at.values()))
    low = np.minimum(points.min(axis=0) - 0.15, (np.inf, -0.15))
    scene = Scene(ax, (LEG, PANEL), low, points.max(axis=0) + 0.15)
    draw_ground(ax, low[1] - 1)
    scene.draw_links(at, 1.8)
    lines = link_lines(at)
    scene.keep_clear(lines)
    badge = BADGE / LEG * np.ptp(ax.get_xlim())
    places = scene.number(lines[: len(BODIES)], points, BADGE)
    for number, (body, place) in enumerate(zip(BODIES, places, strict=True), start=1):
        colour = ROLE_COLOURS[body.role]
        if np.linalg.norm(at[body.head] - at[body.tail]) < 1.5 * badge:  # no room on the link: in front of it
            place = np.array([max(at[body.head][0], at[body.tail][0]) + badge, place[1]])
        ax.plot(*place, "o", ms=BADGE / INCH * 72, mfc="white", mec=colour, mew=0.7, zorder=5)
        ax.text(*place, str(number), fontsize=NUMBER, ha="center", va="center_baseline", zorder=6)
    letters = {sole["toe"]: ("K (toe)", TOE), sole["heel"]: ("H (heel)", HEEL)}
    for name, point in at.items():
        letter, fill = letters.get(name, ("", "white"))
        fixed = name in ("O", "C")
        look = {"marker": "^", "ms": 6, "mfc": "black"} if fixed else {"marker": "o", "ms": 3.6, "mfc": fill}
        ax.plot(*point, mec="black", mew=0.8, zorder=7, **look)
        scene.name(point, f"{name} = {letter}" if letter else name, 1.6 if fixed else 1.1, weight="bold")
