"""The leg and its labels drawn true to shape: what both panels of figure 1 share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.linkage import BODIES
from hoof_env.paper.figure_labels import Room, dots_along, text_size
from hoof_env.paper.figure_style import AMBER, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, SMALL

Point = NDArray[np.float64]

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
    """Axes with one scale for both directions, in which labels find their place.

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
        self._room = Room(*size, np.empty((0, 2)))
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
        self._room = Room(*self._size, dots_along([self._millimetres(line) for line in [*lines, surface]]))

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
            place = self._room.put(candidates, (diameter, diameter), costs, crowd)
            places.append(self._origin + place / self._scale)
        return places

    def name(self, point: Point, text: str, gap: float, **settings: Any) -> None:
        """Name a point [m], `gap` [mm] or a little more beside it."""
        settings = {"fontsize": SMALL} | settings
        plain = text.translate(str.maketrans("", "", "$_\\"))
        width, height = text_size(plain, settings["fontsize"], settings.get("weight", "normal"))
        size = (width + 0.8, height + 0.6)
        place = self._origin + self._room.put_beside(self._millimetres(point), size, gap) / self._scale
        self.ax.text(*place, text, ha="center", va="center", zorder=9, **settings)

    def _millimetres(self, points: Point) -> Point:
        return (points - self._origin) * self._scale
