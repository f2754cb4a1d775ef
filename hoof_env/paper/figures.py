"""Figures 1 and 3 to 6 of the paper, redrawn from a reproduction (needs matplotlib, extra `plot`).

Figure 1 is the labelled mechanism. Figure 3 has the paths of the hoof, figure 4 the hoof over the stance and
its angle over the cycle, figure 5 the ground reaction force over time, and figure 6 the same force as a
vector along the stance. All show the exact solver; published values are diamonds, with the bars within which
they count as reproduced.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._output import staged
from hoof_env.errors import HoofEnvError
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import BODIES
from hoof_env.leg.linkage import POINTS as JOINTS
from hoof_env.paper.measure import POINTS, Stance, Trace, measure_stance
from hoof_env.paper.rows import CONDITIONS, EXACT, PublishedRow, Reproduction
from hoof_env.paper.shapes import find_peaks

BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER, GREY, SOIL = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#666666", "#EFE6D8",
)  # fmt: skip
"""Okabe and Ito's colours, told apart by colour-blind readers, a grey and the ground."""

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "svg.hashsalt": "hoof-env",
    "savefig.dpi": 200,
}
"""For pictures on a page."""

SMALL = 7.0  # smallest type [points]
PRINT: dict[Any, Any] = {
    **STYLE,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "sans-serif"],
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
    "svg.fonttype": "none",
    "savefig.dpi": 300,
}
"""For print over two columns; in SVG text stays text."""

WIDTH, HEAD = 6.9, 0.5  # two columns of a journal, height of the lines above the panels [inch]

GAITS = {"walk": "(a) Walking", "run": "(b) Running"}
CONDITION_COLOURS = dict(zip(CONDITIONS, (BLUE, ORANGE), strict=True))
POINT_COLOURS = {"toe": PURPLE, "heel": GREEN}
PHASES = {
    ("heel",): ("#D5EEE5", "heel alone: strike or off"),
    ("toe", "heel"): ("#FBF2D3", "toe and heel: flat or roll-over"),
    ("toe",): ("#F6E4EE", "toe alone: strike or off"),
}
"""Colour and name of the sub-phases of stance, by the points that bear."""

FORWARD = "x forward of O [m]"
HEIGHT = "height above the ground [m]"

Point = NDArray[np.float64]


def leg_at(geometry: Geometry, trace: Trace, t: float) -> dict[str, Point]:
    """World position (x, y) [m] of every named point at the row of a trace nearest to an instant [s]."""
    row = trace[int(np.argmin(np.abs(trace["time"] - t)))]
    frame = FrameMotion(phi=float(row["phi"]), position=(float(row["x"]), float(row["y"])))
    return dict(zip(JOINTS, pose(geometry, float(row["theta"]), frame=frame).points, strict=True))


def elastic_cycles(reproduction: Reproduction) -> dict[str, tuple[Trace, Stance]]:
    """Trace and stance of each gait on elastic ground."""
    traces = {gait: reproduction.traces[gait, "elastic", EXACT] for gait in GAITS}
    return {gait: (trace, measure_stance(trace)) for gait, trace in traces.items()}


def head(figure: Any, height: float, reproduction: Reproduction, title: str, ground: str, note: str) -> None:
    """Make the figure `height` [inch] high and head it: what it shows; that the leg is identified, its
    preset, solver and ground; a note."""
    figure.set_size_inches(WIDTH, height)
    figure.set_layout_engine("constrained", rect=(0, 0, 1, 1 - HEAD / height))
    preset = Path(reproduction.geometry.name).name
    leg = f"Identified leg, not published (preset {preset}); {EXACT} solver; {ground} ground"
    figure.text(0.01, 1 - 0.05 / height, title, va="top", weight="bold")
    for top, text in ((0.2, f"{leg}; travel to the right."), (0.34, note)):
        place = 0.01, 1 - top / height
        figure.text(*place, text, va="top", fontsize=SMALL, color=GREY, parse_math=False)


def panel_height(*boxes: Point) -> float:
    """Height [inch] at which panels of these boxes, lower left and upper right corner [m], as high as each
    other, fill the figure side by side."""
    return (WIDTH - 1.2) / float(sum(across / up for across, up in (high - low for low, high in boxes)))


def show_box(ax: Any, box: Point) -> None:
    """Show a box, lower left and upper right corner [m], in its true shape."""
    ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal")


