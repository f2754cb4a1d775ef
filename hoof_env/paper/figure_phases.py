"""Sub-phases of a stance by the hoof points that bear, such as heel-strike, flat and toe-off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from hoof_env.paper.figure_style import GREY, SMALL, half_bar, mark_published, panel, text_size
from hoof_env.paper.measure import POINTS, Stance
from hoof_env.paper.published import PublishedRow

if TYPE_CHECKING:
    from hoof_env.paper.rows import Reproduction

BOTH = {"walk": "flat", "run": "roll-over"}
"""What the paper calls the part of the stance in which toe and heel both bear."""

TINTS = {("toe",): "#F6E4EE", ("heel",): "#D5EEE5", ("toe", "heel"): "#FBF2D3", (): "white"}
"""Light colours by the points that bear."""

STRIP = 2.0
"""Height of the strip that names the sub-phases [mm]."""


@dataclass(frozen=True)
class Phase:
    """One sub-phase: its `name`, `start` and `end` [s], and the hoof points `bearing` in it."""

    name: str
    start: float
    end: float
    bearing: tuple[str, ...]


def sub_phases(stance: Stance, gait: str) -> tuple[Phase, ...]:
    """The stance cut where toe or heel enters or leaves the ground.

    One point bearing alone is its strike at the start of the stance, its off at the end and otherwise
    'alone'; both bearing have the paper's name for the gait (`BOTH`).
    """
    instants = sorted({t for name in POINTS for interval in getattr(stance, name) for t in interval})
    pieces = list(pairwise(instants))
    phases = []
    for place, (start, end) in enumerate(pieces):
        bearing = tuple(
            name
            for name in POINTS
            if any(enter <= start and end <= leave for enter, leave in getattr(stance, name))
        )
        if len(bearing) == 1:
            part = " alone"
            if len(pieces) > 1:
                part = {0: "-strike", len(pieces) - 1: "-off"}.get(place, part)
            name = bearing[0] + part
        else:
            name = BOTH[gait] if bearing else "in the air"
        phases.append(Phase(name, start, end, bearing))
    return tuple(phases)


def shade(ax: Any, phases: tuple[Phase, ...]) -> None:
    """Shade the sub-phases behind curves over time [s]."""
    for phase in phases:
        ax.axvspan(phase.start, phase.end, fc=TINTS[phase.bearing], lw=0, zorder=0)


def time_limits(reproduction: Reproduction, gait: str, stance: Stance, margin: float) -> tuple[float, float]:
    """An interval [s] around the stance and the published instants of contact, `margin` of it more on
    either side."""
    published = [row.value for row in _contact_rows(reproduction, gait)]
    start, end = min(stance.start, *published), max(stance.end, *published)
    return start - margin * (end - start), end + margin * (end - start)


def mark_contacts(ax: Any, reproduction: Reproduction, gait: str, y: float) -> None:
    """The published instants of contact on an axis of time [s]."""
    for row in _contact_rows(reproduction, gait):
        mark_published(ax, row.value, y, xerr=half_bar(row))


def _contact_rows(reproduction: Reproduction, gait: str) -> list[PublishedRow]:
    return [reproduction.published.row(f"{gait}.{name}") for name in ("contact_start", "contact_end")]


def spread(centres: Sequence[float], widths: Sequence[float], low: float, high: float) -> list[float]:
    """Centres of labels in a row, moved as little as keeps them apart and, if they fit, within [low, high].

    Args:
        centres: where the labels would like to be, increasing [mm].
        widths: their widths, with the gap to the next [mm].
        low, high: ends of the row [mm].
    """
    placed = []
    for centre, width in zip(centres, widths, strict=True):
        placed.append(max(centre, low + width / 2))
        low = placed[-1] + width / 2
    for k in reversed(range(len(placed))):
        placed[k] = min(placed[k], high - widths[k] / 2)
        high = placed[k] - widths[k] / 2
    return placed


def name_phases(
    figure: Any, left: float, top: float, width: float, limits: tuple[float, float], phases: tuple[Phase, ...]
) -> None:
    """A strip of the sub-phases with their names above it.

    Args:
        left, top, width: of the strip, from the upper left corner of the figure [mm].
        limits: time at its ends [s].
    """
    ax = panel(figure, left, top, width, STRIP, xlim=limits, ylim=(0, 1))
    ax.axis("off")
    shade(ax, phases)
    scale = width / (limits[1] - limits[0])
    sizes = [text_size(phase.name, SMALL)[0] + 1.5 for phase in phases]
    middles = [(phase.start + phase.end) / 2 for phase in phases]
    wanted = [scale * (middle - limits[0]) for middle in middles]
    for phase, middle, place in zip(phases, middles, spread(wanted, sizes, 0, width), strict=True):
        ax.plot([phase.start] * 2, [0, 1], color=GREY, lw=0.5)
        ax.plot([phase.end] * 2, [0, 1], color=GREY, lw=0.5)
        ax.plot([middle, limits[0] + place / scale], [0.9, 1.6], color=GREY, lw=0.5, clip_on=False)
        ax.text(limits[0] + place / scale, 1.7, phase.name, fontsize=SMALL, ha="center", va="bottom")
