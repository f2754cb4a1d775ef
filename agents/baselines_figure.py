"""Learning curves of one id: the interquartile mean over seeds and its interval, by steps and by time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from agents.baselines_results import OPEN_LOOP, Reference, Row
from agents.baselines_stats import Floats, iqm

POINTS = 40
"""Of a curve."""

WIDE = 5.0
"""An axis is logarithmic where the longest training is so many times the shortest."""


def over_time(row: Row, key: str, is_log: bool) -> tuple[Floats, Floats]:
    """IQM and interval of the return, shape (3, `POINTS`), over "steps" or "wall_s", shape (`POINTS`,), up to
    the last score that all seeds have; on a logarithmic axis from the first score of a trained policy."""
    curves = [one.curve for one in row.results]
    last = min(curve[-1][key] for curve in curves)
    first = min(max(curve[1][key] for curve in curves), last)
    x = np.geomspace(first, last, POINTS) if is_log else np.linspace(0, last, POINTS)
    each = [np.interp(x, [p[key] for p in curve], [p["return"] for p in curve]) for curve in curves]
    return x, iqm(each)


def draw_curves(rows: Sequence[Row], gaits: Mapping[str, Reference], path: Path) -> None:
    """One picture: the return against steps and against wall time, a line and a band for each entry."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter, NullFormatter

    from hoof_env.paper.figure_style import BLUE, GREEN, GREY, ORANGE, PURPLE

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    lowest = gaits["run"].figures["return"]
    for axes, key, label in zip(
        panels, ("steps", "wall_s"), ("environment steps", "wall time of training [s]"), strict=True
    ):
        ends = [one.curve[-1][key] for row in rows for one in row.results]
        is_log = max(ends) > WIDE * min(ends)
        for row, colour in zip(rows, (BLUE, ORANGE, GREEN, PURPLE), strict=False):
            x, (mean, low, high) = over_time(row, key, is_log)
            lowest = min(lowest, float(mean.min()))
            axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
            axes.plot(x, mean, color=colour, lw=1.5, label=f"{row.title}, {len(row.results)} seeds")
        for name, style in ((OPEN_LOOP, "--"), ("run", ":")):
            if name in gaits:
                axes.axhline(gaits[name].figures["return"], color=GREY, lw=1.2, ls=style, label=name)
        if is_log:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.xaxis.set_major_formatter(EngFormatter(sep=" " if key == "steps" else ""))
        axes.set_xlabel(label)
        axes.grid(axis="y", color=GREY, alpha=0.15)
    panels[0].set_ylabel("return: IQM, 95 % interval")
    panels[0].set_ylim(bottom=max(lowest - 2, -25))
    panels[0].set_title(rows[0].entry.env_id, loc="left")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.savefig(path, dpi=130)