def legend_below(figure: Any, columns: int) -> None:
    """One legend at the foot of the figure, every label once."""
    entries = {
        label: line for ax in figure.axes for line, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=columns)


def draw_ground(ax: Any) -> None:
    """Level ground y = 0, shaded down to the end of the axes, whose limits stay."""
    low, high = ax.get_ylim()
    ax.axhspan(low - (high - low), 0, color=SOIL, zorder=0, lw=0)
    ax.axhline(0, color=GREY, lw=0.8, zorder=1)
    ax.set_ylim(low, high)


def draw_arrow(ax: Any, start: Any, end: Any, colour: str) -> None:
    look = {"arrowstyle": "-|>", "color": colour, "lw": 1.2, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
    ax.annotate("", end, start, arrowprops=look, zorder=8)


def mark_published(ax: Any, x: Any, y: Any, *, xerr: Any = None, yerr: Any = None) -> None:
    """Published values: one mark in all figures, with the bars within which they count as reproduced."""
    ax.errorbar(
        x, y, yerr, xerr, fmt="D", ms=4.2, mfc="white", mec="black", mew=0.9, ecolor="black",
        elinewidth=0.7, capsize=1.8, capthick=0.7, clip_on=False, zorder=9, label="published",
    )  # fmt: skip


def half_bar(row: PublishedRow) -> float:
    """How far a value may lie from the published one, in the row's unit; 0 where it is only reported."""
    limit = row.bar.limit or 0.0
    return abs(row.value) * limit / 100 if row.bar.measure == "%" else limit


def contact_rows(reproduction: Reproduction, gait: str) -> list[PublishedRow]:
    return [reproduction.published.row(f"{gait}.{name}") for name in ("contact_start", "contact_end")]


def mark_contacts(ax: Any, reproduction: Reproduction, gait: str, y: float) -> None:
    """The published instants of contact on an axis of time [s]."""
    for row in contact_rows(reproduction, gait):
        mark_published(ax, row.value, y, xerr=half_bar(row))


def shade(ax: Any, stance: Stance) -> None:
    """Shade the stance behind curves over time [s], cut where toe or heel enters or leaves the ground."""
    instants = sorted({t for name in POINTS for interval in getattr(stance, name) for t in interval})
    for start, end in pairwise(instants):
        bearing = tuple(n for n in POINTS if any(a <= start and end <= b for a, b in getattr(stance, n)))
        if bearing:
            colour, label = PHASES[bearing]
            ax.axvspan(start, end, fc=colour, lw=0, zorder=0, label=label)


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
NUMBER_AT = {8: 0.75, 10: 0.65, 12: 0.35}  # where on its link a number stands, from the tail; 0.5 elsewhere
NAME_TO = {"C": (1.0, 0.3)}  # the side of a name that cannot stand where its links leave room


def draw_mechanism(figure: Any, reproduction: Reproduction) -> None:
    """Figure 1: the leg in its walking stance: all of it, and its hoof with the forces on the point that
    bears most, slip, penetration and angle; every point named, every link numbered as in Eq. 2."""
    geometry, (trace, _) = reproduction.geometry, elastic_cycles(reproduction)["walk"]
    tip = max(POINTS, key=lambda point: trace[f"{point}_normal"].max())
    row = trace[int(np.argmax(trace[f"{tip}_normal"] * (0.01 + np.abs(trace["hoof_angle"]))))]
    at = leg_at(geometry, trace, float(row["time"]))
    points = np.array(list(at.values()))
    hoof = np.array([at["G"], at[geometry.toe], at[geometry.heel]])
    side = float(np.ptp(hoof, axis=0).max())
    boxes = [
        np.array([np.minimum(points.min(axis=0) - 0.2, (np.inf, -0.2)), points.max(axis=0) + 0.2]),
        np.array([hoof.min(axis=0) - 0.45 * side, hoof.max(axis=0) + np.array([0.65, 0.1]) * side]),
    ]
    head(
        figure, panel_height(*boxes) + 1.7, reproduction,
        "Figure 1. Mechanism of the leg and its contact with the ground", "elastic",
        f"Walking at {row['time']:.3f} s. Links numbered as in Eq. 2.",
    )  # fmt: skip
    axes = figure.subplots(1, 2, width_ratios=[across / up for across, up in np.ptp(boxes, axis=1)])
    sole = {geometry.toe, geometry.heel}
    titles = "(a) the leg", f"(b) its hoof, the {tip} in the ground"
    for ax, box, names, title in zip(axes, boxes, (at.keys() - sole, {"G", *sole}), titles, strict=True):
        show_box(ax, box)
        draw_ground(ax)
        _draw_links(ax, at, close=names == {"G", *sole})
        _name_points(ax, at, names, geometry)
        ax.set(title=title, xlabel=FORWARD, ylabel=HEIGHT)
    _draw_contact(axes[1], at[getattr(geometry, tip)], at[geometry.toe], at[geometry.heel], tip, row, side)
    legend_below(figure, 4)


def _draw_links(ax: Any, at: dict[str, Point], *, close: bool) -> None:
    """All links, numbered: those of the hoof in the close view, the others in that of the whole leg."""
    numbers: dict[str, str] = {}
    for number, body in enumerate(BODIES, start=1):
        numbers[body.role] = f"{numbers[body.role]}, {number}" if body.role in numbers else str(number)
    for number, body in enumerate(BODIES, start=1):
        tail, tip, colour = at[body.tail], at[body.head], ROLE_COLOURS[body.role]
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
    """Mark every joint, and name some of them on the side that their links leave free."""
    sole = {geometry.toe: "toe", geometry.heel: "heel"}
    for name, point in at.items():
        fixed, fill = name in ("O", "C"), POINT_COLOURS.get(sole.get(name, ""), "white")
        look = {"marker": "^", "ms": 6, "mfc": "black"} if fixed else {"marker": "o", "ms": 4, "mfc": fill}
        ax.plot(*point, mec="black", mew=0.8, zorder=7, **look)
        if name in names:
            ends = [(body.tail, body.head) for body in BODIES if name in (body.tail, body.head)]
            others = np.array([at[two if one == name else one] - point for one, two in ends])
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
    """Forces, slip, penetration and hoof angle of the point that presses; the hoof is `side` [m] large."""
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
    length = float(np.linalg.norm(heel - toe))
    turn = np.linspace(np.pi - row["hoof_angle"], np.pi, 30)
    arc = toe + 0.75 * length * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ax.plot([toe[0] - length, toe[0]], [toe[1]] * 2, color="black", lw=0.6, ls=":")
    ax.plot(*arc.T, color="black", lw=0.8)
    ax.annotate(r"$\alpha$", arc[-1], (-3, -8), textcoords="offset points", va="center")


HOOVES = 8  # the hoof is drawn at this many equally spaced instants of the cycle


def draw_paths(figure: Any, reproduction: Reproduction) -> None:
    """Figure 3: paths of toe and heel over the cycle, their parts in the ground heavy, with the published
    instants of contact, the leg at mid-stance and the hoof around the cycle; below, the same near the ground.

    Both gaits have the same scale. Above each other are the true shape and a stretched height.
    """
    cycles = elastic_cycles(reproduction)
    boxes = np.array([_extent(reproduction, *cycle) for cycle in cycles.values()])
    boxes[:, 0, 1], boxes[:, 1, 1] = boxes[:, 0, 1].min(), boxes[:, 1, 1].max()
    tall, low = panel_height(*boxes), 1.0
    head(
        figure, tall + low + 1.9, reproduction, "Figure 3. Paths of the hoof", "elastic",
        "Marks lie on the paths at the published instants of contact. Below, heights are stretched.",
    )  # fmt: skip
    axes = figure.subplots(
        2, 2, sharex="col", height_ratios=(tall, low), width_ratios=np.ptp(boxes[..., 0], axis=1)
    )
    for (gait, (trace, stance)), (whole, near), box in zip(cycles.items(), axes.T, boxes, strict=True):
        contacts = _published_contacts(reproduction, gait, trace, stance)
        deepest = max(trace["toe_penetration"].max(), trace["heel_penetration"].max())
        show_box(whole, box)
        whole.set(title=GAITS[gait], ylabel=HEIGHT)
        near.set(xlabel=FORWARD, ylabel="height [m]")
        near.set_ylim(-1.15 * deepest, max(0.6 * deepest, 1.15 * contacts[:, 1].max()))
        _draw_leg(whole, reproduction, trace, stance)
        for ax in (whole, near):
            draw_ground(ax)
            _draw_hoof_paths(ax, trace)
            mark_published(ax, *contacts.T)
    legend_below(figure, 4)


def _extent(reproduction: Reproduction, trace: Trace, stance: Stance) -> Point:
    """Lower left and upper right corner [m] of what is drawn of a gait, with a margin."""
    leg = leg_at(reproduction.geometry, trace, stance.middle).values()
    hooves = [leg_at(reproduction.geometry, trace, t)["G"] for t in _instants(stance)]
    paths = [np.stack([trace[f"{name}_x"], -trace[f"{name}_penetration"]], 1) for name in POINTS]
    shown = np.concatenate([*paths, np.array([*leg, *hooves])])
    return np.array([shown.min(axis=0) - 0.1, shown.max(axis=0) + 0.1])


def _instants(stance: Stance) -> Point:
    return np.arange(HOOVES) / HOOVES * stance.period


def _draw_leg(ax: Any, reproduction: Reproduction, trace: Trace, stance: Stance) -> None:
    at = leg_at(reproduction.geometry, trace, stance.middle)
    for body in BODIES:
        line = np.array([at[body.tail], at[body.head]])
        ax.plot(*line.T, color=GREY, lw=0.9, label="leg at mid-stance", zorder=6, solid_capstyle="round")
    for name in ("O", "C"):
        ax.plot(*at[name], "^", ms=4.5, mfc="black", mec="black", zorder=7)
        ax.annotate(name, at[name], (-7, 0), textcoords="offset points", ha="center", va="center")
    for t in _instants(stance):
        at = leg_at(reproduction.geometry, trace, t)
        bears = stance.start <= t <= stance.end
        colour, label = (SKY, "hoof in stance") if bears else ("#CCCCCC", "hoof in swing")
        corners = np.array([at[corner] for corner in "GJI"])
        ax.fill(*corners.T, fc=colour, ec=GREY, alpha=0.6, lw=0.4, zorder=3, label=label)


def _draw_hoof_paths(ax: Any, trace: Trace) -> None:
    for name, colour in POINT_COLOURS.items():
        x, y = trace[f"{name}_x"], -trace[f"{name}_penetration"]
        ax.plot(x, y, color=colour, lw=0.9, label=f"path of the {name}", zorder=4)
        ground = np.where(y < 0, y, np.nan)
        ax.plot(x, ground, color=colour, lw=2.4, label=f"{name} in the ground", zorder=5)
        k = int(np.argmax(y))  # far from the ground: an arrow shows which way round
        tip = min(k + len(x) // 200, len(x) - 1)
        draw_arrow(ax, (x[k], y[k]), (x[tip], y[tip]), colour)


def _published_contacts(reproduction: Reproduction, gait: str, trace: Trace, stance: Stance) -> Point:
    """Where the points that touch first and leave last are at the published instants of contact [m]."""
    places = []
    touching = stance.first_points, stance.last_points
    for row, points in zip(contact_rows(reproduction, gait), touching, strict=True):
        for name in sorted(points):
            columns = trace[f"{name}_x"], -trace[f"{name}_penetration"]
            places.append([np.interp(row.value, trace["time"], column) for column in columns])
    return np.array(places)


SKETCHES = 7  # the hoof is sketched at this many equally spaced instants of the stance, its ends included


def draw_angles(figure: Any, reproduction: Reproduction) -> None:
    """Figure 4: above, the hoof over the stance at one scale for both gaits; below, its angle over the cycle
    with the published angles at their published times, and the sub-phases shaded.

    An angle printed without a time is marked at the middle of the time in which toe and heel both bear.
    """
    changed = [
        f"{row.printed:g}° in print is read as {row.value:+g}°.".replace("-", "\N{MINUS SIGN}")
        for row in reproduction.published.rows
        if row.unit == "deg" and row.printed != row.value
    ]
    cycles = elastic_cycles(reproduction)
    hooves = {gait: _hooves(reproduction, *cycle) for gait, cycle in cycles.items()}
    every = np.concatenate(list(hooves.values()))
    between = 1.1 * float(np.ptp(every[..., 0], axis=1).max())
    low, high = every[..., 1].min() - 0.05, every[..., 1].max() + 0.05
    box = np.array([(-0.6 * between, low), ((SKETCHES - 0.4) * between, high)])
    tall, low = panel_height(box, box), 2.3
    head(
        figure, tall + low + 2.1, reproduction, "Figure 4. Hoof angle over the cycle", "elastic",
        " ".join(["Bars: margin of each row; flat has no time in print.", *changed]),
    )  # fmt: skip
    axes = figure.subplots(2, 2, height_ratios=(tall, low))
    for (gait, (trace, stance)), (sketch, angle) in zip(cycles.items(), axes.T, strict=True):
        times = np.linspace(stance.start, stance.end, SKETCHES)
        places = between * np.arange(SKETCHES)
        sketch.set(title=GAITS[gait], xlabel="time [s]", ylabel="height [m]")
        sketch.set_xticks(places, [f"{t:.3f}" for t in times])
        show_box(sketch, box)
        draw_ground(sketch)
        for place, hoof in zip(places, hooves[gait], strict=True):
            x, y = hoof[:, 0] + place, hoof[:, 1]
            sketch.fill(x, y, fc=SKY, ec=BLUE, lw=0.7, alpha=0.9, zorder=3)
            for corner, (name, colour) in enumerate(POINT_COLOURS.items(), start=1):
                sketch.plot(x[corner], y[corner], "o", color=colour, ms=3, label=name, zorder=4, ls="none")
        shade(angle, stance)
        angle.axhline(0, color=GREY, lw=0.6, zorder=1)
        angle.plot(trace["time"], np.degrees(trace["hoof_angle"]), color=BLUE, lw=1.3, label="simulated")
        angle.set(xlim=(0, stance.period), xlabel="time [s]", ylabel="hoof angle, heel up positive [deg]")
        _mark_angles(angle, reproduction, gait, stance)
    legend_below(figure, 4)


def _hooves(reproduction: Reproduction, trace: Trace, stance: Stance) -> Point:
    """Corners G, toe, heel at the instants of the sketches, x from the middle of each hoof,
    shape (SKETCHES, 3, 2) [m]."""
    names = "G", reproduction.geometry.toe, reproduction.geometry.heel
    legs = [leg_at(reproduction.geometry, trace, t) for t in np.linspace(stance.start, stance.end, SKETCHES)]
    hooves = np.array([[at[name] for name in names] for at in legs])
    x = hooves[..., 0]
    x -= (x.min(axis=1, keepdims=True) + x.max(axis=1, keepdims=True)) / 2
    return hooves


def _mark_angles(ax: Any, reproduction: Reproduction, gait: str, stance: Stance) -> None:
    rows = {row.id.removeprefix(f"{gait}."): row for row in reproduction.published.rows if row.gait == gait}
    for time, angle in (("contact_start", "angle_contact"), ("contact_end", "angle_liftoff")):
        t, value = rows[time], rows[angle]
        mark_published(ax, t.value, value.value, xerr=half_bar(t), yerr=half_bar(value))
    if "angle_flat" in rows:
        middle = sum(stance.double) / 2 if stance.double else stance.middle
        mark_published(ax, middle, rows["angle_flat"].value, yerr=half_bar(rows["angle_flat"]))


DASHED = (0, (3, 2))


def draw_forces(figure: Any, reproduction: Reproduction) -> None:
    """Figure 5: force of the ground over time in the four conditions, with sub-phases, simulated peaks,
    published peaks at the times of the simulated ones, published instants of contact on the time axis; means
    over the cycle at the side."""
    head(
        figure, 4.2, reproduction, "Figure 5. Ground reaction force", "elastic and inelastic",
        "Bars: margin of each row. Peaks have no time in print; marks stand at that of the simulated one.",
    )  # fmt: skip
    axes = figure.subplots(1, 4, width_ratios=(9, 2, 9, 2)).reshape(2, 2)
    for (gait, (_, stance)), (ax, mean) in zip(elastic_cycles(reproduction).items(), axes, strict=True):
        shade(ax, stance)
        for place, (condition, colour) in enumerate(CONDITION_COLOURS.items()):
            trace = reproduction.traces[gait, condition, EXACT]
            _draw_curve(ax, trace, condition, colour)
            measured = measure_stance(trace)
            peak = reproduction.published.row(f"{gait}.peak_{condition}")
            mark_published(ax, measured.peak_time, peak.value, yerr=half_bar(peak))
            mean.plot([place - 0.45, place + 0.45], [measured.mean] * 2, color=colour, lw=2)
            row = reproduction.published.row(f"{gait}.mean_{condition}")
            mark_published(mean, place, row.value, yerr=half_bar(row))
        ax.plot([], [], color=GREY, lw=0.7, ls=DASHED, label="resultant")
        ax.plot([], [], "o", color=GREY, ms=2.8, label="simulated peak")
        ax.plot([], [], color=GREY, lw=2, label="simulated mean")
        mark_contacts(ax, reproduction, gait, 0)
        room = 0.1 * (stance.end - stance.start)
        ax.set(xlim=(stance.start - room, stance.end + room), xlabel="time [s]", title=GAITS[gait])
        ax.set_ylim(0, None)
        ax.set_ylabel("force of the ground on the hoof [N]")
        mean.set(xlim=(-0.7, 1.7), ylim=ax.get_ylim(), xticks=[], yticks=[])
        mean.set_xlabel("mean over\nthe cycle", fontsize=SMALL)
        mean.spines["left"].set_visible(False)
    legend_below(figure, 3)


def _draw_curve(ax: Any, trace: Trace, condition: str, colour: str) -> None:
    t, force = trace["time"], trace["normal"]
    ax.plot(t, force, color=colour, lw=1.4, label=f"{condition}, normal force", zorder=4)
    ax.plot(t, trace["grf"], color=colour, lw=0.7, ls=DASHED, zorder=3)
    peaks = find_peaks(force)
    ax.plot(t[peaks], force[peaks], "o", color=colour, ms=2.8, zorder=5)


ARROWS = 36  # equal parts of the stance; an arrow in the middle of each


def draw_vectors(figure: Any, reproduction: Reproduction) -> None:
    """Figure 6: the ground reaction force at the centre of pressure at equal steps of the stance, elastic,
    directions true, its normal part on the axis; below, the colours' times and the published contacts."""
    head(
        figure, 3.7, reproduction, "Figure 6. Ground reaction force on the leg along the stance", "elastic",
        "A vector that leans forward propels, one that leans back brakes. Marks: published contact times.",
    )  # fmt: skip
    axes = figure.subplots(1, 2)
    for (gait, (trace, stance)), ax in zip(elastic_cycles(reproduction).items(), axes, strict=True):
        edges = np.linspace(stance.start, stance.end, ARROWS + 1)
        rows = trace[np.searchsorted(trace["time"], (edges[1:] + edges[:-1]) / 2)]
        rows = rows[rows["normal"] > 0]
        times = [stance.start, stance.end, *(row.value for row in contact_rows(reproduction, gait))]
        late = max(times) + 0.1 * (max(times) - min(times))  # the palest colours are hard to see on white
        arrows = ax.quiver(
            rows["cop_x"], np.zeros(len(rows)), rows["friction"], rows["normal"], rows["time"],
            angles="uv", scale_units="y", scale=1, units="inches", width=0.018, cmap="viridis",
            clim=(min(times), late), zorder=3, headwidth=4, headlength=5, headaxislength=4.5,
        )  # fmt: skip
        low, high = float(rows["cop_x"].min()), float(rows["cop_x"].max())
        room = 0.55 * max(high - low, 0.02)
        top = 1.1 * float(rows["normal"].max())
        ax.set(xlim=(low - room, high + room), ylim=(-0.1 * top, top), title=GAITS[gait])
        ax.set(xlabel=f"centre of pressure, {FORWARD}", ylabel="normal force [N]")
        draw_ground(ax)
        bar = figure.colorbar(arrows, ax=ax, orientation="horizontal", label="time [s]", aspect=30)
        mark_contacts(bar.ax, reproduction, gait, 0.5)


def check_matplotlib() -> None:
    """Raise `HoofEnvError` with the way out unless matplotlib can be imported."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise HoofEnvError(
            'figures need matplotlib: pip install "hoof-env[plot]", or leave them out with --no-figures'
        ) from None


DRAWINGS: dict[str, Callable[[Any, Reproduction], None]] = {
    "figure1": draw_mechanism,
    "figure3": draw_paths,
    "figure4": draw_angles,
    "figure5": draw_forces,
    "figure6": draw_vectors,
}


def draw_all(reproduction: Reproduction, folder: Path | str) -> list[Path]:
    """Draw figures 1 and 3 to 6 as PNG and SVG, the same bytes for the same reproduction; returns the
    paths."""
    check_matplotlib()
    from matplotlib import style
    from matplotlib.figure import Figure

    folder = Path(folder)
    paths = []
    with staged(folder) as stage, style.context(["default", PRINT]):
        for name, draw in DRAWINGS.items():
            figure = Figure()
            draw(figure, reproduction)
            for file, metadata in ((f"{name}.png", {}), (f"{name}.svg", {"Date": None})):
                figure.savefig(stage / file, metadata=metadata)
                paths.append(folder / file)
    return paths
