"""Pictures of the judges: force curves, footfall, and figures over speed beside horses'."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.judges import of_speeds, read_judges
from hoof_env.tasks.horse_gaits import LEGS, PAIRS

Floats = NDArray[np.float64]
Figures = dict[str, list[dict[str, Any]]]


def shape_of(froude: float, pair: str) -> Floats | None:
    """Return the normal force of a horse over its stance [N/kg], shape (101,); None at other speeds than its
    own.

    It has the form of Alexander & Jayes (1978, J. Zool. 185:27), cos x - q cos 3x, scaled to the published
    peak: with two peaks (q = 0.4) at a walk, half a sine at a trot.
    """
    judges = read_judges()
    for gait, q in (("walk", 0.4), ("trot", 0.0)):
        if abs(froude - judges[gait]["froude"]) < 0.01:
            x = np.linspace(-0.5, 0.5, 101) * np.pi
            shape = np.cos(x) - q * np.cos(3 * x)
            return judges[gait][f"peak_{pair}"]["horse"] * shape / shape.max()
    return None


def forces(figures: Figures, shown: list[dict[str, Any]]) -> Any:
    """Draw the normal force over the stance of all policies, at each speed that is shown."""
    from matplotlib.figure import Figure

    picture = Figure((3.0 * len(shown), 5.2), layout="constrained")
    axes = picture.subplots(2, len(shown), sharex=True, sharey=True, squeeze=False)
    for column, gait in enumerate(shown):
        for row, pair in enumerate(PAIRS):
            for gaits in figures.values():
                # A policy that falls at this speed has no curves
                match = next((g for g in gaits if g["speed"] == gait["speed"] and "curves" in g), None)
                if match and match["curves"][pair]:
                    axes[row, column].plot(match["curves"][pair], lw=1.2, color=f"C{row}", alpha=0.8)
            if (shape := shape_of(gait["froude"], pair)) is not None:
                axes[row, column].plot(shape, "k--", lw=1, label="horse, idealised")
                axes[row, column].legend(fontsize=7)
            axes[row, column].grid(alpha=0.3)
        duty = f", duty {gait['duty_fore']:.2f} / {gait['duty_hind']:.2f}" if len(figures) == 1 else ""
        axes[0, column].set_title(f"Fr {gait['froude']:.2f}{duty}", fontsize=9)
        axes[1, column].set_xlabel("stance [%]")
    for row, pair in enumerate(PAIRS):
        axes[row, 0].set_ylabel(f"{pair}: normal force [N/kg]")
    return picture


def footfall(shown: list[dict[str, Any]]) -> Any:
    """Draw the stances of each leg over two strides."""
    from matplotlib.figure import Figure

    picture = Figure((2.6 * len(shown), 1.9), layout="constrained")
    for axis, gait in zip(picture.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        for leg, began, ended in gait["footfall"]:
            # The first leg on top, as the labels are
            axis.barh(len(LEGS) - leg, ended - began, left=began, height=0.6, color=f"C{leg // 2}")
        axis.set_yticks(range(len(LEGS), 0, -1), [name.replace("_", " ") for name in LEGS], fontsize=8)
        axis.set_ylim(0.4, len(LEGS) + 0.6)
        axis.set_title(f"Fr {gait['froude']:.2f}", fontsize=9)
        axis.set_xlabel("time [s]")
    return picture


def speeds(figures: Figures) -> Any:
    """Draw lag, duty factor and cost of transport over the Froude number reached."""
    from matplotlib.figure import Figure

    picture = Figure((10, 3.2), layout="constrained")
    lag, duty, cost = picture.subplots(1, 3)
    for name, gaits in figures.items():
        good = [gait for gait in gaits if "lag" in gait]
        label = Path(name).name
        froude = [gait["froude_reached"] for gait in good]
        lag.plot(froude, [min(gait["lag"], 0.5 - gait["lag"]) for gait in good], "o-", ms=3, label=label)
        for pair, style in zip(PAIRS, ("o-", "s--"), strict=True):
            duty.plot(froude, [gait[f"duty_{pair}"] for gait in good], style, ms=3, label=f"{label}, {pair}")
        cost.plot(froude, [gait["transport"] for gait in good], "o-", ms=3)
    judges = read_judges()
    walk = judges["walk"]
    trots = of_speeds(judges["duty"])
    duty.plot([at for at, _ in trots], [judge["horse"][0] for _, judge in trots], "k*", label="horses, trot")
    lag.plot([walk["froude"]], [walk["lag"]["horse"]], "k*", label="horses, walk")
    duty.plot([walk["froude"]], [walk["duty"]["horse"]], "k^", label="horses, walk")
    names = {lag: "lag of hind to fore [strides]", duty: "duty factor [-]", cost: "cost of transport [-]"}
    for panel, label in names.items():
        panel.set_xlabel("Froude number reached [-]")
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
    if len(figures) <= 3:
        lag.legend(fontsize=7)
        duty.legend(fontsize=7)
    return picture


def draw(figures: Figures, out: Path) -> None:
    """Draw force curves at each speed at which watched episodes of the first policy stay up, its footfall
    there, and figures over speed; draw nothing if there is no such speed."""
    shown = [gait for gait in next(iter(figures.values())) if gait.get("footfall")]
    if not shown:
        return print("no pictures: the first policy falls at every speed")
    pictures = {"forces": forces(figures, shown), "footfall": footfall(shown), "speeds": speeds(figures)}
    for name, picture in pictures.items():
        picture.savefig(out / f"{name}.png", dpi=110)
