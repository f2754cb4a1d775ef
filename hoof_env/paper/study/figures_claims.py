"""Figures of the part 'claims': where the force peaks, when, and which way it points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.paper.figure_style import BLUE, CONDITION_COLOURS, GREEN, GREY, ORANGE, PURPLE
from hoof_env.paper.measure import Stance
from hoof_env.paper.shapes import find_peaks
from hoof_env.paper.study.case import NAMES, Case
from hoof_env.paper.study.claims_peaks import peak_times

SOLVER = "exact"

SAMPLES = 400
"""How many instants of a stance are drawn at least."""


def _part(stance: Stance, t: Any) -> Any:
    """Time in percent of stance."""
    return 100 * (t - stance.start) / (stance.end - stance.start)


def _stance_rows(trace: NDArray[np.void], stance: Stance) -> NDArray[np.void]:
    rows = trace[(trace["t"] >= stance.start) & (trace["t"] <= stance.end)]
    return rows[:: max(1, len(rows) // SAMPLES)]


def draw_peaks(case: Case) -> Any:
    """Normal force of toe and heel over the stance, its peaks, double support and the outer thirds."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    for column, (gait, name) in enumerate(NAMES.items()):
        for ax, condition in zip(axes[:, column], CONDITION_COLOURS, strict=True):
            trace, stance = case.trace(gait, SOLVER, condition), case.stance(gait, SOLVER, condition)
            rows = _stance_rows(trace, stance)
            x = _part(stance, rows["t"])
            ax.fill_between(x, rows["heel_normal"], color=GREEN, alpha=0.35, lw=0, label="heel")
            ax.fill_between(
                x, rows["heel_normal"], rows["normal"], color=PURPLE, alpha=0.35, lw=0, label="toe"
            )
            ax.plot(x, rows["normal"], color="black", lw=1.2, label="sum")
            peaks = find_peaks(trace["normal"])
            ax.plot(
                _part(stance, trace["t"][peaks]),
                trace["normal"][peaks],
                "v",
                color=ORANGE,
                ms=6,
                label="peak",
            )
            for third in (100 / 3, 200 / 3):
                ax.axvline(third, color=GREY, lw=0.6, ls=":", label="thirds of stance")
            if stance.double:
                both = _part(stance, np.array(stance.double))
                ax.axvspan(*both, ymax=0.03, color=BLUE, lw=0, label="both in the ground")
            ax.set(title=f"{name.capitalize()}, {condition}", xlim=(0, 100), ylim=(0, None))
    for ax in axes[:, 0]:
        ax.set_ylabel("normal force [N]")
    for ax in axes[1]:
        ax.set_xlabel("part of stance [%]")
    entries = dict(zip(*axes[0, 0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=6)
    return figure


def draw_gap(case: Case) -> Any:
    """How much earlier or later than on elastic ground the force is highest, against restitution."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 3.3), layout="constrained")
    axes = figure.subplots(1, 2)
    for ax, (gait, name) in zip(axes, NAMES.items(), strict=True):
        for solver, colour, marker in (
            ("exact", BLUE, "o"),
            ("paper", ORANGE, "s"),
            ("paper, probable beta", GREEN, "^"),
        ):
            times = peak_times(case, gait, solver)
            shift = 1000 * (np.array(list(times.values())) - times[1.0])
            ax.plot(
                list(times),
                shift,
                color=colour,
                marker=marker,
                ms=3.5,
                label=f"solver {solver}".replace("beta", "β"),
            )
        ax.axhline(0, color=GREY, lw=0.6)
        ax.set(
            title=f"{name.capitalize()}, highest force",
            xlabel="restitution cr of Eq. 14 [-]",
            xlim=(1.03, -0.03),
        )
    axes[0].set_ylabel("later than on elastic ground [ms]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def draw_direction(case: Case) -> Any:
    """Horizontal and normal force on the leg over the stance, elastic: forward propels, backward brakes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 3.0), layout="constrained")
    axes = figure.subplots(1, 2)
    for ax, (gait, name) in zip(axes, NAMES.items(), strict=True):
        stance = case.stance(gait, SOLVER)
        rows = _stance_rows(case.trace(gait, SOLVER), stance)
        x, force = _part(stance, rows["t"]), rows["friction"]
        ax.plot(x, rows["normal"], color=GREY, lw=1, ls="--", label="normal force")
        ax.fill_between(
            x, np.maximum(force, 0), color=GREEN, alpha=0.6, lw=0, label="forward: propels the leg"
        )
        ax.fill_between(
            x, np.minimum(force, 0), color=ORANGE, alpha=0.6, lw=0, label="backward: brakes the leg"
        )
        ax.axhline(0, color=GREY, lw=0.6)
        ax.set(title=f"{name.capitalize()}, elastic", xlabel="part of stance [%]", xlim=(0, 100))
    axes[0].set_ylabel("force of the ground on the leg [N]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
