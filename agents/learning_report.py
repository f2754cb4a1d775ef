"""Pictures and tables of docs/learning.md: what simple policies get, and a learned gait looked at closely.

    python -m agents.baselines --only ppo-HorseLeg-v0-s0        trains the agent that is looked at
    python -m agents.learning_report

Writes docs/learning/*.png and the tables of docs/learning.md, each between two marks.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agents import runs
from agents.baselines_plan import CURVE_SEEDS, FOLDERS
from agents.command import run
from agents.learned_gait import Episode, audit, draw_strides, watch
from agents.score import score_vector
from hoof_env.envs.tasks import TASKS
from hoof_env.errors import DataFileError

SIMPLE = ("run", "walk", "idle", "airborne", "drag", "bang-bang", "random")
TRIED, TRIED_AGAIN, AGAIN_SEEDS = 2048, 32, range(5000, 5064)
"""Constant actions tried, an episode each; how many of the best are tried again; the episodes of these."""


@dataclass(frozen=True)
class Args:
    model: Path = FOLDERS["full"] / "ppo-HorseLeg-v0-s0"
    """run folder of the agent that is looked at"""
    page: Path = Path("docs/learning.md")
    """the page; its pictures go into the folder beside it of the same name"""


def simple_returns(env_id: str) -> dict[str, float]:
    """Mean returns of scripted and simple policies over the episodes of the learning curves, and of the best
    constant action."""
    found = {name: mean_return(score_vector(name, env_id, CURVE_SEEDS)) for name in SIMPLE}
    return found | {"best constant": best_constant(env_id)}


def best_constant(env_id: str) -> float:
    """Mean return of the best of `TRIED` constant actions, drawn at random and the same for everyone."""
    actions = np.random.default_rng(0).uniform(-1, 1, (TRIED, 4)).astype(np.float32)
    first = [one["return"] for one in score_vector(actions, env_id, range(TRIED))]
    best = actions[np.argsort(first)[-TRIED_AGAIN:]]
    return max(mean_return(score_vector(one, env_id, AGAIN_SEEDS)) for one in best)


def mean_return(episodes: Sequence[Mapping[str, float]]) -> float:
    """Over episodes."""
    return float(np.mean([one["return"] for one in episodes]))


def simple_table() -> str:
    """Mean returns of scripted gaits, simple policies and the best constant action, by id."""
    names = (*SIMPLE, "best constant")
    lines = [f"| id | {' | '.join(names)} |", "|---|" + "---|" * len(names)]
    for env_id in (task.id for task in TASKS.values()):
        values = simple_returns(env_id)
        lines.append(f"| `{env_id}` | {' | '.join(f'{values[name]:.1f}' for name in names)} |")
    return "\n".join(lines)


def audit_table(episodes: dict[str, Episode]) -> str:
    """The audits side by side."""
    audits = [audit(episode) for episode in episodes.values()]
    lines = [f"| | {' | '.join(episodes)} |", "|---|" + "---|" * len(episodes)]
    lines += [f"| {row} | {' | '.join(f'{one[row]:.2f}' for one in audits)} |" for row in audits[0]]
    return "\n".join(lines)


def put(text: str, name: str, table: str) -> str:
    """The page's text with a table between the marks of its name."""
    marks = f"<!-- {name} -->", f"<!-- /{name} -->"
    if not all(mark in text for mark in marks):
        raise DataFileError(f"the page: expected the marks {' and '.join(marks)}")
    inside = "\n".join((marks[0], table, marks[1]))
    return re.sub(f"{marks[0]}.*{marks[1]}", lambda _: inside, text, flags=re.DOTALL)


def report(args: Args) -> None:
    """Write pictures and tables.

    Raises:
        DataFileError: no page, or no agent.
    """
    import matplotlib

    from hoof_env.paper.figure_style import STYLE

    if not args.page.is_file():
        raise DataFileError(f"page: expected a file, found no {args.page}")
    pictures = args.page.with_suffix("")
    pictures.mkdir(exist_ok=True)
    episodes = {"learned gait, seed 0": watch(str(args.model)), "scripted run": watch("run")}
    with matplotlib.rc_context(STYLE):
        draw_strides(episodes, pictures / "strides.png")
    text = args.page.read_text(encoding="utf-8")
    for name, table in {"simple": simple_table(), "audit": audit_table(episodes)}.items():
        text = put(text, name, table)
    runs.write_text(args.page, text)


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.learning_report", description=__doc__)
    report(args)
    print(f"written: {args.page} and {args.page.with_suffix('')}/")


if __name__ == "__main__":
    run(main)
