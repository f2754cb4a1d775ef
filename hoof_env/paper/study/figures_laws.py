"""Figures of the part on exponent and damping law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.paper.figure_style import AMBER, BLUE, GAITS, GREEN, GREY, ORANGE, PURPLE, SKY, mark_published

LAW_COLOURS = {
    "lankarani-nikravesh": ORANGE,
    "hunt-crossley": AMBER,
    "flores": GREEN,
    "gonthier": SKY,
    "hu-guo": PURPLE,
    "exact": "black",
}
GAIT_COLOURS = {"walk": ORANGE, "run": BLUE}
OTHER_LINES = ("--", ":", "-.")
"""Of exponents that are not the preset's, whose line is solid."""


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _laws(data: Mapping[str, Any]) -> dict[str, Any]:
    """The sweeps of every law with the preset's exponent."""
    laws: dict[str, Any] = data["exponents"][data["exponent"]]["laws"]
    return laws


def draw_nominal(data: Mapping[str, Any]) -> Any:
    """Peak and reduction over the nominal coefficient of restitution, by law and gait."""
    figure = _figure(7.5, 5.4)
    axes = figure.subplots(2, 2, sharex=True)
    for (left, right), (gait, title) in zip(axes, GAITS.items(), strict=True):
        for law, sweep in _laws(data).items():
            style = {"color": LAW_COLOURS[law], "lw": 1.8 if law == "exact" else 1.2}
            left.semilogy(sweep["nominal"], sweep[gait]["peak"], label=law, **style)
            right.plot(sweep["nominal"], sweep[gait]["reduction"], **style)
        mark_published(right, data["paper_restitution"], data["published"][gait]["reduction"])
        left.set(title=title, ylabel="peak normal force [N]", xlim=(0, 1))
        right.set(title=title, ylabel="reduction by elastic ground [%]", ylim=(0, 100))
    for ax in axes[1]:
        ax.set_xlabel("nominal coefficient of restitution [-]")
    entries = {
        label: handle for ax in axes[0] for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=4)
    return figure


def draw_delivered(data: Mapping[str, Any]) -> Any:
    """Delivered over nominal restitution, and the reduction over the delivered one."""
    figure = _figure(7.5, 3.6)
    left, right = figure.subplots(1, 2)
    left.plot([0, 1], [0, 1], color=GREY, lw=0.7)
    for law, sweep in _laws(data).items():
        left.plot(sweep["nominal"], sweep["delivered"], color=LAW_COLOURS[law], lw=1.2, label=law)
    for gait, title in GAITS.items():
        sweep = _laws(data)["exact"]
        right.plot(
            sweep["delivered"],
            sweep[gait]["reduction"],
            color=GAIT_COLOURS[gait],
            lw=0.8,
            label=title.lower(),
        )
        paper = _laws(data)[data["paper_law"]]
        right.plot(paper["delivered"], paper[gait]["reduction"], color=GAIT_COLOURS[gait], lw=3.0)
        end = paper["delivered"][paper["nominal"].index(data["paper_restitution"])]
        mark_published(right, end, data["published"][gait]["reduction"])
    left.set(xlabel="nominal coefficient of restitution [-]", ylabel="restitution of a free impact [-]",
             xlim=(0, 1), ylim=(0, 1))  # fmt: skip
    right.set(xlabel="restitution of a free impact [-]", ylabel="reduction by elastic ground [%]",
              xlim=(0, 1), ylim=(0, 100))  # fmt: skip
    left.legend()
    handles, labels = right.get_legend_handles_labels()
    right.legend(handles[:3], labels[:3])
    right.set_title("thick: what the paper's law reaches", fontsize=8)
    return figure


def draw_free(data: Mapping[str, Any]) -> Any:
    """Peak over the elastic peak, prescribed motion beside free impacts; the reduction by exponent."""
    figure = _figure(7.5, 3.6)
    left, right = figure.subplots(1, 2)
    others = iter(OTHER_LINES)
    for exponent, entry in data["exponents"].items():
        line = "-" if exponent == data["exponent"] else next(others)
        sweep = entry["laws"]["exact"]
        for gait in GAITS:
            style = {"color": GAIT_COLOURS[gait], "ls": line, "lw": 1.2}
            right.plot(sweep["delivered"], sweep[gait]["reduction"], **style)
            ratio = np.array(sweep[gait]["peak"]) / entry["elastic"][gait]["peak"]
            left.semilogy(sweep["delivered"], ratio, **style)
        left.semilogy(sweep["delivered"], sweep["free_peak"], color=GREY, ls=line, lw=1.2)
        right.plot([], [], color="black", ls=line, lw=1.2, label=f"n = {exponent}")
    left.plot([], [], color=GREY, label="free impact")
    for gait, title in GAITS.items():
        left.plot([], [], color=GAIT_COLOURS[gait], label=f"{title.lower()}, prescribed motion")
    left.axhline(1, color="black", lw=0.5)
    left.set(xlabel="restitution of a free impact [-]", ylabel="peak over elastic peak [-]", xlim=(0, 1))
    right.set(xlabel="restitution of a free impact [-]", ylabel="reduction by elastic ground [%]",
              xlim=(0, 1), ylim=(0, 100))  # fmt: skip
    left.legend()
    right.legend()
    return figure


def draw_curves(curves: Mapping[Any, Any]) -> Any:
    """Normal force over time for a few laws and restitutions."""
    figure = _figure(7.5, 3.6)
    axes = dict(zip(GAITS, figure.subplots(1, 2), strict=True))
    shades = {1.0: BLUE, 0.5: GREEN, 0.3: PURPLE, 0.0: ORANGE}
    for (gait, law, cr), trace in curves.items():
        bearing = trace["t"][(trace["toe_penetration"] > 0) | (trace["heel_penetration"] > 0)]
        axes[gait].plot(trace["t"], trace["normal"], color=shades[cr], ls="--" if law == "exact" else "-",
                        lw=1.2, label=f"{'law exact' if law == 'exact' else law}, cr = {cr:g}")  # fmt: skip
        axes[gait].set_xlim(bearing.min() - 0.02, bearing.max() + 0.02)
    for gait, ax in axes.items():
        ax.set(title=GAITS[gait], xlabel="time [s]", ylim=(0, None))
    axes["walk"].set_ylabel("normal force [N]")
    figure.legend(*axes["walk"].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def draw_floor(data: Mapping[str, Any]) -> Any:
    """Inelastic peak over the floor of the approach speed, with the approach speeds of toe and heel."""
    figure = _figure(7.5, 3.4)
    floor = data["floor"]
    for ax, (gait, title) in zip(figure.subplots(1, 2), GAITS.items(), strict=True):
        ax.semilogx(floor["floor"], floor["peak"][gait], color=ORANGE, lw=1.4, label="inelastic peak")
        elastic = data["exponents"][data["exponent"]]["elastic"][gait]["peak"]
        ax.axhline(elastic, color=BLUE, lw=1.2, label="elastic peak")
        speeds = sorted((speed, name) for name, speed in floor["approach"][gait].items())
        for (speed, name), side in zip(speeds, ("right", "left"), strict=False):
            ax.axvline(speed, color=GREY, lw=0.7, ls=(0, (1, 2)))
            ax.text(speed, 1.01, name, transform=ax.get_xaxis_transform(), ha=side, va="bottom", fontsize=8)
        ax.set_title(title, pad=16)
        ax.set(xlabel="floor of the approach speed [m/s]", ylabel="peak normal force [N]", ylim=(0, None))
        ax.set_xlim(min(floor["floor"]), max(floor["floor"]))
        ax.legend(loc="lower left")
    return figure
