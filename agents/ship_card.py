"""The model card of a shipped policy and its learning curve."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agents import runs
from agents.evaluate import METRICS, Score, cell
from agents.page import TEMPLATES, read_curve
from hoof_env.envs.tasks import TASKS
from hoof_env.errors import DataFileError
from hoof_env.records import setting

if TYPE_CHECKING:
    from agents.ship import Choice

SHOWN = ("return", "distance_m", "stance_peak_n", "weight_share", "cost_of_transport", "failed")
"""Columns of the card's table, keys of `METRICS`."""

BINS = 60
"""Of training episodes in the picture of the curve."""


def write_card(
    folder: Path,
    env_id: str,
    record: dict[str, Any],
    score: dict[str, Any],
    scores: Sequence[Score],
    choice: Choice,
) -> None:
    """Write card.md into `folder`, from run.json, config.yml and score.json."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    keys = [key for key in SHOWN if key in scores[0].estimates]
    template = Environment(
        loader=FileSystemLoader(TEMPLATES), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    ).get_template("model_card.md.j2")
    with runs.make_env(env_id) as env:
        suspended = setting(env).trunk == "suspended"
    steps, seconds = length(choice.saved.path.parent, record)
    text = template.render(
        env_id=env_id,
        name=env_id.rpartition("/")[2],
        summary=summary(env_id),
        trained_on=record.get("trained_on", env_id),
        record=record,
        steps=steps,
        seconds=seconds,
        settings=(folder / "config.yml").read_text(encoding="utf-8").strip(),
        score=score,
        spread=float(np.std(score["returns"])),
        titles=[METRICS[key].title.replace("\n", " ") for key in keys],
        rows=[
            (one.policy, [" ".join(cell(METRICS[key], one.estimates[key])) for key in keys]) for one in scores
        ],
        estimates={one.policy: one.estimates for one in scores},
        choice=choice,
        suspended=suspended,
        files={file.name: file.stat().st_size for file in sorted(folder.iterdir())},
    )
    (folder / "card.md").write_text(text, encoding="utf-8")


def summary(env_id: str) -> str:
    """One line about an environment."""
    tasks = {task.id: task.summary for task in TASKS.values()}
    with runs.make_env(env_id) as env:
        line = tasks.get(env_id) or (type(env.unwrapped).__doc__ or "").partition("\n")[0]
    return line


def write_index(folder: Path) -> None:
    """Write README.md, the table of the policies in `folder`."""
    lines = [
        "# Trained policies", "",
        "One for each id, made by `python -m agents.ship`; docs/policies.md says how to use them.",
        "Mean returns in the same episodes, and the bootstrap's 95 % interval.", "",
        "| id | policy | return | open-loop | run | card |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for path in sorted(folder.glob("*/score.json")):
        score = json.loads(path.read_text(encoding="utf-8"))
        record = json.loads(path.with_name("run.json").read_text(encoding="utf-8"))
        cells = []
        for name in ("policy", "open-loop", "run"):
            one = score["policies"].get(name)
            low, high = one["interval95"]["return"] if one else (0, 0)
            cells.append(f"{one['mean']['return']:.2f} [{low:.2f}, {high:.2f}]" if one else "")
        card = f"[card]({path.parent.name}/card.md)"
        lines.append(f"| `{score['env_id']}` | {record['algo'].upper()} | {' | '.join(cells)} | {card} |")
    runs.write_text(folder / "README.md", "\n".join(lines) + "\n")


def length(folder: Path, record: dict[str, Any]) -> tuple[int, float]:
    """Environment steps and seconds of wall time of a training."""
    finished = record.get("finished") or {}
    with (folder / "monitor.csv").open(encoding="utf-8", newline="") as file:
        next(file)  # a comment
        rows = [(int(row["l"]), float(row["t"])) for row in csv.DictReader(file)]
    steps, seconds = sum(steps for steps, _ in rows), max((t for _, t in rows), default=0.0)
    return int(finished.get("steps", steps)), float(finished.get("seconds", seconds))


def write_curve(folder: Path, scores: Sequence[Score], path: Path) -> None:
    """Draw the training episodes of a run folder, the scores on the way where it has a curve.csv, the policy
    (the first of the scores) and the means of the gaits.

    Raises:
        DataFileError: no episode ended in that training.
    """
    import matplotlib
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREEN, GREY, ORANGE, STYLE

    bins = [part for part in np.array_split(read_curve(folder / "monitor.csv"), BINS) if len(part)]
    if not bins:
        raise DataFileError(
            f"run {folder}: expected a training in which episodes end, got none in monitor.csv"
        )
    steps = [1e-6 * part[:, 0].mean() for part in bins]
    low, middle, high = np.transpose([np.quantile(part[:, 1], (0.1, 0.5, 0.9)) for part in bins])
    with matplotlib.rc_context({**STYLE, "font.size": 10}):
        figure = Figure(figsize=(7, 3.6), layout="constrained")
        axes = figure.subplots()
        axes.fill_between(steps, low, high, color=BLUE, alpha=0.2, lw=0, label="80 % of training episodes")
        axes.plot(steps, middle, color=BLUE, lw=1.5, label="their median")
        if (folder / "curve.csv").is_file():
            with (folder / "curve.csv").open(encoding="utf-8", newline="") as file:
                scored = [(1e-6 * float(row["steps"]), float(row["return"])) for row in csv.DictReader(file)]
            axes.plot(*zip(*scored, strict=True), color=GREEN, lw=1, label="without noise on the way")
        here = scores[0].estimates["return"].mean
        axes.plot(
            1e-6 * length(folder, runs.read_record(folder))[0],
            here,
            "o",
            color=GREEN,
            label=f"this policy, without noise: {here:.1f}",
        )
        for score in scores[1:]:
            level = score.estimates["return"].mean
            axes.axhline(level, color=ORANGE, lw=1, ls="--")
            axes.annotate(
                f"{score.policy} {level:.1f}", (1, level), (4, 0), xycoords=axes.get_yaxis_transform(),
                textcoords="offset points", va="center", color=ORANGE,
            )  # fmt: skip
        axes.set(xlabel="environment steps [millions]", ylabel="return of an episode")
        axes.set_xlim(left=0)
        axes.grid(axis="y", color=GREY, alpha=0.15)
        figure.legend(loc="outside upper left", ncols=2)
        figure.savefig(path, dpi=90, metadata={"Software": None})
