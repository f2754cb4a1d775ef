"""Speed against peak force and cost of transport: learned gaits, the paper's and those found by CMA-ES."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.baselines_plan import FINAL_SEEDS, LEG, figures
from agents.baselines_results import GAITS as PAPER
from agents.baselines_results import Row
from agents.open_loop import GAITS, stored
from agents.score import score_vector
from agents.tradeoff_plan import DEFAULT

KEYS = {"speed_m_s": -1.0, "stance_peak_n": 1.0, "cost_of_transport": 1.0}
"""What the front is about, and the sign with which less is better."""

COLUMNS: Mapping[str, tuple[str, float, int]] = {
    "speed_m_s": ("speed m/s", 1.0, 2),
    "stance_peak_n": ("stance peak kN", 1e-3, 2),
    "peak_grf_n": ("highest GRF kN", 1e-3, 2),
    "peaks_per_metre": ("peaks per metre kN/m", 1e-3, 2),
    "cost_of_transport": ("cost of transport", 1.0, 3),
    "weight_share": ("weight share", 1.0, 2),
}
"""Title, factor and digits of what tables show."""

BEARING = 0.65
"""Share of the weight from which on a gait counts as one that bears: the paper's run bears 0.70."""

LEVELS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
"""Speeds [m/s] at which the best of each kind are held against each other."""

MISSED = 0.05
"""A gait that misses one of `LEVELS` by no more counts as so fast [m/s]."""

LEARNED, OPEN_LOOP, SCRIPTED = "learned", "open-loop", "paper"


@dataclass(frozen=True)
class Point:
    """A gait of the picture.

    Attributes:
        kind: `LEARNED`, `OPEN_LOOP` or `SCRIPTED`.
        name: label of its reward, name of its file, or of the gait.
        seed: of its training, -1 where nothing was trained.
        figures: means over fresh episodes, `COLUMNS` among them; NaN for what a gait has not, that does
            not get forward.
    """

    kind: str
    name: str
    seed: int
    figures: Mapping[str, float]


