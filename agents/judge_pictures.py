"""Pictures of the judges: force curves, footfall, and figures over speed beside horses'.

Pictures are 800 pixels wide, as front pages show them, and have letters of 12 pixels at least.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.judges import of_speeds, read_judges
from hoof_env.tasks.horse_gaits import LEGS, PAIRS

Floats = NDArray[np.float64]
Figures = dict[str, list[dict[str, Any]]]

WIDTH = 800  # [pixels]
DPI = 100
LETTERS = 12 * 72 / DPI  # 12 pixels [points]
ABREAST = 4  # gaits side by side at most
COLOURS = {"fore": "#0072B2", "hind": "#CC79A7"}


def ranges_of(kind: str, froude: float) -> dict[str, dict[str, Any]]:
    """Return published ranges of a walk's or a trot's stance peaks, by pair: "bands", pairs of values of the
    normal force, and "lines", values of the horizontal force, negative ones braking [N/kg].

    A walk's lines are published for fore legs of foals, at the Froude number, and for no hind leg.
    """
    judges = read_judges()
    found: dict[str, dict[str, Any]] = {pair: {"bands": [], "lines": []} for pair in PAIRS}
    for name, judge in judges[kind].items():
        pair = name.removeprefix("peak_").removesuffix("_2")
        if name.startswith("peak_") and pair in PAIRS:
            found[pair]["bands"].append(judge["bar"])
    for sign, what in ((-1, "braking"), (1, "propulsion")):
        if kind == "trot":
            for pair in PAIRS:
                found[pair]["lines"].append(sign * judges["reported"][f"peak_{what}_{pair}"]["horse"])
        else:
            intercept, slope = judges["foals"]["walk"][f"peak_{what}_fore"]
            found["fore"]["lines"].append(sign * (intercept + slope * froude))
    return found


def kind_of(gait: dict[str, Any]) -> str:
    """Return "trot" for a gait with the lag of a trot at a speed at which horses trot, else "walk"."""
    slowest = read_judges()["reported"]["walk_to_trot"]["horse"]
    is_trot = min(gait["lag"], 0.5 - gait["lag"]) < 0.05 and gait["froude_reached"] >= slowest
    return "trot" if is_trot else "walk"


def panels(shown: list[dict[str, Any]], rows: int, height: float, **shared: Any) -> tuple[Any, list[Any]]:
    """Return a figure and the axes of each gait, shape (rows,); `height` is a row's [inches]."""
    from matplotlib.figure import Figure

    blocks = -(-len(shown) // ABREAST)
    picture = Figure((WIDTH / DPI, height * rows * blocks), dpi=DPI, layout="constrained")
    columns = min(len(shown), ABREAST)
    axes = picture.subplots(rows * blocks, columns, squeeze=False, **shared)
    of_gaits = []
    for k in range(columns * blocks):
        block, column = divmod(k, columns)
        of_gait = axes[block * rows : (block + 1) * rows, column]
        for axis in of_gait:
            axis.tick_params(labelsize=LETTERS)
            axis.set_visible(k < len(shown))
        of_gaits.append(of_gait)
    return picture, of_gaits[: len(shown)]


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
    """Draw normal and horizontal force over the stance of all policies, at each speed that is shown.

    Bands are published ranges of stance peaks, dashed lines published peaks without a spread, and dotted
    curves idealised ones of horses.
    """
    picture, each = panels(shown, 2, 2.1, sharex=True, sharey="row")
    for k, (gait, (up, forward)) in enumerate(zip(shown, each, strict=True)):
        for gaits in figures.values():
            # A policy that falls at this speed has no curves
            match = next((g for g in gaits if g["speed"] == gait["speed"] and "curves" in g), None)
            for axis, name in ((up, "curves"), (forward, "pushes")):
                for pair in PAIRS:
                    if match and match.get(name, {}).get(pair):
                        axis.plot(match[name][pair], lw=1.4, color=COLOURS[pair], label=pair)
        if "froude_reached" in gait:
            ranges = ranges_of(kind_of(gait), gait["froude_reached"])
            for pair in PAIRS:
                for low, high in ranges[pair]["bands"]:
                    up.axhspan(low, high, color=COLOURS[pair], alpha=0.15, lw=0)
                for value in ranges[pair]["lines"]:
                    forward.axhline(value, color=COLOURS[pair], ls="--", lw=1)
        for pair in PAIRS:
            if (shape := shape_of(gait["froude"], pair)) is not None:
                up.plot(shape, ":", lw=1.2, color=COLOURS[pair])
        for axis in (up, forward):
            axis.grid(alpha=0.3)
        duty = f"\nduty {gait['duty_fore']:.2f}, {gait['duty_hind']:.2f}" if len(figures) == 1 else ""
        up.set_title(f"Fr {gait.get('froude_reached', gait['froude']):.2f}{duty}", fontsize=LETTERS)
        forward.set_xlabel("stance [%]", fontsize=LETTERS)
        if k % ABREAST == 0:
            up.set_ylabel("up [N/kg]", fontsize=LETTERS)
            forward.set_ylabel("forward [N/kg]", fontsize=LETTERS)
    handles, labels = each[0][0].get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    picture.legend(named.values(), named, loc="outside lower center", ncols=2, fontsize=LETTERS)
    return picture


def footfall(shown: list[dict[str, Any]]) -> Any:
    """Draw the stances of each leg over two strides."""
    picture, each = panels(shown, 1, 1.9)
    for k, (gait, (axis,)) in enumerate(zip(shown, each, strict=True)):
        for leg, began, ended in gait["footfall"]:
            # The first leg on top, as the labels are
            colour = COLOURS[PAIRS[leg // 2]]
            axis.barh(len(LEGS) - leg, ended - began, left=began, height=0.6, color=colour)
        letters = ["".join(word[0].upper() for word in name.split("_")) for name in LEGS]
        axis.set_yticks(range(len(LEGS), 0, -1), letters if k % ABREAST == 0 else [""] * len(LEGS))
        axis.set_ylim(0.4, len(LEGS) + 0.6)
        axis.set_title(f"Fr {gait.get('froude_reached', gait['froude']):.2f}", fontsize=LETTERS)
        axis.set_xlabel("time [s]", fontsize=LETTERS)
    return picture


def speeds(figures: Figures) -> Any:
    """Draw lag, duty factor and cost of transport over the Froude number reached."""
    from matplotlib.figure import Figure

    picture = Figure((WIDTH / DPI, 3.2), dpi=DPI, layout="constrained")
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
    names = {lag: "lag of hind to fore [strides]", duty: "duty factor [-]", cost: "mechanical transport [-]"}
    for panel, label in names.items():
        panel.set_xlabel("Froude number", fontsize=LETTERS)
        panel.set_ylabel(label, fontsize=LETTERS)
        panel.tick_params(labelsize=LETTERS)
        panel.grid(alpha=0.3)
    if len(figures) <= 3:
        lag.legend(fontsize=LETTERS)
        duty.legend(fontsize=LETTERS)
    return picture


def draw(figures: Figures, out: Path) -> None:
    """Draw force curves at each speed at which watched episodes of the first policy stay up, its footfall
    there, and figures over speed; draw nothing if there is no such speed."""
    shown = [gait for gait in next(iter(figures.values())) if gait.get("footfall")]
    if not shown:
        return print("no pictures: the first policy falls at every speed")
    pictures = {"forces": forces(figures, shown), "footfall": footfall(shown), "speeds": speeds(figures)}
    for name, picture in pictures.items():
        picture.savefig(out / f"{name}.png", dpi=DPI)
