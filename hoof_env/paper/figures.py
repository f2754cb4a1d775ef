"""Figures 1 and 3 to 6 of the paper, redrawn from a reproduction (needs matplotlib, extra `plot`).

Figure 1 is the labelled mechanism. Figure 3 has the paths of the hoof, figure 4 the hoof over the stance and
its angle over the cycle, figure 5 the ground reaction force over time, and figure 6 that force as a vector
along the stance. All show the exact solver; published values are diamonds, with the bars within which
they count as reproduced.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env._output import staged
from hoof_env._plotting import BLUE, GREY, SKY, check_matplotlib
from hoof_env.leg.mechanism_list import PAPER
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

HOOVES = 8
"""Number of equally spaced instants of the cycle at which figure 3 has the hoof."""


def draw_paths(figure: Any, reproduction: Reproduction) -> None:
    """Draw figure 3: paths of toe and heel over the cycle, thick in the ground, with the published instants
    of contact, the leg at mid-stance and the hoof around the cycle.

    Both gaits have the same scale. The upper row has the true shape, the lower row heights near the ground,
    stretched.
    """
    cycles = elastic_cycles(reproduction)
    boxes = np.array([_extent(reproduction, *cycle) for cycle in cycles.values()])
    # The same heights in both panels, so that their scales are the same.
    boxes[:, 0, 1] = boxes[:, 0, 1].min()
    boxes[:, 1, 1] = boxes[:, 1, 1].max()
    tall = panel_height(*boxes)
    low = 1.0
    note = "Marks lie on the paths at the published instants of contact. Below, heights are stretched."
    head(figure, tall + low + 1.9, reproduction, "Figure 3. Paths of the hoof", "elastic", note)
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
    """Return lower left and upper right corner of a gait's drawing, with a margin, shape (2, 2) [m]."""
    leg = leg_at(reproduction.geometry, trace, stance.middle).values()
    hooves = [leg_at(reproduction.geometry, trace, t)["G"] for t in _instants(stance)]
    paths = [np.stack([trace[f"{name}_x"], -trace[f"{name}_penetration"]], 1) for name in POINTS]
    shown = np.concatenate([*paths, np.array([*leg, *hooves])])
    return np.array([shown.min(axis=0) - 0.1, shown.max(axis=0) + 0.1])


def _instants(stance: Stance) -> Point:
    """Return the instants of the cycle at which the hoof is drawn, shape (HOOVES,) [s]."""
    return np.arange(HOOVES) / HOOVES * stance.period


