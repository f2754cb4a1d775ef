"""Figure 1 of the paper, redrawn: the labelled mechanism in one pose, and its hoof on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.linkage import BODIES
from hoof_env.paper.figure_style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    SOLVER,
    draw_ground,
    draw_travel_arrow,
    points_at,
)

if TYPE_CHECKING:
    from hoof_env.paper.reproduce import Reproduction

Point = NDArray[np.float64]

ROLE_COLOURS = {
    "crank": ORANGE,
    "coupler": GREY,
    "upper triangle": BLUE,
    "connecting rod": GREY,
    "shank, upper part": GREEN,
    "shank, lower part": GREEN,
    "rocker": SKY,
    "strut": GREY,
    "hoof tie rod": GREY,
    "hoof triangle": PURPLE,
    "hoof triangle, sole": PURPLE,
}
TRIANGLES = (("C", "B", "D", BLUE), ("G", "J", "I", PURPLE))


def draw_mechanism(figure: Any, reproduction: Reproduction) -> None:
    """The walking leg when its toe is deepest: (a) all of it, (b) its hoof in the ground."""
    figure.set_layout_engine("compressed")
    trace = reproduction.traces["walk", "elastic", SOLVER]
    row = trace[int(np.argmax(trace["toe_penetration"]))]
    geometry = reproduction.geometry
    at = points_at(geometry, row)
    figure.set_size_inches(7.5, 4.8)
    whole, close = figure.subplots(1, 2, width_ratios=(0.8, 1))
    _draw_whole(whole, at, {geometry.toe: "K (toe)", geometry.heel: "H (heel)"})
    _draw_close(close, at, at[geometry.toe], at[geometry.heel], row)


def _draw_links(ax: Any, at: dict[str, Point], width: float) -> None:
    for one, two, three, colour in TRIANGLES:
        ax.fill(*np.array([at[one], at[two], at[three]]).T, color=colour, alpha=0.15, lw=0, zorder=2)
    for body in BODIES:
        ax.plot(
            *np.array([at[body.tail], at[body.head]]).T, color=ROLE_COLOURS[body.role], lw=width, zorder=3
        )


def _label_side(at: dict[str, Point], name: str) -> Point:
    """Unit vector into the widest gap between the links that meet at a point."""
    ends = [at[b.head] for b in BODIES if b.tail == name] + [at[b.tail] for b in BODIES if b.head == name]
    angles = np.sort([np.arctan2(*(end - at[name])[::-1]) for end in ends])
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    middle = angles[np.argmax(gaps)] + gaps.max() / 2
    return np.array([np.cos(middle), np.sin(middle)])


def _draw_whole(ax: Any, at: dict[str, Point], hoof: dict[str, str]) -> None:
    draw_ground(ax, -1)
    ax.plot(*np.array([at["C"], at["A"]]).T, color=SKY, lw=2, zorder=2)
    _draw_links(ax, at, 2)
    for number, body in enumerate(BODIES, start=1):
        middle = (at[body.tail] + at[body.head]) / 2
        ax.text(
            *middle, str(number), fontsize=6.5, ha="center", va="center", zorder=5,
            bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": ROLE_COLOURS[body.role], "lw": 0.7},
        )  # fmt: skip
    for name, point in at.items():
        fixed = name in ("O", "C")
        look = {"marker": "^", "ms": 7, "mfc": "black"} if fixed else {"marker": "o", "ms": 4, "mfc": "white"}
        ax.plot(*point, mec="black", zorder=6, **look)
        side = _label_side(at, name)
        place = {"xytext": 9 * side, "ha": "center", "va": "center"}
        if name in hoof:  # long labels, clear of the line of the ground
            right, above = side[0] > 0, point[1] > 0
            place = {"xytext": (8 if right else -8, 3 if above else -3)}
            place |= {"ha": "left" if right else "right", "va": "bottom" if above else "top"}
        text = f"{name} = {hoof[name]}" if name in hoof else name
        ax.annotate(text, point, textcoords="offset points", weight="bold", zorder=7, **place)
    ax.annotate("y = 0, the ground", (0.02, 0.02), xycoords="axes fraction", color=GREY, fontsize=8)
    x, top = [point[0] for point in at.values()], max(point[1] for point in at.values())
    ax.set(
        title="(a) the leg", aspect="equal",
        xlabel="x forward of O [m]", ylabel="height above the ground [m]",
        xlim=(min(x) - 0.2, max(x) + 0.3), ylim=(-0.2, top + 0.25),
    )  # fmt: skip
    draw_travel_arrow(ax, 0.05, 0.5, 0.25)


def _draw_close(ax: Any, at: dict[str, Point], toe: Point, heel: Point, row: np.void) -> None:
    ax.set(title="(b) its hoof on the ground", xlabel="x forward of O [m]", aspect="equal")
    corners = np.array([toe, heel, at["G"]])
    ax.set(
        xlim=(corners[:, 0].min() - 0.1, corners[:, 0].max() + 0.23), ylim=(-0.2, corners[:, 1].max() + 0.1)
    )
    draw_ground(ax, -1)
    _draw_links(ax, at, 2.5)
    for name, point, offset in (("K", toe, (-16, -6)), ("H", heel, (-10, 4)), ("G", at["G"], (-9, 6))):
        ax.plot(*point, "o", ms=5, mfc="white", mec="black", zorder=6)
        ax.annotate(
            name, point, xytext=offset, textcoords="offset points", ha="center", va="center", weight="bold"
        )
    _draw_ground_element(ax, toe)
    scale = 0.28 / float(row["toe_normal"])
    force = scale * np.array([row["toe_friction"], row["toe_normal"]])
    for vector, name, colour in (
        ((0, force[1]), "$F_n$", BLUE), ((force[0], 0), "$F_f$", BLUE), (force, "GRF", ORANGE),
    ):  # fmt: skip
        _draw_arrow(ax, toe, np.asarray(vector), name, colour)
    slip = np.sign(row["toe_vx"]) * 0.12
    _draw_arrow(ax, toe + np.array([np.sign(slip) * 0.06, -0.08]), np.array([slip, 0]), "$v_t$", GREEN)
    gap = toe[0] + 0.17
    ax.annotate(
        "", (gap, 0), (gap, toe[1]), arrowprops={"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0, "lw": 0.8}
    )
    ax.plot([toe[0], gap + 0.01], [toe[1], toe[1]], color="black", lw=0.6, ls=":")
    ax.text(gap + 0.014, toe[1] / 2, r"$\delta$", va="center")
    lean = np.degrees(row["hoof_angle"])
    from matplotlib.patches import Arc

    ax.plot([toe[0] - 0.3, toe[0]], [toe[1], toe[1]], color="black", lw=0.6, ls=":")
    ax.add_patch(Arc(tuple(toe), 0.4, 0.4, theta1=180 - lean, theta2=180, lw=0.8))
    middle = np.radians(180 - lean / 2)
    ax.text(
        toe[0] + 0.225 * np.cos(middle),
        toe[1] + 0.225 * np.sin(middle),
        r"$\alpha$",
        ha="center",
        va="center",
    )


def _draw_arrow(ax: Any, start: Point, vector: Point, name: str, colour: str) -> None:
    head = start + vector
    ax.annotate(
        "",
        head,
        start,
        zorder=8,
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0},
    )
    side = vector / np.linalg.norm(vector)
    ax.annotate(
        name, head, xytext=9 * side, textcoords="offset points", ha="center", va="center", color=colour
    )


def _draw_ground_element(ax: Any, toe: Point) -> None:
    """The spring and the damper of Eq. 14 below a point."""
    top, base, left, right = toe[1] - 0.012, -0.17, toe[0] - 0.025, toe[0] + 0.025
    ax.plot([left, right], [top, top], color=GREY, lw=1)
    ax.plot([left - 0.03, right + 0.03], [base, base], color=GREY, lw=1.5)
    coils = np.linspace(0.2, 0.8, 7)
    side = np.array([0, 1, -1, 1, -1, 1, 0]) * 0.012
    y = top + np.concatenate(([0], coils, [1])) * (base - top)
    ax.plot(left + np.concatenate(([0], side, [0])), y, color=GREY, lw=1)
    middle = (top + base) / 2
    ax.plot([right, right], [top, middle], color=GREY, lw=1)
    ax.plot([right - 0.011, right + 0.011], [middle, middle], color=GREY, lw=1)
    walls, floor = [right - 0.014, right - 0.014, right + 0.014, right + 0.014], middle - 0.02
    ax.plot(walls, [middle + 0.02, floor, floor, middle + 0.02], color=GREY, lw=1)
    ax.plot([right, right], [floor, base], color=GREY, lw=1)
