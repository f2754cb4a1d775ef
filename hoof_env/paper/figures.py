"""Figures 1 and 3 to 6 of the paper, redrawn from a reproduction (needs matplotlib, extra `plot`).

Figure 3 has the paths of the hoof, figure 4 the hoof over the stance and its angle over the cycle, figure 5
the ground reaction force over time, and figure 6 the same force as a vector along the stance.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._output import staged
from hoof_env.errors import HoofEnvError
from hoof_env.leg.linkage import BODIES
from hoof_env.paper.figure_mechanism import draw_mechanism
from hoof_env.paper.figure_style import (
    BLUE,
    CONDITION_COLOURS,
    GAITS,
    GAP,
    GREY,
    HEAD,
    HEEL,
    INCH,
    LEFT,
    PRINT,
    SKY,
    SMALL,
    SOLVER,
    STRIP,
    TOE,
    WIDTH,
    draw_arrow,
    draw_ground,
    elastic_cycles,
    half_bar,
    head,
    leg_at,
    legend_below,
    mark_contacts,
    mark_published,
    name_height,
    name_phases,
    panel,
    panel_title,
    shade,
    sub_phases,
    time_limits,
    write,
)
from hoof_env.paper.measure import Stance, Trace, measure_stance
from hoof_env.paper.rows import Reproduction
from hoof_env.paper.shapes import find_peaks

HOOVES = 8  # the hoof is drawn at this many equally spaced instants of the cycle
TALLEST, NEAR = 110.0, 26.0  # most height for the whole leg, height near the ground [mm]


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
    head(
        figure, HEAD + 5 + tall + 4 + NEAR + 19, reproduction, "Figure 3. Paths of the hoof", "elastic",
        "Marks lie on the paths at the published instants of contact. Below, heights are stretched.",
    )  # fmt: skip
    left = LEFT
    for letter, (gait, (trace, stance)) in zip("ab", cycles.items(), strict=True):
        width = room * spans[gait] / sum(spans.values())
        middle = boxes[gait][:, 0].mean()
        across = (middle - width / scale / 2, middle + width / scale / 2)
        panel_title(figure, left, f"({letter}) {GAITS[gait]}", width)
        whole = panel(
            figure, left, HEAD + 5, width, tall, xlim=across, ylim=(low, low + rise), xticklabels=[]
        )
        near = panel(
            figure, left, HEAD + 9 + tall, width, NEAR, xlim=across, xlabel="x forward of crank centre O [m]"
        )
        contacts = _published_contacts(reproduction, gait, trace, stance)
        deepest = max(trace["toe_penetration"].max(), trace["heel_penetration"].max())
        near.set_ylim(-1.15 * deepest, max(0.6 * deepest, 1.15 * contacts[:, 1].max()))
        near.locator_params(axis="y", nbins=4)
        _draw_leg(whole, leg_at(reproduction, trace, stance.middle))
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
    leg = leg_at(reproduction, trace, stance.middle).values()
    hooves = [leg_at(reproduction, trace, t)["G"] for t in _instants(stance)]
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
        at = leg_at(reproduction, trace, t)
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


SKETCHES = 7  # the hoof is sketched at this many equally spaced instants of the stance, its ends included
TALLEST_SKETCH, ANGLE = 24.0, 52.0  # most height for the sketches, height of the angle [mm]


def draw_angles(figure: Any, reproduction: Reproduction) -> None:
    """Figure 4: above, the hoof over the stance at one scale for both gaits, with the sub-phases; below, its
    angle over the cycle with the published angles at their published times, and the sub-phases shaded.

    An angle printed without a time is marked at the middle of the time in which toe and heel both bear.
    """
    cycles = elastic_cycles(reproduction)
    width = (WIDTH - LEFT - GAP - 3) / 2
    hooves = {gait: _sketch_shapes(reproduction, *cycle) for gait, cycle in cycles.items()}
    extent = np.concatenate(list(hooves.values()))
    scale = min(
        0.92 * width / SKETCHES / np.ptp(extent[..., 0], axis=1).max(),
        TALLEST_SKETCH / np.ptp(extent[..., 1]),
    )
    span = scale * extent[..., 1].min() - 5, scale * extent[..., 1].max() + 1.5  # around the ground [mm]
    tall = span[1] - span[0]
    head(
        figure, HEAD + 23 + tall + ANGLE + 14, reproduction, "Figure 4. Hoof angle over the cycle", "elastic",
        _readings(reproduction),
    )  # fmt: skip
    for place, (gait, (trace, stance)) in enumerate(cycles.items()):
        left, top = LEFT + place * (width + GAP), HEAD
        phases = sub_phases(stance, gait)
        panel_title(figure, left, f"({'ab'[place]}) {GAITS[gait]}", width)
        half = (stance.end - stance.start) / (SKETCHES - 1) / 2
        limits = stance.start - half, stance.end + half
        name_phases(figure, left, top + 8, width, limits, phases)
        ax = panel(figure, left, top + 8 + STRIP, width, tall, xlim=limits, ylim=span)
        _draw_sketches(ax, hooves[gait] * scale, stance, width)
        _draw_scale(ax, scale, width)
        angle = panel(figure, left, top + 23 + tall, width, ANGLE, xlim=(0, stance.period))
        shade(angle, phases)
        angle.axhline(0, color=GREY, lw=0.6, zorder=1)
        angle.plot(
            trace["time"], np.degrees(trace["hoof_angle"]), color=BLUE, lw=1.3, label="simulated", zorder=3
        )
        _mark_angles(angle, reproduction, gait, stance)
        angle.set(xlabel="time [s]")
        if not place:
            name_height(angle, "hoof angle, heel up positive [deg]", width)
            axes = angle, ax
    legend_below(figure, *axes, columns=5)


def _readings(reproduction: Reproduction) -> str:
    """Which printed angles are read as something else."""
    changed = [
        f"{row.printed:g}° in print is read as {row.value:+g}°.".replace("-", "\N{MINUS SIGN}")
        for row in reproduction.published.rows
        if row.unit == "deg" and row.printed != row.value
    ]
    phases = "Flat, roll-over: toe and heel in the ground."
    return " ".join([phases, "Bars: margin of each row; flat has no time in print.", *changed])


def _sketch_shapes(reproduction: Reproduction, trace: Any, stance: Stance) -> NDArray[np.float64]:
    """Corners G, toe, heel at the instants of the sketches, x from the middle of each hoof,
    shape (SKETCHES, 3, 2) [m]."""
    geometry = reproduction.geometry
    shapes = []
    for t in np.linspace(stance.start, stance.end, SKETCHES):
        at = leg_at(reproduction, trace, t)
        shape = np.array([at["G"], at[geometry.toe], at[geometry.heel]])
        shape[:, 0] -= (shape[:, 0].min() + shape[:, 0].max()) / 2
        shapes.append(shape)
    return np.array(shapes)


def _draw_sketches(ax: Any, shapes: NDArray[np.float64], stance: Stance, width: float) -> None:
    """Sketches [mm] in a panel `width` [mm] whose horizontal axis is time."""
    instants = np.linspace(stance.start, stance.end, SKETCHES)
    second = width / np.ptp(ax.get_xlim())  # [mm/s]
    ax.set(yticks=[], xticks=instants, xlabel="time [s]")
    ax.set_xticklabels([f"{t:.3f}" for t in instants])
    ax.spines["left"].set_visible(False)
    draw_ground(ax, ax.get_ylim()[0])
    for t, shape in zip(instants, shapes, strict=True):
        x, y = t + shape[:, 0] / second, shape[:, 1]
        ax.fill(x, y, fc=SKY, ec=BLUE, lw=0.7, alpha=0.9, zorder=3)
        for corner, colour, label in ((1, TOE, "toe"), (2, HEEL, "heel")):
            ax.plot(x[corner], y[corner], "o", color=colour, ms=3, label=label, zorder=4, ls="none")


def _draw_scale(ax: Any, scale: float, width: float) -> None:
    """A bar of 0.2 m in the lower left corner; `scale` in mm/m."""
    left, right = ax.get_xlim()
    second, y = width / (right - left), ax.get_ylim()[0] + 2
    start, end = left + 1.5 / second, left + (1.5 + 0.2 * scale) / second
    ax.plot([start, end], [y, y], color="black", lw=1.2)
    ax.text(end + 1 / second, y, "0.2 m", fontsize=SMALL, va="center")


def _mark_angles(ax: Any, reproduction: Reproduction, gait: str, stance: Stance) -> None:
    rows = {row.id.removeprefix(f"{gait}."): row for row in reproduction.published.rows if row.gait == gait}
    for time, angle in (("contact_start", "angle_contact"), ("contact_end", "angle_liftoff")):
        t, value = rows[time], rows[angle]
        mark_published(ax, t.value, value.value, xerr=half_bar(t), yerr=half_bar(value))
    if "angle_flat" in rows:
        middle = sum(stance.double) / 2 if stance.double else stance.middle
        mark_published(ax, middle, rows["angle_flat"].value, yerr=half_bar(rows["angle_flat"]))


MEAN, FORCE, CONTACT = 12.0, 56.0, 7.0  # width of the means, height of forces and contacts [mm]
DASHED = (0, (3, 2))


def draw_forces(figure: Any, reproduction: Reproduction) -> None:
    """Figure 5: force of the ground over time in the four conditions, with sub-phases, simulated peaks,
    published peaks at the times of the simulated ones, published instants of contact on the time axis; means
    over the cycle at the side; below, when toe and heel are in the ground."""
    width = (WIDTH - LEFT - GAP - 3) / 2
    head(
        figure, HEAD + 10 + FORCE + CONTACT + 23, reproduction,
        "Figure 5. Ground reaction force", "elastic and inelastic",
        "Bars: margin of each row. Peaks have no time in print; marks stand at that of the simulated one.",
    )  # fmt: skip
    for place, gait in enumerate(GAITS):
        left, wide = LEFT + place * (width + GAP), width - MEAN - 1
        stance = measure_stance(reproduction.traces[gait, "elastic", SOLVER])
        phases = sub_phases(stance, gait)
        limits = time_limits(reproduction, gait, stance, 0.1)
        write(figure, left, HEAD, f"({'ab'[place]}) {GAITS[gait]}")
        name_phases(figure, left, HEAD + 8, wide, limits, phases)
        top = HEAD + 8 + STRIP
        ax = panel(figure, left, top, wide, FORCE, xlim=limits)
        shade(ax, phases)
        _draw_curves(ax, reproduction, gait)
        _explain(ax)
        mark_contacts(ax, reproduction, gait, 0)
        ax.set_ylim(0, None)
        ax.tick_params(labelbottom=False)
        mean = panel(figure, left + wide + 1, top, MEAN, FORCE, ylim=ax.get_ylim(), xlim=(-0.6, 1.6))
        _draw_means(mean, reproduction, gait)
        contact = panel(figure, left, top + FORCE + 3, wide, CONTACT, xlim=limits, xlabel="time [s]")
        _draw_contact(contact, stance)
        if not place:
            name_height(ax, "force of the ground on the hoof [N]", wide)
            axes = ax, mean
    legend_below(figure, *axes, columns=4)


def _draw_curves(ax: Any, reproduction: Reproduction, gait: str) -> None:
    for condition, colour in CONDITION_COLOURS.items():
        trace = reproduction.traces[gait, condition, SOLVER]
        t, force = trace["time"], trace["normal"]
        ax.plot(t, force, color=colour, lw=1.4, label=f"{condition}, normal force", zorder=4)
        ax.plot(t, trace["grf"], color=colour, lw=0.7, ls=DASHED, zorder=3)
        peaks = find_peaks(force)
        ax.plot(t[peaks], force[peaks], "o", color=colour, ms=2.8, zorder=5)
        row = reproduction.published.row(f"{gait}.peak_{condition}")
        mark_published(ax, measure_stance(trace).peak_time, row.value, yerr=half_bar(row))


def _explain(ax: Any) -> None:
    """Entries of the legend for what has the colour of its condition."""
    ax.plot([], [], color=GREY, lw=0.7, ls=DASHED, label="resultant")
    ax.plot([], [], "o", color=GREY, ms=2.8, label="simulated peak")
    ax.plot([], [], color=GREY, lw=2, label="simulated mean")


def _draw_means(ax: Any, reproduction: Reproduction, gait: str) -> None:
    """Simulated means over the cycle as ticks beside the published ones."""
    for place, (condition, colour) in enumerate(CONDITION_COLOURS.items()):
        mean = measure_stance(reproduction.traces[gait, condition, SOLVER]).mean
        ax.plot([place - 0.45, place + 0.45], [mean] * 2, color=colour, lw=2)
        row = reproduction.published.row(f"{gait}.mean_{condition}")
        mark_published(ax, place, row.value, yerr=half_bar(row))
    ax.set(xticks=[], yticks=[], xlabel="mean over\nthe cycle")
    ax.spines["left"].set_visible(False)


def _draw_contact(ax: Any, stance: Stance) -> None:
    """When each point is in the ground."""
    for height, (name, colour) in enumerate((("toe", TOE), ("heel", HEEL))):
        for interval in getattr(stance, name):
            ax.plot(interval, [height] * 2, color=colour, lw=3.5, solid_capstyle="butt")
    ax.set(ylim=(-0.7, 1.7), yticks=[0, 1])
    ax.set_yticklabels(["toe", "heel"])
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)


ARROWS = 36  # equal parts of the stance; an arrow in the middle of each
BRIGHTEST = 1.1 * ARROWS  # end of the colours, beyond the last arrow: the palest are hard to see on white
MARGIN, BETWEEN, HIGH = 5.0, 12.0, 43.0  # margin, room between the gaits, height of the vectors' panel [mm]
LONGEST = 36.0  # length of the longest vector [mm]


def draw_vectors(figure: Any, reproduction: Reproduction) -> None:
    """Figure 6: the ground reaction force at the centre of pressure at equal steps of the stance, elastic,
    lengths to scale and directions true; below, the colours' times, sub-phases, published contact times."""
    width = (WIDTH - 2 * MARGIN - BETWEEN) / 2
    head(
        figure, HEAD + 5 + HIGH + 31, reproduction,
        "Figure 6. Ground reaction force on the leg along the stance", "elastic",
        "A vector that leans forward propels, one that leans back brakes. Marks: published contact times.",
    )  # fmt: skip
    for place, (gait, (trace, stance)) in enumerate(elastic_cycles(reproduction).items()):
        left = MARGIN + place * (width + BETWEEN)
        panel_title(figure, left, f"({'ab'[place]}) {GAITS[gait]}", width)
        ax = panel(figure, left, HEAD + 5, width, HIGH, xlabel="centre of pressure, x forward of O [m]")
        edges = np.linspace(stance.start, stance.end, ARROWS + 1)
        _draw_arrows(ax, trace, (edges[1:] + edges[:-1]) / 2, width)
        limits = time_limits(reproduction, gait, stance, 0.03)
        top = HEAD + 5 + HIGH + 17
        name_phases(figure, left + 4, top, width - 8, limits, sub_phases(stance, gait))
        times = panel(figure, left + 4, top + STRIP, width - 8, 3, xlim=limits, yticks=[], xlabel="time [s]")
        times.pcolormesh(
            edges, [0, 1], np.arange(ARROWS)[None], cmap="viridis", vmax=BRIGHTEST, edgecolors="face", lw=0.1
        )
        times.spines["left"].set_visible(False)
        mark_contacts(times, reproduction, gait, 0.5)


