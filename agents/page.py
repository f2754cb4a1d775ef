"""The demonstration's report: one HTML file that holds its pictures and films and needs no network."""

from __future__ import annotations

import base64
import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import evaluate, runs
from agents.train import Trained
from hoof_env.paper.report import format_error, format_number
from hoof_env.paper.reproduce import SOLVERS, Reproduction

TEMPLATES = Path(__file__).parent / "templates"
MARKS = {True: "✓", False: "✗", None: ""}
GAIT_TITLES = {"walk": "Walking", "run": "Running", "both": "Both gaits"}
FIGURES = {
    "figure1": "Figure 1. The linkage: one crank turns fourteen links.",
    "figure3": "Figure 3. Paths of the hoof and the leg's postures through a stride.",
    "figure4": "Figure 4. The hoof's angle to the ground, heel up positive.",
    "figure5": "Figure 5. Normal force on elastic and inelastic ground.",
    "figure6": "Figure 6. Direction of the ground's force through stance.",
}
SMOOTHED = 64
"""Episodes in the running mean of the learning curve."""

Curve = NDArray[np.float64]
"""Of shape (episodes, 2): training steps done when an episode ended, and its return."""


@dataclass(frozen=True)
class Clip:
    """A film with its title and a line about it."""

    title: str
    caption: str
    path: Path


@dataclass(frozen=True)
class Cell:
    """What one solver gave for a published row, as text; `mark` is of `MARKS`."""

    value: str
    error: str
    mark: str


@dataclass(frozen=True)
class Row:
    """A published row as text, with one cell for each of `SOLVERS`."""

    id: str
    gait: str
    quantity: str
    unit: str
    published: str
    bar: str
    cells: list[Cell]


@dataclass(frozen=True)
class ClaimView:
    """A claim about shape, with the verdict of each of `SOLVERS` (see `Reproduction.shapes`)."""

    id: str
    claim: str
    reading: str
    verdicts: list[dict[str, Any]]


def rows(reproduction: Reproduction) -> list[Row]:
    """Every published row beside what each solver gave."""
    found = {(row["id"], row["solver"]): row for row in reproduction.rows}
    views = []
    for published in reproduction.published.rows:
        measured = [found[published.id, solver] for solver in SOLVERS]
        cells = [
            Cell(
                format_number(row["simulated"], row["unit"]),
                format_error(row, reproduction),
                MARKS[row["within_bar"]],
            )
            for row in measured
        ]
        value = format_number(published.value, published.unit)
        unit = "" if published.unit == "-" else published.unit
        views.append(
            Row(published.id, published.gait, published.quantity, unit, value, published.bar_text, cells)
        )
    return views


def claims(reproduction: Reproduction) -> list[ClaimView]:
    """Every claim about shape with every solver's verdict."""
    found = {(shape["id"], shape["solver"]): shape for shape in reproduction.shapes}
    return [
        ClaimView(claim.id, claim.claim, claim.reading, [found[claim.id, solver] for solver in SOLVERS])
        for claim in reproduction.published.claims
    ]


def read_curve(path: Path) -> Curve:
    """The learning curve in a training's monitor.csv, empty if no episode ended."""
    with path.open(encoding="utf-8", newline="") as file:
        next(file)  # a comment
        episodes = [(float(row["l"]), float(row["r"])) for row in csv.DictReader(file)]
    curve = np.array(episodes, dtype=float).reshape(-1, 2)
    curve[:, 0] = curve[:, 0].cumsum()
    return curve


def draw_curve(curve: Curve, scores: Sequence[evaluate.Score], labelled: Sequence[str]) -> bytes:
    """Return against training steps as SVG, with the mean returns of the `labelled` policies as lines."""
    import matplotlib
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREY, ORANGE, STYLE

    with matplotlib.rc_context({**STYLE, "font.size": 10}):
        figure = Figure(figsize=(9, 4.2), layout="constrained")
        axes = figure.subplots()
        steps, returns = curve.T
        axes.plot(steps, returns, ".", ms=3, color=BLUE, alpha=0.35, mew=0, label="one training episode")
        width = min(SMOOTHED, len(curve))
        if width:
            mean = np.convolve(returns, np.ones(width) / width, mode="valid")
            axes.plot(steps[width - 1 :], mean, color=BLUE, lw=2, label=f"mean of {width} episodes")
        for score in scores:
            if score.policy in labelled:
                level = score.estimates["return"].mean
                axes.axhline(level, color=ORANGE, lw=1.2, ls="--")
                axes.annotate(
                    f"scripted {score.policy} {level:.1f}", (1, level), (4, 0),
                    xycoords=axes.get_yaxis_transform(), textcoords="offset points",
                    va="center", color=ORANGE,
                )  # fmt: skip
        axes.set(xlabel="environment steps", ylabel="return of the episode")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
        axes.set_xlim(left=0)
        axes.grid(axis="y", color=GREY, alpha=0.15)
        figure.legend(loc="outside upper left", ncols=2, markerscale=3)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def data_uri(content: bytes, kind: str) -> str:
    """Content as a link that holds it; `kind` is its MIME type."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def render(
    *,
    reproduction: Reproduction,
    scores: Sequence[evaluate.Score],
    clips: Sequence[Clip],
    trained: Trained,
    curve: Curve,
    folder: Path,
    seeds: tuple[int, int],
    training_seed: int,
    quick: bool,
) -> str:
    """The report as HTML.

    Args:
        reproduction: of the paper. Its figures lie in `folder` as SVG.
        scores: of the policies, the trained one last; all played the episodes `seeds` (first, last).
        clips: films to show.
        trained: the training, which started from `training_seed`, and `curve` its episodes.
        quick: mark the report as one that only shows that everything works.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    keys = list(scores[0].estimates)
    gaits = sorted({run[0] for run in reproduction.traces})
    table = [
        (score.policy, [evaluate.cell(evaluate.METRICS[key], score.estimates[key]) for key in keys])
        for score in scores
    ]
    template = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    ).get_template("report.html.j2")  # fmt: skip
    return template.render(
        quick=quick,
        source=reproduction.published.source,
        geometry=reproduction.geometry,
        solvers=SOLVERS,
        rows=rows(reproduction),
        gait_titles=GAIT_TITLES,
        claims=claims(reproduction),
        marks=MARKS,
        within=_within(reproduction),
        figures=[
            (name, caption, data_uri((folder / f"{name}.svg").read_bytes(), "image/svg+xml"))
            for name, caption in FIGURES.items()
        ],
        metrics=[evaluate.METRICS[key] for key in keys],
        scores=table,
        episodes=len(scores[0].episodes),
        seeds=seeds,
        by_policy={score.policy: score.estimates for score in scores},
        agent=scores[-1].policy,
        gaits=gaits,
        trained=trained,
        training_seed=training_seed,
        curve=data_uri(draw_curve(curve, scores, gaits), "image/svg+xml"),
        clips=[(clip, data_uri(clip.path.read_bytes(), "video/mp4")) for clip in clips],
        command=runs.command(),
        versions=runs.versions(),
    )


def _within(reproduction: Reproduction) -> dict[str, dict[str, int]]:
    """By solver: rows with a bar, those within it, claims, those that hold."""
    counts = {}
    for solver in SOLVERS:
        barred = [
            r["within_bar"]
            for r in reproduction.rows
            if r["solver"] == solver and r["within_bar"] is not None
        ]
        holds = [s["holds"] for s in reproduction.shapes if s["solver"] == solver]
        counts[solver] = {
            "rows": len(barred), "within": sum(barred), "claims": len(holds), "holds": sum(holds)
        }  # fmt: skip
    return counts
