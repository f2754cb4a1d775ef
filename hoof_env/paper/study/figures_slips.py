"""Figures of the part 'slips': what the letter of Eqs. 8, 11 and 15 does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hoof_env.paper.figure_style import BLUE, GREY, ORANGE, PURPLE
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.study.slips_contact import NAMES, Traces, force_in_the_air
from hoof_env.paper.study.slips_friction import literal_friction

if TYPE_CHECKING:
    from hoof_env.ground.contact import Ground
    from hoof_env.paper.study.slips_motion import Drift

CASES = {"read": BLUE, "printed": ORANGE, "printed, probable beta": PURPLE}
LABELS = {
    "read": "γ as read, printed β",
    "printed": "γ as printed, printed β",
    "printed, probable beta": "γ as printed, probable β",
}


def draw_drift(cycles: Mapping[tuple[str, str], Drift]) -> Any:
    """Crank error and largest joint gap over time under gamma as read and as printed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, (gait, name) in enumerate(NAMES.items()):
        for case, colour in CASES.items():
            cycle = cycles[gait, case]
            label = LABELS[case]
            axes[0, column].plot(cycle.t, np.degrees(cycle.crank), color=colour, label=label)
            axes[1, column].plot(cycle.t, 1000 * cycle.gap, color=colour)
        axes[0, column].set(title=name.capitalize())
        axes[1, column].set(xlabel="time [s]", xlim=(0, 1))
    axes[0, 0].set_ylabel("crank angle error [deg]")
    axes[1, 0].set_ylabel("widest joint gap [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def draw_literal_forces(traces: Traces, ground: Ground) -> Any:
    """Normal force by the letter of Eq. 11, friction by that of Eq. 15, beside those read; elastic."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    axes = figure.subplots(2, 2)
    for column, (gait, name) in enumerate(NAMES.items()):
        trace = traces[gait, "elastic"]
        stance = measure_stance(trace)
        above, below = axes[:, column]
        above.plot(trace["t"], trace["normal"] / 1000, color=BLUE, label="as read")
        above.plot(trace["t"], force_in_the_air(trace, ground) / 1000, color=ORANGE, label="by the letter")
        above.axvspan(stance.start, stance.end, color=GREY, alpha=0.12, lw=0, label="hoof in the ground")
        above.set(title=f"{name.capitalize()}: Eq. 11", xlim=(0, 1), ylim=(0, None), xlabel="time [s]")
        below.plot(trace["t"], trace["friction"] / 1000, color=BLUE)
        below.plot(trace["t"], literal_friction(trace) / 1000, color=ORANGE)
        below.axhline(0, color=GREY, lw=0.6)
        margin = 0.1 * (stance.end - stance.start)
        below.set(
            title=f"{name.capitalize()}: Eq. 15",
            xlim=(stance.start - margin, stance.end + margin),
            xlabel="time [s]",
        )
    axes[0, 0].set_ylabel("normal force [kN]")
    axes[1, 0].set_ylabel("friction, forward [kN]\n(letter: kN m/s)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
