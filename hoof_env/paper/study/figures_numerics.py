"""Figures of the part on time step and Baumgarte."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.paper.figure_style import BLUE, GAITS, GREY, ORANGE
from hoof_env.paper.published import Published
from hoof_env.paper.study.conditions import LEVEL_WINDOW, PART
from hoof_env.paper.study.conditions_text import bars_spanned

COLOURS = {"exact": GREY, "printed": ORANGE, "probable": BLUE}
LINES = {"walk": "-", "run": "--"}
CONDITION_LINES = {"elastic": ":", "inelastic": "-"}


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _label(data: Mapping[str, Any], name: str) -> str:
    return "exact" if name == "exact" else f"Euler, {name} β = {data['betas'][name]:.2f} 1/s"


def draw_drift(data: Mapping[str, Any], curves: Mapping[Any, Any]) -> Any:
    """Hoof error over time at the paper's step, and its maximum over the step."""
    figure = _figure(7.5, 3.4)
    left, right = figure.subplots(1, 2)
    steps = 1e3 / np.array(data["ladder"])
    for (gait, name), (t, error) in curves.items():
        label = f"{GAITS[gait].lower()}, {name} β = {data['betas'][name]:.2f} 1/s"
        style = {"color": COLOURS[name], "ls": LINES[gait]}
        left.plot(t, error, lw=1.2, label=label, **style)
        right.loglog(
            steps,
            [entry[gait]["cycle_mm"] for entry in data["drift"][name]],
            marker="o",
            ms=4,
            lw=1.2,
            **style,
        )
    low, high = right.get_ylim()
    right.loglog(steps, high * steps / steps.max(), color=GREY, lw=0.8, label="first order")
    right.set(xlabel="time step [ms]", ylabel="largest hoof error [mm]", ylim=(low, 1.2 * high))
    right.set_xticks(steps, [f"{step:g}" for step in steps])
    right.minorticks_off()
    left.set(
        xlabel=f"time [s], step {steps.max():g} ms", ylabel="hoof error [mm]", xlim=(0, 1), ylim=(0, None)
    )
    right.legend()
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def draw_beta(data: Mapping[str, Any]) -> Any:
    """Hoof error and peaks over beta at the paper's step."""
    figure = _figure(7.5, 3.4)
    left, right = figure.subplots(1, 2)
    sweep = data["beta_sweep"]
    for gait, errors in sweep["hoof_mm"].items():
        left.plot(sweep["beta"], errors, color=GREY, ls=LINES[gait], label=GAITS[gait].lower())
    for key, ratios in sweep["peak_ratio"].items():
        gait, condition = key.split(".")
        colour = {"walk": ORANGE, "run": BLUE}[gait]
        right.plot(
            sweep["beta"], ratios, color=colour, ls=CONDITION_LINES[condition], lw=1.2,
            label=f"{GAITS[gait].lower()}, {condition}",
        )  # fmt: skip
    for ax in (left, right):
        ax.set(xlabel="Baumgarte's β [1/s]", xlim=(0, max(sweep["beta"])))
        for name, beta in data["betas"].items():
            ax.axvline(beta, color=GREY, lw=0.7, ls=(0, (1, 2)))
            ax.text(
                beta, 1.01, name, transform=ax.get_xaxis_transform(), ha="center", va="bottom", fontsize=8
            )
    right.axhline(1, color=GREY, lw=0.7)
    left.set_ylabel("largest hoof error [mm]")
    left.set_ylim(0, None)
    right.set_ylabel("peak force over the exact peak [-]")
    left.legend()
    right.legend()
    return figure


