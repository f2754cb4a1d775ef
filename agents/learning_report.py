"""Pictures and tables of docs/learning.md, from what agents.learning_bar left.

    python -m agents.learning_bar --env-id ...         for each id
    python -m agents.learning_report

Writes docs/learning/*.png and the tables of docs/learning.md, each between two marks.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.command import run
from agents.evaluate import find_policy, play
from agents.learned_gait import ENV_ID, Episode, audit, draw_strides, watch
from agents.learning_bar import EPISODES, FIRST_SEED, read_rows, returns
from hoof_env.envs.tasks import TASKS
from hoof_env.errors import DataFileError

SIMPLE = ("idle", "airborne", "drag", "bang-bang", "random")
TRIED, TRIED_AGAIN, AGAIN_SEED = 2048, 32, 5000
"""Constant actions tried, an episode each; how many of the best are tried again, in as many episodes each as
there is room for; and the first seed of these."""


@dataclass(frozen=True)
class Args:
    runs: Path = Path("runs/learning")
    """folder of agents.learning_bar"""
    page: Path = Path("docs/learning.md")
    """the page; its pictures go into the folder beside it of the same name"""


def simple_returns(env_id: str) -> dict[str, float]:
    """Mean returns of the simple policies over the scored episodes, and of the best constant action."""
    with runs.make_env(env_id) as env:
        seeds = range(FIRST_SEED, FIRST_SEED + EPISODES)
        found = {
            name: float(np.mean([one["return"] for one in play(env, find_policy(name, env, env_id), seeds)]))
            for name in SIMPLE
        }
    return found | {"best constant": best_constant(env_id)}


def best_constant(env_id: str) -> float:
    """Mean return of the best of `TRIED` constant actions, drawn at random and the same for everyone."""
    envs = runs.make_vec_env(env_id, TRIED)
    actions = np.random.default_rng(0).uniform(-1, 1, (TRIED, 4)).astype(np.float32)
    best = np.argsort(returns(envs, lambda _: actions))[-TRIED_AGAIN:]
    again = np.repeat(actions[best], TRIED // TRIED_AGAIN, axis=0)
    scores = returns(envs, lambda _: again, AGAIN_SEED).reshape(TRIED_AGAIN, -1)
    return float(scores.mean(1).max())


def draw_curves(folders: list[Path], path: Path) -> None:
    """Return against seconds of training, a panel for each id and a line for each seed."""
    from matplotlib.figure import Figure

    from hoof_env.paper.figure_style import BLUE, GREY, ORANGE

    figure = Figure(figsize=(9, 2.8 * -(-len(folders) // 2)), layout="constrained")
    panels = figure.subplots(-(-len(folders) // 2), 2).flatten()
    for axes in panels[len(folders) :]:
        axes.set_axis_off()
    for axes, folder in zip(panels, folders, strict=False):
        found = _bar(folder)
        for seed in found["seeds"]:
            rows = read_rows(folder / "curve.csv", int(seed))
            axes.plot([r["wall_s"] for r in rows], [r["return"] for r in rows], color=BLUE, lw=1, alpha=0.7)
        best = max(found["scripted"], key=found["scripted"].get)
        axes.axhline(found["scripted"][best], color=ORANGE, lw=1.2, ls="--")
        axes.annotate(
            f"scripted {best}", (1, found["scripted"][best]), (-2, 3), color=ORANGE, ha="right",
            xycoords=axes.get_yaxis_transform(), textcoords="offset points",
        )  # fmt: skip
        axes.set(title=found["env_id"], xlabel="wall time of training [s]", ylabel="mean return")
        axes.set_xlim(left=0)
        axes.grid(axis="y", color=GREY, alpha=0.15)
    figure.savefig(path, dpi=110)


def bar_table(folders: list[Path]) -> str:
    """Seconds to beat every scripted gait, by id and seed."""
    lines = [
        "| id | scripted | beaten after wall s (processor s) by seed | last returns | steps | steps/s |",
        "|---|---|---|---|---|---|",
    ]
    for folder in folders:
        found = _bar(folder)
        gaits = ", ".join(f"{name} {value:.1f}" for name, value in found["scripted"].items())
        each = [
            f"{one['wall_s']:.1f} ({one['cpu_s']:.1f})" if one else "not" for one in found["seeds"].values()
        ]
        ends = [read_rows(folder / "curve.csv", int(seed))[-1] for seed in found["seeds"]]
        last = ", ".join(f"{end['return']:.1f}" for end in ends)
        rate = sum(end["steps"] for end in ends) / sum(end["cpu_s"] for end in ends)
        cells = (
            f"`{found['env_id']}`",
            gaits,
            ", ".join(each),
            last,
            f"{ends[0]['steps']:,.0f}",
            f"{rate:,.0f}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def simple_table(folders: list[Path]) -> str:
    """Mean returns of scripted gaits, simple policies and the best constant action, by id."""
    names = ("run", "walk", *SIMPLE, "best constant")
    lines = [f"| id | {' | '.join(names)} |", "|---|" + "---|" * len(names)]
    family = [task.id for task in TASKS.values()]
    for found in filter(lambda found: found["env_id"] in family, map(_bar, folders)):
        values = found["scripted"] | simple_returns(found["env_id"])
        lines.append(f"| `{found['env_id']}` | {' | '.join(f'{values[name]:.1f}' for name in names)} |")
    return "\n".join(lines)


def audit_table(episodes: dict[str, Episode]) -> str:
    """The audits side by side."""
    audits = [audit(episode) for episode in episodes.values()]
    lines = [f"| | {' | '.join(episodes)} |", "|---|" + "---|" * len(episodes)]
    lines += [f"| {row} | {' | '.join(f'{one[row]:.2f}' for one in audits)} |" for row in audits[0]]
    return "\n".join(lines)


def _bar(folder: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads((folder / "bar.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataFileError(f"{folder}: expected what agents.learning_bar wrote: {error}") from None
    return found


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
        DataFileError: no page, or a folder without trainings.
    """
    import matplotlib

    from hoof_env.paper.figure_style import STYLE

    folders = sorted(path.parent for path in args.runs.glob("*/bar.json"))
    model = args.runs / ENV_ID.rpartition("/")[2] / "0"
    if not args.page.is_file() or not folders:
        raise DataFileError(f"expected a page {args.page} and runs of agents.learning_bar in {args.runs}")
    pictures = args.page.with_suffix("")
    pictures.mkdir(exist_ok=True)
    episodes = {"learned gait, seed 0": watch(str(model)), "scripted run": watch("run")}
    with matplotlib.rc_context(STYLE):
        draw_curves(folders, pictures / "curves.png")
        draw_strides(episodes, pictures / "strides.png")
    tables = {"bar": bar_table(folders), "simple": simple_table(folders), "audit": audit_table(episodes)}
    text = args.page.read_text(encoding="utf-8")
    for name, table in tables.items():
        text = put(text, name, table)
    runs.write_text(args.page, text)


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.learning_report", description=__doc__)
    report(args)
    print(f"written: {args.page} and {args.page.with_suffix('')}/")


if __name__ == "__main__":
    run(main)
