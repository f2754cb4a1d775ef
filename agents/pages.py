"""Parts of a page about one training: the picture of its learning curve, its length, and the templates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from agents import runs
from agents.experiments.training import CURVE, read_curve
from hoof_env._plotting import BLUE, GREEN, GREY, ORANGE, STYLE
from hoof_env.demo import report
from hoof_env.evaluation.scores import Score

TEMPLATES = Path(__file__).with_name("templates")

BINS = 60  # groups of training episodes in the picture


def draw_learning_curve(folder: Path, scores: Sequence[Score], path: Path, **options: Any) -> None:
    """Draw the learning curve of a run folder.

    It shows the training episodes, the scores on the way if there is a curve.csv, the trained policy, which
    is the first of `scores`, and the means of the others.

    Args:
        folder: run folder of agents.train.
        scores: the trained policy, then policies to compare with.
        path: file of the picture.
        **options: options of `Figure.savefig`.
    """
    episodes = runs.read_episodes(folder)
    # Equal numbers of episodes: short trainings have fewer bins
    bins = [part for part in np.array_split(episodes, BINS) if len(part)]
    with matplotlib.rc_context({**STYLE, "font.size": 10}):
        figure = Figure(figsize=(7, 3.6), layout="constrained")
        axes = figure.subplots()
        if bins:
            steps = [1e-6 * part[:, 0].mean() for part in bins]
            low, middle, high = np.transpose([np.quantile(part[:, 1], (0.1, 0.5, 0.9)) for part in bins])
            axes.fill_between(
                steps, low, high, color=BLUE, alpha=0.2, lw=0, label="80 % of training episodes"
            )
            axes.plot(steps, middle, color=BLUE, lw=1.5, label="their median")
        if curve := read_curve(folder / CURVE):
            points = [(1e-6 * row["steps"], row["return"]) for row in curve]
            axes.plot(*zip(*points, strict=True), color=GREEN, lw=1, label="without noise on the way")
        policy, *others = [(score.policy, score.estimates["return"].mean) for score in scores]
        label = f"this policy, without noise: {policy[1]:.1f}"
        axes.plot(1e-6 * training_length(folder)["steps"], policy[1], "o", color=GREEN, label=label)
        for _, level in others:
            axes.axhline(level, color=ORANGE, lw=1, ls="--")
        height = 0.065 * np.ptp(axes.get_ylim())  # height of a line of text
        below = -np.inf
        # From the lowest up, each label at least a line above the one before
        for name, level in sorted(others, key=lambda one: one[1]):
            below = max(level, below + height)
            axes.annotate(
                f"{name} {level:.1f}",
                (1, below),
                (4, 0),
                xycoords=axes.get_yaxis_transform(),
                textcoords="offset points",
                va="center",
                color=ORANGE,
            )
        axes.set(xlabel="environment steps [millions]", ylabel="return of an episode")
        axes.set_xlim(left=0)
        axes.grid(axis="y", color=GREY, alpha=0.15)
        figure.legend(loc="outside upper left", ncols=2)
        figure.savefig(path, **options)


def render_template(file: str, /, **values: Any) -> str:
    """Fill a file of agents/templates, see `hoof_env.demo.report.render_template`."""
    return report.render_template(TEMPLATES / file, **values)


def training_length(folder: Path) -> dict[str, float]:
    """Return the "steps" and the "seconds" of a training, up to its last episode if it is not finished."""
    if finished := runs.read_record(folder).get("finished"):
        return {"steps": int(finished["steps"]), "seconds": float(finished["seconds"])}
    episodes = runs.read_episodes(folder)
    steps, seconds = (int(episodes[-1, 0]), float(episodes[:, 2].max())) if len(episodes) else (0, 0.0)
    return {"steps": steps, "seconds": seconds}
