"""The convergence plot of `benchmarks.accuracy`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.crank_accuracy import Case
from hoof_env.dynamics.schemes import SCHEMES
from hoof_env.paper.figure_style import BLUE, GREEN, GREY, ORANGE, PURPLE, STYLE
from hoof_env.paper.figures import save

COLOURS = dict(zip(SCHEMES, (ORANGE, BLUE, GREEN, PURPLE), strict=True))
PLACES = {"air": "in air", "natural": "on the ground"}
SLOPES = {"air": (1, 2, 3, 4), "natural": (1, 2)}
"""Reference slopes of each place."""

NOISE = 1e-11
"""Errors below this are the reference's and round-off's [rad]."""


def draw_convergence(
    path: Path, steps: Sequence[float], errors: Mapping[Case, Mapping[str, Sequence[NDArray[np.float64]]]]
) -> None:
    """Median over the starts as a line, the worst as the upper edge of a band; one panel a case."""
    from matplotlib import style
    from matplotlib.figure import Figure

    presets = list(dict.fromkeys(case.preset for case in errors))
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(7.2, 0.5 + 2.9 * len(presets)), layout="constrained")
        axes = figure.subplots(len(presets), len(PLACES), sharex=True, sharey=True, squeeze=False)
        at = 1e3 * np.array(steps)
        for case, by_scheme in errors.items():
            ax = axes[presets.index(case.preset), list(PLACES).index(case.ground)]
            for scheme, found in by_scheme.items():
                worst = np.maximum([e.max() for e in found], NOISE)
                median = np.maximum([np.median(e) for e in found], NOISE)
                ax.plot(
                    at, median, "o-", ms=3.5, lw=1.2, color=COLOURS[scheme], label=scheme.replace("_", " ")
                )
                ax.fill_between(at, median, worst, color=COLOURS[scheme], alpha=0.18, lw=0)
            last = [np.median(found[-1]) for found in by_scheme.values()]
            for order in SLOPES[case.ground]:
                start = max(last[order - 1], NOISE) / 3
                ax.plot(at, start * (at / at[-1]) ** order, ":", lw=0.8, color=GREY)
                ax.annotate(f"{order}", (at[2], start * (at[2] / at[-1]) ** order), color=GREY, fontsize=8,
                            xytext=(2, -8), textcoords="offset points")  # fmt: skip
            ax.set(xscale="log", yscale="log", title=f"{case.preset}, {case.gait} {PLACES[case.ground]}")
            ax.set_xticks(at, [f"{x:g}" for x in at])
            ax.minorticks_off()
            ax.set_ylim(NOISE / 2, 1e-1)
        for ax in axes[-1]:
            ax.set_xlabel("step [ms]")
        for ax in axes[:, 0]:
            ax.set_ylabel("crank angle error after 2 s [rad]")
        axes[0, 0].legend(loc="upper left")
        save(figure, path)
