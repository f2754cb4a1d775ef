"""How learned gaits answer a commanded speed and the stiffness of the ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents.baselines_plan import LEG
from agents.impact import GAIT, mean_figures, watch
from agents.tradeoff_plan import SPEED, Plan
from hoof_env.envs.tasks import Settings

Figures = Mapping[str, float]


@dataclass(frozen=True)
class Answer:
    """A gait in some circumstance.

    Attributes:
        gait: who moves: "learned", or the name of a gait that does not see.
        seed: of its training, -1 without.
        asked: commanded speed [m/s], or factor of the stiffness.
        figures: `agents.impact.mean_figures` in SI units.
    """

    gait: str
    seed: int
    asked: float
    figures: Figures


def told_speeds(folders: Sequence[Path], plan: Plan, tick: Callable[[], Any]) -> list[Answer]:
    """Policies of `HorseLegSpeed-v0` that are told one speed for a whole episode."""
    return [
        Answer(
            "learned", seed, speed,
            mean_figures(watch(str(folder), SPEED, plan.seeds, tick, target_speed=[speed, speed])),
        )
        for seed, folder in enumerate(folders)
        for speed in plan.speeds
    ]  # fmt: skip


def grounds(folders: Sequence[Path], plan: Plan, tick: Callable[[], Any]) -> list[Answer]:
    """Policies of the default reward, the paper's run and the best open-loop gait on softer and harder
    ground than that of the training."""
    usual = Settings().stiffness
    players = [("learned", seed, str(folder)) for seed, folder in enumerate(folders)]
    players += [(name, -1, name) for name in ("run", "open-loop")]
    return [
        Answer(gait, seed, by, mean_figures(watch(policy, LEG, plan.seeds, tick, stiffness=by * usual)))
        for gait, seed, policy in players
        for by in plan.factors
    ]


def answer_table(answers: Sequence[Answer], title: str) -> str:
    """Means over seeds."""
    lines = [f"| gait | {title} | {' | '.join(name for name, _ in GAIT.values())} | failed |"]
    lines.append("|---|" + "---|" * (len(GAIT) + 2))
    for gait, asked in dict.fromkeys((one.gait, one.asked) for one in answers):
        some = [one.figures for one in answers if (one.gait, one.asked) == (gait, asked)]
        cells = [as_text(_known([one[key] for one in some]) * factor) for key, (_, factor) in GAIT.items()]
        lines.append(
            f"| {gait} | {asked:g} | {' | '.join(cells)} | {np.mean([one['failed'] for one in some]):.2g} |"
        )
    return "\n".join(lines)


def _known(values: Sequence[float]) -> float:
    known = [x for x in values if np.isfinite(x)]
    return float(np.mean(known)) if known else float("nan")


def as_text(value: float) -> str:
    """Three figures; a dash for what is not known."""
    return "-" if not np.isfinite(value) else f"{value:.3g}"


PANELS = (
    ("speed", "speed [m/s]", 1.0),
    ("crank_speed", "crank speed [rad/s]", 1.0),
    ("swing_offset", "swing offset [rad]", 1.0),
    ("swing_amplitude", "swing amplitude [rad]", 1.0),
    ("peak", "stance peak [body weights]", None),
    ("loading_rate", "loading rate [kN/s]", 1e-3),
    ("duty_factor", "duty factor [-]", 1.0),
    ("stances", "stances per second [1/s]", 1.0),
)
"""Key, label and factor of the panels; None: over the weight."""


def draw_answers(answers: Sequence[Answer], weight: float, label: str, is_log: bool, path: Path) -> None:
    """How gaits answer: a line for each, means over seeds, with each seed as a dot."""
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREY, ORANGE, PURPLE

    figure = Figure(figsize=(11, 5), layout="constrained")
    asked = sorted({one.asked for one in answers})
    gaits = dict.fromkeys(one.gait for one in answers)
    names = {"learned": "learned", "run": "paper's run", "open-loop": "open-loop gait of highest return"}
    for axes, (key, title, factor) in zip(figure.subplots(2, 4, sharex=True).flat, PANELS, strict=True):
        factor = 1 / weight if factor is None else factor
        for gait, colour in zip(gaits, (BLUE, PURPLE, ORANGE), strict=False):
            own = [one for one in answers if one.gait == gait]
            means = [factor * _known([one.figures[key] for one in own if one.asked == x]) for x in asked]
            axes.plot(asked, means, "-", color=colour, lw=1.6, label=names[gait])
            axes.plot(
                [one.asked for one in own],
                [factor * one.figures[key] for one in own],
                ".",
                color=colour,
                ms=4,
            )
            if key == "crank_speed" and gait == "learned":
                for part, style in (("crank_stance", "--"), ("crank_swing", ":")):
                    line = [_known([one.figures[part] for one in own if one.asked == x]) for x in asked]
                    name = {"crank_stance": "in stance", "crank_swing": "in swing"}[part]
                    axes.plot(asked, line, style, color=colour, lw=1.2, label=f"learned, {name}")
        if key == "speed" and not is_log:
            axes.plot(asked, asked, color=GREY, lw=0.8, ls="--")
            axes.annotate("as told", (asked[-1], asked[-1]), ha="right", va="bottom", color=GREY, fontsize=8)
        if is_log:
            axes.set_xscale("log", base=2)
            axes.set_xticks(asked, [f"{x:g}" if x >= 1 else f"1/{1 / x:g}" for x in asked])
            axes.minorticks_off()
        axes.set_ylabel(title)
        axes.grid(color=GREY, alpha=0.15)
        if title != PANELS[2][1]:
            axes.set_ylim(bottom=0)
    for axes in figure.axes[-4:]:
        axes.set_xlabel(label)
    handles, labels = figure.axes[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.savefig(path, dpi=120)