def of_episodes(episodes: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """`agents.baselines_plan.figures`, and the sum of the stances' peaks per metre [N/m], which the reward
    charges, NaN for a gait that does not get forward."""
    distance, peaks = (sum(one[name] for one in episodes) for name in ("distance_m", "stance_peak_sum_n"))
    return figures(episodes) | {"peaks_per_metre": peaks / distance if distance > 0 else np.nan}


def learned(rows: Iterable[Row]) -> list[Point]:
    """One point for each training."""
    return [
        Point(LEARNED, row.entry.label, one.final["seed"], of_episodes(one.final["episodes"]))
        for row in rows
        for one in row.results
    ]


def others(folder: Path = GAITS) -> list[Point]:
    """The paper's gaits and every stored open-loop gait on the episodes of the agents."""
    known = [(SCRIPTED, name, name) for name in PAPER]
    known += [
        (OPEN_LOOP, path.stem.removeprefix("HorseLeg-v0-"), str(path))
        for path in sorted(folder.glob("*.json"))
        if stored(path)["env_id"] == LEG
    ]
    return [
        Point(kind, name, -1, of_episodes(score_vector(policy, LEG, FINAL_SEEDS)))
        for kind, name, policy in known
    ]


def not_dominated(costs: Any) -> NDArray[np.bool_]:
    """Which rows no other row beats: as low in all columns and lower in one. Rows with NaN are beaten.

    Args:
        costs: shape (n, k), less is better.

    Returns:
        Shape (n,).
    """
    costs = np.asarray(costs, float)
    known = ~np.isnan(costs).any(1)
    costs = np.where(known[:, None], costs, np.inf)
    as_low = (costs[:, None] <= costs).all(2)
    lower = (costs[:, None] < costs).any(2)
    return known & ~(as_low & lower).any(0)


def on_front(points: Sequence[Point]) -> NDArray[np.bool_]:
    """Which points no other beats in speed, stance peak and cost of transport at once."""
    return not_dominated([[sign * one.figures[key] for key, sign in KEYS.items()] for one in points])


def best(points: Sequence[Point], key: str, speed: float) -> Point | None:
    """The point with the least of a figure among those that are so fast, but for `MISSED`."""
    fast = [
        one for one in points if one.figures["speed_m_s"] >= speed - MISSED and np.isfinite(one.figures[key])
    ]
    return min(fast, key=lambda one: one.figures[key], default=None)


def front_table(points: Sequence[Point]) -> str:
    """Means over seeds, with lowest and highest where they differ, reward by reward; then the others."""
    among_all = dict(zip(map(id, points), on_front(points), strict=True))
    groups: dict[tuple[str, str], list[Point]] = {}
    for one in points:
        groups.setdefault((one.kind, one.name), []).append(one)
    titles = ["gait", *(title for title, *_ in COLUMNS.values()), "not beaten"]
    lines = [f"| {' | '.join(titles)} |", "|---|" + "---|" * (len(titles) - 1)]
    for (kind, name), group in groups.items():
        cells = [
            _cell([one.figures[key] for one in group], factor, digits)
            for key, (_, factor, digits) in COLUMNS.items()
        ]
        count = sum(among_all[id(one)] for one in group)
        lines.append(f"| {kind} {name} | {' | '.join(cells)} | {count}/{len(group)} |")
    return "\n".join(lines)


def _cell(values: Sequence[float], factor: float, digits: int) -> str:
    known = [factor * x for x in values if np.isfinite(x)]
    if not known:
        return "-"
    low, mean, high = (f"{x:.{digits}f}" for x in (min(known), np.mean(known), max(known)))
    return mean if low == high else f"{mean} ({low} to {high})"


def level_table(points: Sequence[Point]) -> str:
    """Speed by speed, the least that learned and open-loop gaits reach, of all and of those that bear."""
    compared = ("stance_peak_n", "peaks_per_metre", "cost_of_transport")
    titles = [f"{COLUMNS[key][0]}, {kind}" for key in compared for kind in (LEARNED, OPEN_LOOP)]
    lines = [f"| bearing | at least m/s | {' | '.join(titles)} |", "|---|---|" + "---|" * len(titles)]
    for least in (0.0, BEARING):
        some = [one for one in points if one.figures["weight_share"] >= least]
        for speed in LEVELS:
            cells = [
                _best_cell(best([one for one in some if one.kind == kind], key, speed), key)
                for key in compared
                for kind in (LEARNED, OPEN_LOOP)
            ]
            bearing = f"at least {least:g}" if least else "any"
            lines.append(f"| {bearing} | {speed:g} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _best_cell(found: Point | None, key: str) -> str:
    """A figure and, in brackets, the share of the weight."""
    _, factor, digits = COLUMNS[key]
    return f"{factor * found.figures[key]:.{digits}f} ({found.figures['weight_share']:.2f})" if found else "-"


def draw_front(points: Sequence[Point], weight: float, path: Path) -> None:
    """Speed against stance peak, highest force, peaks per metre and cost of transport; the fill of a mark is
    the share of the weight that the leg bears."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from hoof_env.paper.figure_style import BLUE, GREY, ORANGE

    looks = {LEARNED: ("o", BLUE, 34), OPEN_LOOP: ("s", ORANGE, 26), SCRIPTED: ("D", "black", 60)}
    figure = Figure(figsize=(9, 8), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    shown = (
        ("stance_peak_n", "mean peak force of a stance [body weights]", 1 / weight),
        ("peak_grf_n", "highest force of an episode [body weights]", 1 / weight),
        ("peaks_per_metre", "peaks of all stances, per metre [body weights/m]", 1 / weight),
        ("cost_of_transport", "cost of transport [J/(N m)]", 1.0),
    )
    marks: Any = None
    for axes, (key, label, factor) in zip(panels, shown, strict=True):
        for kind, (marker, colour, size) in looks.items():
            some = [one for one in points if one.kind == kind and np.isfinite(one.figures[key])]
            x, y = (np.array([one.figures[name] for one in some]) for name in ("speed_m_s", key))
            if kind != SCRIPTED and len(some):
                keep = not_dominated(np.stack([-x, y], 1))
                order = np.argsort(x[keep])
                axes.step(
                    x[keep][order], factor * y[keep][order], where="pre", color=colour, lw=1.2, zorder=1
                )
            marks = axes.scatter(
                x, factor * y, size, [one.figures["weight_share"] for one in some], marker=marker,
                cmap="cividis_r", vmin=0, vmax=1, edgecolors=colour, linewidths=1.2, zorder=2,
            )  # fmt: skip
            for one, here in zip(some, zip(x, factor * y, strict=True), strict=True):
                if kind == SCRIPTED or (one.kind, one.name, one.seed) == (LEARNED, DEFAULT, 0):
                    text, offset, side = "default reward", (-6, 4), "right"
                    if kind == SCRIPTED:
                        text, offset, side = f"paper's {one.name}", (6, 6), "left"
                    axes.annotate(text, here, offset, textcoords="offset points", ha=side, fontsize=7.5)
        axes.set_xlabel("mean speed [m/s]")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.grid(color=GREY, alpha=0.15)
    names = {LEARNED: "learned (PPO), and its front", OPEN_LOOP: "open loop (CMA-ES), and its front",
             SCRIPTED: "the paper's gaits"}  # fmt: skip
    handles = [
        Line2D([], [], marker=marker, color=colour, mfc="white", ls="" if kind == SCRIPTED else "-")
        for kind, (marker, colour, _) in looks.items()
    ]
    figure.legend(handles, [names[kind] for kind in looks], loc="outside lower center", ncols=3)
    figure.colorbar(
        marks, ax=panels, label="share of the weight that the leg bears", fraction=0.025, pad=0.01
    )
    figure.savefig(path, dpi=130)