def _draw_leg(ax: Any, reproduction: Reproduction, trace: Trace, stance: Stance) -> None:
    """Draw the leg at mid-stance, and the hoof around the cycle."""
    at = leg_at(reproduction.geometry, trace, stance.middle)
    for body in PAPER.bodies:
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
    """Draw the paths of toe and heel, thick in the ground, with an arrow in the direction of motion."""
    for name, colour in POINT_COLOURS.items():
        x = trace[f"{name}_x"]
        y = -trace[f"{name}_penetration"]
        ax.plot(x, y, color=colour, lw=0.9, label=f"path of the {name}", zorder=4)
        ground = np.where(y < 0, y, np.nan)
        ax.plot(x, ground, color=colour, lw=2.4, label=f"{name} in the ground", zorder=5)
        # The arrow is at the highest point, where it does not hide the ground.
        k = int(np.argmax(y))
        tip = min(k + len(x) // 200, len(x) - 1)
        draw_arrow(ax, (x[k], y[k]), (x[tip], y[tip]), colour)


def _published_contacts(reproduction: Reproduction, gait: str, trace: Trace, stance: Stance) -> Point:
    """Return the positions (x, y) at the published instants of contact, shape (n, 2) [m]: of the points that
    touch first at the first contact, and of the points that leave last at the last."""
    places = []
    touching = (stance.first_points, stance.last_points)
    for row, points in zip(contact_rows(reproduction, gait), touching, strict=True):
        for name in sorted(points):
            columns = trace[f"{name}_x"], -trace[f"{name}_penetration"]
            places.append([np.interp(row.value, trace["time"], column) for column in columns])
    return np.array(places)


SKETCHES = 7
"""Number of equally spaced instants of the stance, its ends included, at which figure 4 has the hoof."""


def draw_angles(figure: Any, reproduction: Reproduction) -> None:
    """Draw figure 4: above, the hoof over the stance at one scale for both gaits; below, its angle over the
    cycle with the published angles at their published times, and the sub-phases shaded.

    An angle that is printed without a time is marked at the middle of the time in which toe and heel both
    bear.
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
    note = " ".join(["Bars: margin of each row; flat has no time in print.", *changed])
    head(figure, tall + low + 2.1, reproduction, "Figure 4. Hoof angle over the cycle", "elastic", note)
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
            # Corner 0 is G; toe and heel follow in the order of POINT_COLOURS.
            for corner, (name, colour) in enumerate(POINT_COLOURS.items(), start=1):
                sketch.plot(x[corner], y[corner], "o", color=colour, ms=3, label=name, zorder=4, ls="none")
        shade(angle, stance)
        angle.axhline(0, color=GREY, lw=0.6, zorder=1)
        angle.plot(trace["time"], np.degrees(trace["hoof_angle"]), color=BLUE, lw=1.3, label="simulated")
        angle.set(xlim=(0, stance.period), xlabel="time [s]", ylabel="hoof angle, heel up positive [deg]")
        _mark_angles(angle, reproduction, gait, stance)
    legend_below(figure, 4)


def _hooves(reproduction: Reproduction, trace: Trace, stance: Stance) -> Point:
    """Return the corners G, toe and heel of the hoof at the instants of the sketches, shape (SKETCHES, 3, 2)
    [m]; x is measured from the middle of each hoof."""
    names = ("G", *reproduction.geometry.corners)
    legs = [leg_at(reproduction.geometry, trace, t) for t in np.linspace(stance.start, stance.end, SKETCHES)]
    hooves = np.array([[at[name] for name in names] for at in legs])
    x = hooves[..., 0]
    x -= (x.min(axis=1, keepdims=True) + x.max(axis=1, keepdims=True)) / 2
    return hooves


def _mark_angles(ax: Any, reproduction: Reproduction, gait: str, stance: Stance) -> None:
    """Draw the published angles of a gait over its axis of time [s]."""
    rows = {row.id.removeprefix(f"{gait}."): row for row in reproduction.published.rows if row.gait == gait}
    for time, angle in (("contact_start", "angle_contact"), ("contact_end", "angle_liftoff")):
        t = rows[time]
        value = rows[angle]
        mark_published(ax, t.value, value.value, xerr=half_bar(t), yerr=half_bar(value))
    if "angle_flat" in rows:
        # The paper gives no time for the flat hoof.
        middle = sum(stance.double) / 2 if stance.double else stance.middle
        mark_published(ax, middle, rows["angle_flat"].value, yerr=half_bar(rows["angle_flat"]))


DASHED = (0, (3, 2))
"""Dashes of the resultant's lines."""


def draw_forces(figure: Any, reproduction: Reproduction) -> None:
    """Draw figure 5: force of the ground over time in the four conditions, with sub-phases, simulated peaks,
    published peaks at the times of the simulated ones, and published instants of contact on the time axis;
    means over the cycle are at the side."""
    note = "Bars: margin of each determinable row. Peaks have no time in print: marks at the simulated ones."
    head(figure, 4.2, reproduction, "Figure 5. Ground reaction force", "elastic and inelastic", note)
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
        # Empty lines, for entries of the legend without a condition's colour.
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
    """Draw normal force, its peaks and the resultant over time [s]."""
    t = trace["time"]
    force = trace["normal"]
    ax.plot(t, force, color=colour, lw=1.4, label=f"{condition}, normal force", zorder=4)
    ax.plot(t, trace["grf"], color=colour, lw=0.7, ls=DASHED, zorder=3)
    peaks = find_peaks(force)
    ax.plot(t[peaks], force[peaks], "o", color=colour, ms=2.8, zorder=5)


ARROWS = 36
"""Number of equal parts of the stance; figure 6 has an arrow in the middle of each."""


def draw_vectors(figure: Any, reproduction: Reproduction) -> None:
    """Draw figure 6: the ground reaction force on elastic ground at the centre of pressure at equal steps of
    the stance, with true directions and its normal part on the axis; below, times by colour and the published
    contacts."""
    title = "Figure 6. Ground reaction force on the leg along the stance"
    note = "A vector that leans forward propels, one that leans back brakes. Marks: published contact times."
    head(figure, 3.7, reproduction, title, "elastic", note)
    axes = figure.subplots(1, 2)
    for (gait, (trace, stance)), ax in zip(elastic_cycles(reproduction).items(), axes, strict=True):
        edges = np.linspace(stance.start, stance.end, ARROWS + 1)
        rows = trace[np.searchsorted(trace["time"], (edges[1:] + edges[:-1]) / 2)]
        rows = rows[rows["normal"] > 0]
        times = [stance.start, stance.end, *(row.value for row in contact_rows(reproduction, gait))]
        # The scale of colours goes on a little, as its palest ones are hard to see on white.
        late = max(times) + 0.1 * (max(times) - min(times))
        arrows = ax.quiver(
            rows["cop_x"],
            np.zeros(len(rows)),
            rows["friction"],
            rows["normal"],
            rows["time"],
            # In units of the y axis, a newton of friction is as long as one of the normal force.
            angles="uv",
            scale_units="y",
            scale=1,
            cmap="viridis",
            clim=(min(times), late),
            zorder=3,
            units="inches",
            width=0.018,
            headwidth=4,
            headlength=5,
            headaxislength=4.5,
        )
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
"""Functions that draw the figures, by the names of their files."""


def draw_all(reproduction: Reproduction, folder: Path | str) -> list[Path]:
    """Draw figures 1 and 3 to 6 as PNG and SVG into `folder`, with the same bytes for the same reproduction;
    return the paths."""
    check_matplotlib()
    from matplotlib import style
    from matplotlib.figure import Figure

    folder = Path(folder)
    paths = []
    with staged(folder) as stage, style.context(["default", PRINT]):
        for name, draw in DRAWINGS.items():
            figure = Figure()
            draw(figure, reproduction)
            # Hardly compressed, as it is written again.
            figure.savefig(stage / f"{name}.png", pil_kwargs={"compress_level": 1})
            _reduce_colours(stage / f"{name}.png")
            # Without the date, which would differ each time.
            figure.savefig(stage / f"{name}.svg", metadata={"Date": None})
            paths += [folder / f"{name}.png", folder / f"{name}.svg"]
    return paths


def _reduce_colours(path: Path) -> None:
    """Write a PNG again with a palette of 128 colours, a third of its size."""
    from PIL import Image

    with Image.open(path) as picture:
        reduced = picture.convert("RGB").quantize(128, dither=Image.Dither.NONE)
    reduced.save(path, optimize=True)