def _draw_arrows(ax: Any, trace: NDArray[np.void], times: NDArray[np.float64], width: float) -> None:
    """Vectors at the given times [s] in a panel `width` [mm], coloured by their number."""
    picked = np.searchsorted(trace["time"], times)
    loaded = np.flatnonzero(trace["normal"][picked] > 0)
    rows = trace[picked[loaded]]
    scale = LONGEST / float(rows["grf"].max())  # [mm/N]
    lean = scale * rows["friction"]  # [mm]
    left, right = max(-lean.min(), 0.0) + 13, max(lean.max(), 0.0) + 3
    low, high = float(rows["cop_x"].min()), float(rows["cop_x"].max())
    metre = (width - left - right) / max(high - low, 0.02)  # [mm/m]
    bottom = low - left / metre
    ax.set(xlim=(bottom, bottom + width / metre), ylim=(-5, HIGH - 5), yticks=[])
    ax.spines["left"].set_visible(False)
    draw_ground(ax, -5)
    ax.quiver(
        rows["cop_x"], np.zeros(len(rows)), rows["friction"], rows["normal"], loaded,
        angles="uv", scale_units="inches", scale=INCH / scale, units="inches", width=0.45 / INCH,
        cmap="viridis", clim=(0, BRIGHTEST), zorder=3, headwidth=4, headlength=5, headaxislength=4.5,
    )  # fmt: skip
    force = _round_number(0.4 * LONGEST / scale)
    at = bottom + 2 / metre
    ax.plot([at, at], [2, 2 + scale * force], color="black", lw=1.2)
    ax.text(at + 1 / metre, 2 + scale * force / 2, f"{force:g} N", va="center", fontsize=SMALL)


