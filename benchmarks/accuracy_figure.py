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
SLOPES = {"air": (1, 2, 3, 4), "natural": (1, 0, 0, 2)}
"""Reference slope under the line of each scheme, 0 for none."""

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
            for (scheme, found), order in zip(by_scheme.items(), SLOPES[case.ground], strict=True):
                worst, median = (np.array([f(e) for e in found]) for f in (np.max, np.median))
                worst, median = (np.where(e < NOISE, np.nan, e) for e in (worst, median))
                ax.plot(at, median, "o-", ms=3.5, lw=1.2, color=COLOURS[scheme], label=scheme)
                ax.fill_between(at, median, worst, color=COLOURS[scheme], alpha=0.18, lw=0)
                if order:
                    line = median[0] / 2.5 * (at / at[0]) ** order
                    ax.plot(at[line > NOISE], line[line > NOISE], ":", lw=0.9, color=GREY)
                    ax.annotate(f"slope {order}", (at[0], line[0]), color=GREY, fontsize=7,
                                xytext=(4, -3), textcoords="offset points")  # fmt: skip
            ax.set(xscale="log", yscale="log", title=f"{case.preset}, {case.gait} {PLACES[case.ground]}")
            ax.set_xticks(at, [f"{x:g}" for x in at])
            ax.minorticks_off()
            ax.set_ylim(NOISE / 2, 1e-2)
        for ax in axes[-1]:
            ax.set_xlabel("step [ms]")
        for ax in axes[:, 0]:
            ax.set_ylabel("crank angle error after 2 s [rad]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        save(figure, path)
