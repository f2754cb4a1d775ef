"""Figures of the part on sensitivity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.paper.figure_style import BLUE, CONDITION_COLOURS, GAITS, GREY, ORANGE
from hoof_env.paper.published import Published

LABELS = {
    "stiffness": "K",
    "exponent": "n",
    "friction": "μ",
    "friction_slow": "lower\nthreshold",
    "friction_fast": "upper\nthreshold",
    "crank_speed": "crank\nspeed",
    "ground_level": "ground\n+1 mm",
}
GAIT_COLOURS = {"walk": ORANGE, "run": BLUE}
GAIT_LINES = {"walk": "-", "run": "--"}
LEAST, MOST = 1e-2, 1e1
"""Range of the colours [bars]."""


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def draw_map(published: Published, data: Mapping[str, Any]) -> Any:
    """Every row with a bar against every parameter: change in bars, white where there is none."""
    from matplotlib.colors import LogNorm

    rows = {row: entry for row, entry in data["rows"].items() if entry["stiffness"]["bars"] is not None}
    bars = np.array(
        [[entry[parameter]["bars"] for parameter in LABELS] for entry in rows.values()], dtype=float
    )
    figure = _figure(7.5, 7.2)
    ax = figure.subplots()
    sizes = np.ma.masked_less(np.nan_to_num(np.abs(bars)), LEAST)
    image = ax.imshow(sizes, aspect="auto", cmap="YlOrBr", norm=LogNorm(LEAST, MOST))
    for (i, j), value in np.ndenumerate(bars):
        if abs(value) >= LEAST / 10:
            colour = "white" if abs(value) > MOST / 3 else "black"
            ax.text(j, i, f"{value:+.2g}", ha="center", va="center", fontsize=7, color=colour)
    ax.set_xticks(range(len(LABELS)), list(LABELS.values()))
    ax.xaxis.tick_top()
    ax.set_yticks(range(len(rows)), list(rows))
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    label = f"change for +{100 * data['part']:g} % of the parameter (ground: +1 mm), in bars [-]"
    figure.colorbar(image, ax=ax, label=label, location="bottom", shrink=0.6, aspect=40, extend="max")
    return figure


def draw_sweeps(published: Published, data: Mapping[str, Any]) -> Any:
    """Ground level; stiffness with the level that keeps the walking peak; friction; its upper threshold."""
    figure = _figure(7.5, 5.6)
    (level, stiff), (friction, fast) = figure.subplots(2, 2)
    for key, ratios in data["level"]["peaks"].items():
        gait, condition = key.split(".")
        level.plot(
            data["level"]["rise_mm"],
            ratios,
            color=CONDITION_COLOURS[condition],
            ls=GAIT_LINES[gait],
            lw=1.2,
            label=f"{GAITS[gait].lower()}, {condition}",
        )
    level.set(xlabel="rise of the ground [mm]", ylabel="peak over the published peak [-]", ylim=(0, None))
    level.set_xlim(min(data["level"]["rise_mm"]), max(data["level"]["rise_mm"]))
    level.legend(fontsize=7)
    factors = [entry["factor"] for entry in data["stiffness"]]
    for gait, condition in (
        ("walk", "elastic"),
        ("walk", "inelastic"),
        ("run", "elastic"),
        ("run", "inelastic"),
    ):
        name = f"{gait}.peak_{condition}"
        row = published.row(name)
        ratios = [entry["rows"].get(name, np.nan) / row.value for entry in data["stiffness"]]
        stiff.plot(
            factors, ratios, color=CONDITION_COLOURS[condition], ls=GAIT_LINES[gait], marker="o", ms=3, lw=1.2
        )
    stiff.set(xlabel="K over the preset's [-]", ylabel="peak over the published peak [-]")
    stiff.set_title("level moved to keep the elastic walking peak", fontsize=8)
    for gait, title in GAITS.items():
        style = {"color": GAIT_COLOURS[gait], "label": title.lower(), "ls": GAIT_LINES[gait], "lw": 1.6}
        friction.plot(data["friction"]["friction"], data["friction"]["by_friction"][gait], **style)
        fast.semilogx(data["friction"]["fast"], data["friction"]["by_fast"][gait], **style)
    mu = np.array(data["friction"]["friction"])
    friction.plot(mu, np.sqrt(1 + mu**2), color="black", lw=0.8, ls=":", label="full slip")
    friction.set(xlabel="friction coefficient μ [-]", ylabel="resultant over normal peak [-]", xlim=(0, 1))
    fast.set(xlabel="upper threshold of friction [m/s]", ylabel="resultant over normal peak [-]")
    fast.axhline(np.sqrt(1 + data["parameters"]["friction"] ** 2), color="black", lw=0.8, ls=":")
    for ax, name in ((friction, "friction"), (fast, "friction_fast")):
        ax.axvline(data["parameters"][name], color=GREY, lw=0.7, ls="--", label="preset")
    friction.legend()
    return figure
