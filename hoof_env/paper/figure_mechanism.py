"""Figure 1 of the paper, redrawn: the labelled mechanism in one pose, and its hoof on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.linkage import BODIES
from hoof_env.paper.figure_style import (
    AMBER,
    BLUE,
    GAITS,
    GAP,
    GREEN,
    GREY,
    HEAD,
    HEEL,
    INCH,
    LEFT,
    ORANGE,
    PURPLE,
    SKY,
    SMALL,
    SOLVER,
    TOE,
    WIDTH,
    draw_arrow,
    draw_ground,
    head,
    name_height,
    panel,
    panel_title,
    points_at,
    text_size,
)
from hoof_env.paper.measure import POINTS
from hoof_env.paper.rows import Reproduction

Point = NDArray[np.float64]


def dots_along(lines: Sequence[Point]) -> Point:
    """Points every 0.4 mm along polylines of shape (k, 2), shape (j, 2)."""
    dots = []
    for line in lines:
        for one, two in pairwise(line):
            count = max(int(np.hypot(*(two - one)) / 0.4), 1)
            dots.append(one + np.linspace(0, 1, count + 1)[:, None] * (two - one))
    return np.concatenate(dots) if dots else np.empty((0, 2))


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
TRIANGLES = (("C", "B", "D", AMBER), ("G", "J", "I", SKY))


def link_lines(at: dict[str, Point]) -> list[Point]:
    """The links as lines [m], body by body, from the points by name; the last one is rocker 8 as far as A."""
    return [np.array([at[b.tail], at[b.head]]) for b in BODIES] + [np.array([at["C"], at["A"]])]


class Scene:
    """Axes with one scale for both directions, in which labels find their place one after the other.

    Args:
        ax: axes of `size` [mm].
        low, high: corners of what is shown at least [m].
    """

    def __init__(self, ax: Any, size: tuple[float, float], low: Point, high: Point) -> None:
        self.ax = ax
        self._size = size
        self._scale = float((np.array(size) / (high - low)).min())  # [mm/m]
        across, up = np.array(size) / self._scale
        self._origin = np.array([(low[0] + high[0] - across) / 2, low[1]])
        self._drawn = self._labels = np.empty((0, 2))  # as dots [mm]
        ax.set(
            xlim=(self._origin[0], self._origin[0] + across),
            ylim=(low[1], low[1] + up),
            xlabel="x forward of O [m]",
        )

    def draw_links(self, at: dict[str, Point], width: float) -> None:
        """Links and triangles between the points, by name [m]; `width` of the lines in points."""
        for *corners, colour in TRIANGLES:
            self.ax.fill(*np.array([at[name] for name in corners]).T, color=colour, alpha=0.2, lw=0, zorder=2)
        colours = [ROLE_COLOURS[body.role] for body in BODIES]
        for line, colour in zip(link_lines(at), [*colours, ROLE_COLOURS["rocker"]], strict=True):
            self.ax.plot(*line.T, color=colour, lw=width, zorder=3, solid_capstyle="round")

    def keep_clear(self, lines: Sequence[Point]) -> None:
        """Lines [m] that labels should not cover, and the surface of the ground."""
        surface = np.array([[x, 0.0] for x in self.ax.get_xlim()])
        self._drawn = dots_along([self._millimetres(line) for line in [*lines, surface]])

    def number(self, lines: Sequence[Point], joints: Point, diameter: float) -> list[Point]:
        """Where numbers `diameter` [mm] wide go on lines, clear of each other, of the other lines and of the
        joints, shape (k, 2); everything else in [m]."""
        parts = 0.5 + np.array([0, 0.06, -0.06, 0.12, -0.12, 0.18, -0.18, 0.24, -0.24, 0.3, -0.3])
        joints = self._millimetres(joints)
        places = []
        for k, line in enumerate(map(self._millimetres, lines)):
            others = [self._millimetres(other) for other in [*lines[:k], *lines[k + 1 :]]]
            crowd = np.concatenate([dots_along(others), *[joints] * 5])
            candidates = line[0] + parts[:, None] * (line[1] - line[0])
            costs = 3 * np.abs(parts - 0.5)
            places.append(self._put(candidates, (diameter, diameter), costs, crowd))
        return places

    def name(self, point: Point, text: str, gap: float, **settings: Any) -> None:
        """Name a point [m], `gap` [mm] or a little more beside it."""
        settings = {"fontsize": SMALL} | settings
        plain = text.translate(str.maketrans("", "", "$_\\"))
        width, height = text_size(plain, settings["fontsize"], settings.get("weight", "normal"))
        size = width + 0.8, height + 0.6
        angles = np.arange(24) * np.pi / 12
        sides = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        reach = np.abs(sides) @ (np.array(size) / 2)
        gaps = gap * np.array([1, 1.8, 3])
        candidates = [self._millimetres(point) + sides * (reach + g)[:, None] for g in gaps]
        costs = np.repeat(3 * (gaps - gap), len(sides))
        place = self._put(np.concatenate(candidates), size, costs, self._drawn)
        self.ax.text(*place, text, ha="center", va="center", zorder=9, **settings)

    def _put(self, candidates: Point, size: tuple[float, float], costs: Point, drawn: Point) -> Point:
        """Where a label of `size` [mm] goes [m]: the candidate centre, shape (k, 2) [mm], that covers least
        of the dots `drawn`, shape (j, 2) [mm], and of other labels; to cover one costs 1, and `costs` are
        those of each candidate beforehand."""
        half = np.array(size) / 2
        near = np.abs(np.concatenate([drawn, self._labels]) - candidates[:, None])
        outside = np.clip(half - candidates, 0, None) + np.clip(candidates + half - self._size, 0, None)
        cost = costs + (near < half).all(axis=2).sum(axis=1) + 100 * outside.sum(axis=1)
        centre = candidates[int(np.argmin(cost))]
        rows = [np.linspace(-h, h, 12) for h in half]
        self._labels = np.concatenate([self._labels, centre + np.dstack(np.meshgrid(*rows)).reshape(-1, 2)])
        return self._origin + centre / self._scale

    def _millimetres(self, points: Point) -> Point:
        return (points - self._origin) * self._scale


def draw_contact(
    ax: Any, size: tuple[float, float], at: dict[str, Point], sole: dict[str, str], tip: str, row: np.void
) -> None:
    """Forces, slip, penetration and hoof angle at one instant, in parts of the hoof's longest side.

    Args:
        ax: axes of `size` [mm].
        at: points by name [m].
        sole: names of the points that are "toe" and "heel"; `tip` is the one that presses.
        row: of the trace at this instant.
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
    length = float(np.linalg.norm(heel - toe))
    turn = np.linspace(np.pi - row["hoof_angle"], np.pi, 30)
    arc = toe + 0.75 * length * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    lines = [np.array([toe - (length, 0), toe]), np.array([press, gauge[1]])]
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


