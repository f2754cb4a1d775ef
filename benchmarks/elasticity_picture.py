"""Picture of docs/elasticity.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.elasticity_runs import GAITS, HELD, MASSES, PAPER_LAW, SETUPS
from hoof_env._plotting import (
    AMBER,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    STYLE,
    check_matplotlib,
    save_png,
)
from hoof_env.ground.laws import FACTORS, NORMAL_LAWS

COLOURS = dict(zip(NORMAL_LAWS, (ORANGE, AMBER, GREEN, SKY, PURPLE, BLUE, GREY), strict=True))
MARKS = dict(zip(NORMAL_LAWS, "osD^v<P", strict=True))
MIDDLE = 0.5
"""Restitution at which all laws are compared."""


def draw(data: dict[str, Any], path: Path) -> None:
    """Draw the change over set-ups, masses and restitutions."""
    check_matplotlib()
    import matplotlib.pyplot as plt

    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(2, 2, figsize=(10, 7.6), layout="constrained")
        for gait, axis in zip(GAITS, axes[0], strict=True):
            _over_setups(axis, data, gait)
        axes[0, 0].legend(loc="upper left", fontsize=7.5)
        _over_mass(axes[1, 0], data)
        _over_restitution(axes[1, 1], data)
        for axis in axes.flat:
            axis.axhline(0.0, color="black", lw=0.8)
            axis.set_ylabel("elastic against inelastic peak [%]")
        save_png(figure, path)
        plt.close(figure)


def _value(row: dict[str, Any]) -> float:
    """Return the change of a landing, under a held trunk the median over the ground's level."""
    return float(row["median"] if row["setup"] in HELD else row["change"])


def _over_setups(axis: Any, data: dict[str, Any], gait: str) -> None:
    rows = [row for row in data["landings"] if row["gait"] == gait]
    places = range(len(SETUPS))

    def values(law: str, restitution: float) -> list[float]:
        chosen = {
            row["setup"]: row for row in rows if row["law"] == law and row["restitution"] == restitution
        }
        return [_value(chosen[name]) for name in SETUPS]

    for law in NORMAL_LAWS:
        axis.plot(
            places, values(law, MIDDLE), MARKS[law], ls="-", lw=0.7, ms=4, color=COLOURS[law],
            label=f"{law}, restitution {MIDDLE:g}",
        )  # fmt: skip
    axis.plot(places, values(PAPER_LAW, 0.0), "o-", color="black", lw=2, label=f"{PAPER_LAW}, restitution 0")
    if gait == "walk":
        exact = next(
            row["change"]
            for row in rows
            if (row["setup"], row["law"], row["restitution"]) == ("fixed", PAPER_LAW, 0.0)
        )
        axis.plot([0, 1], [exact, exact], "k*", ms=10, label="the same, at the paper's level alone")
    axis.set_xticks(places, [name.replace(", ", "\n") for name in SETUPS])
    axis.set_ylim(-85, 100)
    axis.set_title(f"{gait}, one landing, by set-up of the trunk")


def _over_mass(axis: Any, data: dict[str, Any]) -> None:
    for gait, colour in zip(GAITS, (BLUE, ORANGE), strict=True):
        rows = [row for row in data["masses"] if row["gait"] == gait]
        axis.semilogx(MASSES, [row["change"] for row in rows], "o-", color=colour, label=gait)
        held = next(
            row["change"]
            for row in data["landings"]
            if (row["gait"], row["setup"], row["law"], row["restitution"]) == (gait, "fixed", PAPER_LAW, 0.0)
        )
        axis.axhline(held, color=colour, lw=1, ls=":")
        axis.text(MASSES[0], held + 1.5, f"{gait}, fixed trunk", color=colour, fontsize=8)
    free = next(
        row["change"] for row in data["free_mass"] if (row["law"], row["restitution"]) == (PAPER_LAW, 0.0)
    )
    axis.axhline(free, color=GREY, lw=1, ls="--")
    axis.text(MASSES[-1], free + 1.5, "a free mass without a leg", color=GREY, fontsize=8, ha="right")
    axis.set_xlabel("mass of a trunk that is free and in balance [kg]")
    axis.set_title("the paper's law, restitution 0, over the mass of the trunk")
    axis.legend(loc="center right")


def _over_restitution(axis: Any, data: dict[str, Any]) -> None:
    returned = {
        (row["law"], row["restitution"]): (row["delivered"], row["change"]) for row in data["free_mass"]
    }
    lines = {"fixed": ORANGE, "suspended": BLUE, "free": GREEN}
    for name, colour in lines.items():
        found = sorted(
            (returned[row["law"], row["restitution"]][0], _value(row), row["law"])
            for row in data["landings"]
            if row["gait"] == "run" and row["setup"] == name and row["law"] in FACTORS
        )
        axis.plot([x for x, _, _ in found], [y for _, y, _ in found], color=colour, lw=1, label=name)
        for x, y, law in found:
            axis.plot(x, y, MARKS[law], color=colour, ms=4)
    curve = np.array(sorted(returned.values()))
    axis.plot(*curve.T, "--", color=GREY, lw=1, label="a free mass without a leg")
    axis.axvline(returned[PAPER_LAW, 0.0][0], color="black", lw=0.8, ls=":")
    paper = returned[PAPER_LAW, 0.0][0]
    axis.text(paper - 0.01, 30, "the paper's inelastic ground", fontsize=8, ha="right")
    axis.set_ylim(-105, 42)
    axis.set_xlim(1.02, -0.02)
    axis.invert_xaxis()
    axis.set_xlabel("restitution that the law returns in a free impact [-]")
    axis.set_title("run, all laws over what they return")
    axis.legend(loc="lower right")
