"""Learning curves of one id: the interquartile mean over seeds and its interval, by steps and by time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from agents.baselines_results import OPEN_LOOP, Reference, Row
from agents.baselines_stats import Floats, iqm

POINTS = 40
"""Of a curve."""


def over_time(row: Row, key: str) -> tuple[Floats, Floats]:
    """IQM and interval of the return, shape (3, `POINTS`), over "steps" or "wall_s", shape (`POINTS`,), from
    the first score of a trained policy to the last that all seeds have."""
    curves = [one.curve for one in row.results]
    first, last = max(c[1][key] for c in curves), min(c[-1][key] for c in curves)
    x = np.geomspace(first, max(last, first), POINTS)
    each = [np.interp(x, [p[key] for p in c], [p["return"] for p in c]) for c in curves]
    return x, iqm(each)


def draw_curves(rows: Sequence[Row], gaits: Mapping[str, Reference], path: Path) -> None:
    """One picture: the return against steps and against wall time, a line and a band for each entry."""
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREEN, GREY, ORANGE, PURPLE

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    lowest = min(one.figures["return"] for name, one in gaits.items() if name != "walk")
    for axes, key, label in zip(
        panels, ("steps", "wall_s"), ("environment steps", "wall time of training [s]"), strict=True
    ):
        for row, colour in zip(rows, (BLUE, ORANGE, GREEN, PURPLE), strict=False):
            x, (mean, low, high) = over_time(row, key)
            lowest = min(lowest, float(mean.min()))
            axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
            axes.plot(x, mean, color=colour, lw=1.5, label=f"{row.title}, {len(row.results)} seeds")
        for name, style in ((OPEN_LOOP, "--"), ("run", ":")):
            if name in gaits:
                axes.axhline(gaits[name].figures["return"], color=GREY, lw=1.2, ls=style, label=name)
        axes.set(xscale="log", xlabel=label)
        axes.grid(axis="y", color=GREY, alpha=0.15)
    panels[0].set_ylabel("return: IQM, 95 % interval")
    panels[0].set_ylim(bottom=max(lowest - 2, -25))
    panels[0].set_title(rows[0].entry.env_id, loc="left")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.savefig(path, dpi=130)
