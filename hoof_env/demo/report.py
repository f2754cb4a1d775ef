"""The report of a demonstration: one HTML page that holds its pictures and films and needs no network."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hoof_env.errors import MissingExtraError
from hoof_env.evaluation.scores import METRICS, Score, cell
from hoof_env.paper.report import format_error, format_number
from hoof_env.paper.reproduce import GAITS, SOLVERS
from hoof_env.paper.rows import NOT_DETERMINABLE, OURS, Reproduction
from hoof_env.policies.catalogue import shipped_returns

OPEN_LOOP = "open-loop"
TEMPLATE = Path(__file__).with_name("report.html.j2")
KINDS = {".svg": "image/svg+xml", ".mp4": "video/mp4"}

BETTER = {
    "distance_m": 1,
    "highest_grf_n": -1,
    "stance_peak_n": -1,
    "weight_share": 1,
    "cost_of_transport": -1,
    "failed": -1,
    "loading_rate_n_s": -1,
}
"""Figures of an episode: 1 where more is better, -1 where less is."""


@dataclass(frozen=True)
class Learning:
    """A training that the report tells of.

    Attributes:
        steps: environment steps.
        seconds: their time [s].
        seed: seed of the training.
        curve: picture of the learning curve, an .svg.
    """

    steps: int
    seconds: float
    seed: int
    curve: Path


@dataclass(frozen=True)
class Report:
    """Content of a report.

    Attributes:
        reproduction: the paper's four conditions with every solver.
        scores: scores of scripted policies, and of the agent as the last one.
        clips: title, caption and film of each clip.
        folder: folder with the paper's figures as .svg.
        first_seed: seed of the first episode.
        command: command that writes the report.
        versions: versions of the packages that matter.
        learning: training of the agent; None for a shipped agent.
        quick: True if the numbers are tiny.
    """

    reproduction: Reproduction
    scores: Sequence[Score]
    clips: Sequence[Mapping[str, str]]
    folder: Path
    first_seed: int
    command: str
    versions: Mapping[str, str]
    learning: Learning | None = None
    quick: bool = False

    def html(self) -> str:
        """Return the page."""
        *others, agent = self.scores
        episodes = len(agent.episodes)
        rows = self.reproduction.rows
        shapes = self.reproduction.shapes
        gaits = [score for score in others if score.policy in GAITS]
        return render_template(
            TEMPLATE,
            quick=self.quick,
            reproduction=self.reproduction,
            simulated={(row["id"], row["solver"]): row for row in rows},
            shapes={(shape["id"], shape["solver"]): shape for shape in shapes},
            number=format_number,
            error=format_error,
            solvers=SOLVERS,
            figures={path.stem: data_uri(path) for path in self.folder.glob("figure*.svg")},
            metrics=[METRICS[key] for key in agent.estimates],
            scores=[
                (score.policy, [cell(*pair) for pair in score.estimates.items()]) for score in self.scores
            ],
            episodes=episodes,
            seeds=(self.first_seed, self.first_seed + episodes - 1),
            by_policy={score.policy: score.estimates for score in self.scores},
            lost=NOT_DETERMINABLE,
            ours=[shape["claim"] for shape in shapes if shape["claim"].startswith(OURS)],
            worse=worse(agent, next(score for score in gaits if score.policy == "run")),
            agent=agent.policy,
            open_loop=OPEN_LOOP,
            published=shipped_returns("HorseLeg-v0"),
            gaits=[score.policy for score in gaits],
            learning=self.learning,
            curve=data_uri(self.learning.curve) if self.learning else "",
            clips=self.clips,
            command=self.command,
            versions=self.versions,
        )


def worse(agent: Score, run: Score) -> list[str]:
    """Return the figures of an agent that are worse than a gait's, as text."""
    found = []
    for key, sense in BETTER.items():
        if key in agent.estimates and key in run.estimates:
            own = agent.estimates[key]
            other = run.estimates[key]
            if sense * own.mean < sense * other.mean:
                title = METRICS[key].title.replace("\n", " ")
                found.append(f"{title} {cell(key, own)[0]} against {cell(key, other)[0]}")
    return found


def data_uri(path: Path) -> str:
    """Return a file as a data URI."""
    return f"data:{KINDS[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"


def render_template(path: Path, /, **values: Any) -> str:
    """Fill a template of jinja2; values are escaped in a page of HTML. `MissingExtraError` without jinja2."""
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
    except ImportError:
        raise MissingExtraError('reports need jinja2: pip install "hoof-env[plot]"') from None
    templates = Environment(
        loader=FileSystemLoader(path.parent),
        autoescape=".html" in path.name,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return templates.get_template(path.name).render(values)