def draw_step_and_level(data: Mapping[str, Any]) -> Any:
    """Inelastic peaks over the time step and over the ground level."""
    figure = _figure(7.5, 5.4)
    axes = figure.subplots(2, 2, sharey="row")
    steps, levels = data["step_sweep"], data["level_sweep"]
    for (left, right), (gait, title) in zip(axes, GAITS.items(), strict=True):
        left.axhline(steps["exact"][gait], color=COLOURS["exact"], lw=1.2)
        for name, peaks in steps["peaks"][gait].items():
            left.semilogx(steps["step_ms"], np.array(peaks, dtype=float), color=COLOURS[name], lw=0.9)
        for name, peaks in levels["peaks"][gait].items():
            right.plot(levels["rise_mm"], peaks, color=COLOURS[name], lw=1.2, label=_label(data, name))
        ticks = [tick for tick in (0.25, 0.5, 1, 2) if min(steps["step_ms"]) <= tick <= max(steps["step_ms"])]
        left.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        left.minorticks_off()
        left.set(title=f"{title}, inelastic", ylabel="peak normal force [N]")
        low, high = left.get_ylim()
        if low < high / 2:  # a curve that hardly moves is shown without its zero
            left.set_ylim(0, None)
        right.set(title=f"{title}, inelastic", xlim=(min(levels["rise_mm"]), max(levels["rise_mm"])))
    axes[1, 0].set_xlabel("time step [ms]")
    axes[1, 1].set_xlabel("rise of the ground [mm]")
    figure.legend(*axes[0, 1].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def draw_forces(data: Mapping[str, Any], curves: Mapping[Any, Any], published: Mapping[str, float]) -> Any:
    """Inelastic normal force over time, exact and by Euler at the paper's step, with the published peaks."""
    figure = _figure(7.5, 3.4)
    axes = figure.subplots(1, 2)
    for ax, (gait, title) in zip(axes, GAITS.items(), strict=True):
        ax.axhline(published[gait], color="black", lw=0.7, ls=(0, (4, 2)), label="published peak")
        bearing = []
        for name, colour in COLOURS.items():
            t, normal = curves[gait, name]
            bearing += [t[normal > 0].min(), t[normal > 0].max()]
            ax.plot(t, normal, color=colour, lw=2.4 if name == "exact" else 1.0, label=_label(data, name))
        margin = 0.1 * (max(bearing) - min(bearing))
        ax.set(title=f"{title}, inelastic", xlabel="time [s]", ylim=(0, None))
        ax.set_xlim(min(bearing) - margin, max(bearing) + margin)
    axes[0].set_ylabel("normal force [N]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def draw_conditions(published: Published, data: Mapping[str, Any]) -> Any:
    """How many bars each row of the paper's solver spans in the window of each parameter."""
    figure = _figure(7.5, 5.2)
    ax = figure.subplots()
    rows = [row for row in published.rows if row.bar.limit is not None]
    columns = [
        ("paper", "step", f"step ±{100 * PART:g} %, printed β", ORANGE, "o"),
        ("paper, probable beta", "step", f"step ±{100 * PART:g} %, probable β", BLUE, "o"),
        ("paper", "beta", f"β ±{100 * PART:g} %, printed", ORANGE, "^"),
        ("paper, probable beta", "beta", f"β ±{100 * PART:g} %, probable", BLUE, "^"),
        ("paper", "ground", f"ground ±{1e3 * LEVEL_WINDOW:g} mm, printed β", ORANGE, "s"),
        ("paper, probable beta", "ground", f"ground ±{1e3 * LEVEL_WINDOW:g} mm, probable β", BLUE, "s"),
        ("exact", "ground", f"ground ±{1e3 * LEVEL_WINDOW:g} mm, exact", "black", "x"),
    ]
    for solver, parameter, label, colour, marker in columns:
        spans = [bars_spanned(row, data["conditions"][row.id][solver][parameter]) for row in rows]
        known = [(span, k) for k, span in enumerate(spans) if span is not None]
        ax.plot(*np.transpose(known), marker, color=colour, label=label, ms=5,
                mfc=colour if marker == "o" else "none")  # fmt: skip
    ax.axvline(1, color=GREY, lw=0.8)
    ax.set_xscale("log")
    ax.set_yticks(range(len(rows)), [row.id for row in rows])
    ax.set(xlabel="highest minus lowest value in the window, in bars [-]", ylim=(len(rows) - 0.5, -0.5))
    ax.grid(axis="y", color="#DDDDDD", lw=0.5)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7)
    return figure