def _round_number(limit: float) -> float:
    """The largest of 1, 2, 5 times a power of ten up to `limit`."""
    power = 10 ** np.floor(np.log10(limit))
    return float(power * max(step for step in (1, 2, 5) if step * power <= limit))


def check_matplotlib() -> None:
    """Raise `HoofEnvError` with the way out unless matplotlib can be imported."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise HoofEnvError(
            'figures need matplotlib: pip install "hoof-env[plot]", or leave them out with --no-figures'
        ) from None


def draw_all(reproduction: Reproduction, folder: Path | str) -> list[Path]:
    """Draw figures 1 and 3 to 6 as PNG and SVG, the same bytes for the same reproduction; returns the paths.

    Raises:
        HoofEnvError: matplotlib is missing. OutputError: the folder cannot be written.
    """
    check_matplotlib()
    from matplotlib import style
    from matplotlib.figure import Figure

    folder = Path(folder)
    drawings: dict[str, Callable[[Any, Reproduction], None]] = {
        "figure1": draw_mechanism,
        "figure3": draw_paths,
        "figure4": draw_angles,
        "figure5": draw_forces,
        "figure6": draw_vectors,
    }
    paths = []
    with staged(folder) as stage, style.context(["default", PRINT]):
        for name, draw in drawings.items():
            figure = Figure()
            draw(figure, reproduction)
            for file, metadata in ((f"{name}.png", {}), (f"{name}.svg", {"Date": None})):
                figure.savefig(stage / file, metadata=metadata)
                paths.append(folder / file)
    return paths