def _ground_element(top: Point, depth: float) -> list[Point]:
    """The spring and the damper of Eq. 14 from a point down, as polylines."""
    zigzag = np.array([[0, 0], [0, -2], [1, -3], [-1, -4], [1, -5], [-1, -6], [1, -7], [0, -8], [0, -10]])
    spring = zigzag * (0.5, 1) + (-1.5, 0)
    damper = [[[1.5, 0], [1.5, -5]], [[0.9, -5], [2.1, -5]], [[1.5, -6.5], [1.5, -10]],
              [[0.6, -3.8], [0.6, -6.5], [2.4, -6.5], [2.4, -3.8]]]  # fmt: skip
    ends = [[[-1.5, 0], [1.5, 0]], [[-3, -10], [3, -10]]]
    return [top + depth / 10 * np.array(line) for line in (spring, *damper, *ends)]


LEG, PANEL = 66.0, 92.0  # width of the panel with the whole leg, height of both panels [mm]
BADGE, NUMBER = 3.4, 6.0  # diameter of the circle around a link's number [mm], size of the number [points]


def draw_mechanism(figure: Any, reproduction: Reproduction) -> None:
    """Figure 1: the leg walking, its toe in the ground and its heel up: (a) all of it, with every point named
    and every link numbered as in Eq. 2; (b) the hoof with forces, slip, penetration and angle."""
    gait, tip, row = _instant(reproduction)
    geometry = reproduction.geometry
    at = points_at(geometry, row)
    head(
        figure, HEAD + 5 + PANEL + 22, reproduction,
        "Figure 1. Mechanism of the leg and its contact with the ground", "elastic",
        f"{GAITS[gait]} at {row['time']:.3f} s. Bodies numbered as in Eq. 2.",
    )  # fmt: skip
    close = LEFT + LEG + GAP
    widths = {LEFT: LEG, close: WIDTH - close - 3}
    titles = ("(a) the leg", f"(b) its hoof, the {tip} in the ground")
    panels = []
    for title, (left, width) in zip(titles, widths.items(), strict=True):
        panel_title(figure, left, title, width)
        panels.append(panel(figure, left, HEAD + 5, width, PANEL))
    name_height(panels[0], "height above the ground [m]", LEG)
    sole = {"toe": geometry.toe, "heel": geometry.heel}
    _draw_whole(panels[0], at, sole)
    draw_contact(panels[1], (widths[close], PANEL), at, sole, tip, row)
    _explain_roles(figure)


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


def _explain_roles(figure: Any) -> None:
    """A legend with the line and the name of each role and the numbers of its bodies."""
    from matplotlib.lines import Line2D

    roles: dict[str, list[int]] = {}
    for number, body in enumerate(BODIES, start=1):
        roles.setdefault(body.role, []).append(number)
    lines = [Line2D([], [], color=ROLE_COLOURS[role], lw=1.8) for role in roles]
    names = [f"{', '.join(map(str, numbers))}  {role}" for role, numbers in roles.items()]
    figure.legend(lines, names, loc="lower center", ncols=4, borderaxespad=0.2)


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
