"""Figures 1 and 3 to 6 of the paper, redrawn from a reproduction (needs matplotlib, extra `plot`).

Figure 1 is the labelled mechanism. Figure 3 has the paths of the hoof, figure 4 the hoof over the stance and
its angle over the cycle, figure 5 the ground reaction force over time, and figure 6 the same force as a
vector along the stance. All show the exact solver; published values are diamonds, with the bars within which
they count as reproduced.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env._output import staged
from hoof_env._plotting import BLUE, GREY, SKY, check_matplotlib
from hoof_env.leg.linkage import BODIES
from hoof_env.paper.drawing import (
    CONDITION_COLOURS,
    FORWARD,
    GAITS,
    HEIGHT,
    POINT_COLOURS,
    PRINT,
    SMALL,
    Point,
    contact_rows,
    draw_arrow,
    draw_ground,
    elastic_cycles,
    half_bar,
    head,
    leg_at,
    legend_below,
    mark_contacts,
    mark_published,
    panel_height,
    shade,
    show_box,
)
from hoof_env.paper.measure import POINTS, Stance, Trace, measure_stance
from hoof_env.paper.mechanism import draw_mechanism
from hoof_env.paper.rows import EXACT, Reproduction
from hoof_env.paper.shapes import find_peaks

HOOVES = 8  # the hoof is drawn at this many equally spaced instants of the cycle


def draw_paths(figure: Any, reproduction: Reproduction) -> None:
    """Figure 3: paths of toe and heel over the cycle, their parts in the ground heavy, with the published
    instants of contact, the leg at mid-stance and the hoof around the cycle; below, the same near the ground.

    Both gaits have the same scale. Above each other are the true shape and a stretched height.
    """
    cycles = elastic_cycles(reproduction)
    boxes = np.array([_extent(reproduction, *cycle) for cycle in cycles.values()])
    boxes[:, 0, 1] = boxes[:, 0, 1].min()
    boxes[:, 1, 1] = boxes[:, 1, 1].max()
    tall = panel_height(*boxes)
    low = 1.0
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
        x = trace[f"{name}_x"]
        y = -trace[f"{name}_penetration"]
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
    low = every[..., 1].min() - 0.05
    high = every[..., 1].max() + 0.05
    box = np.array([(-0.6 * between, low), ((SKETCHES - 0.4) * between, high)])
    tall = panel_height(box, box)
    low = 2.3
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
            x = hoof[:, 0] + place
            y = hoof[:, 1]
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
        t = rows[time]
        value = rows[angle]
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
    t = trace["time"]
    force = trace["normal"]
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
        low = float(rows["cop_x"].min())
        high = float(rows["cop_x"].max())
        room = 0.55 * max(high - low, 0.02)
        top = 1.1 * float(rows["normal"].max())
        ax.set(xlim=(low - room, high + room), ylim=(-0.1 * top, top), title=GAITS[gait])
        ax.set(xlabel=f"centre of pressure, {FORWARD}", ylabel="normal force [N]")
        draw_ground(ax)
        bar = figure.colorbar(arrows, ax=ax, orientation="horizontal", label="time [s]", aspect=30)
        mark_contacts(bar.ax, reproduction, gait, 0.5)


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
