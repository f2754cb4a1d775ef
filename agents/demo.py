"""All of it in one go, with a report to read: what `make demo` runs.

    python -m agents.demo              into runs/demo, a few minutes
    python -m agents.demo --quick      tiny numbers, only to see that everything works

1. The paper's four conditions with every solver, published beside simulated.
2. The scripted gaits and the simplest policies in hoof_env/HorseLeg-v0.
3. A small PPO agent, trained and scored on the same episodes.
4. report.html: one file with tables, figures and films, to be opened or sent as it is.

The folder also holds the reproduction, the figures, the films, the scores and the model, so that
`python -m agents.evaluate --policy runs/demo` plays it. Ctrl-C leaves an older report as it was.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from agents import evaluate, page, runs, train, video
from agents.command import run
from hoof_env._output import check_folder, staged
from hoof_env.envs.policies import make_policy
from hoof_env.errors import check_number
from hoof_env.paper.reproduce import GAITS, SOLVERS, Reproduction, reproduce, write_reproduction

ENV_ID, FIXED_ID = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"
SCRIPTED = ("walk", "run", "idle", "random", "bang-bang")
TRAINED = "trained agent"
FIRST_SEED = 1000
"""Of the scored episodes; training starts its own from another seed."""

SLOW = 4
"""How many times slower than life the films of the fixed trunk play."""


@dataclass(frozen=True)
class Budget:
    """How much is done: training steps and their time limit, episodes a policy, length of the films."""

    steps: int
    max_minutes: float
    episodes: int
    film_seconds: float
    params: tuple[str, ...] = ()


FULL = Budget(steps=1_000_000, max_minutes=3.0, episodes=20, film_seconds=8.0)
QUICK = Budget(2_048, 1.0, 2, 0.4, params=("n_envs=4", "n_steps=512", "batch_size=512", "n_epochs=1"))


@dataclass(frozen=True)
class Args:
    out: Path = Path("runs/demo")
    """folder of the report; an older report there is replaced when the new one is complete"""
    seed: int = 0
    """of the training"""
    quick: bool = False
    """tiny numbers: shows that everything works and nothing more; the report says so"""


def demo(args: Args) -> Path:
    """Do all four steps and return the path of the report.

    Raises:
        OutputError: the folder cannot be written. KeyboardInterrupt: Ctrl-C; nothing was replaced.
    """
    check_number("seed", args.seed, low=0, high=FIRST_SEED - 1)
    check_folder(args.out)
    budget = QUICK if args.quick else FULL
    with staged(args.out) as stage:
        with announced(1, "the paper's four conditions, walking and running, elastic and inelastic"):
            reproduction = reproduce(say)
            write_reproduction(reproduction, stage, command=runs.command())
            print_reproduction(reproduction)

        with announced(2, f"scripted policies in {ENV_ID}, {budget.episodes} episodes each"):
            scores, _ = evaluate.evaluate(evaluate_args(budget, SCRIPTED))
            evaluate.print_table(scores)

        with announced(3, f"PPO learns for {budget.steps:,} steps, {budget.max_minutes:g} minutes at most"):
            trained = train_agent(args, budget, stage)
            say(f"{trained.steps:,} steps at {trained.rate:,.0f} steps/s")
            (score,), setting = evaluate.evaluate(evaluate_args(budget, (str(stage / "model.zip"),)))
            scores.append(replace(score, policy=TRAINED))
            evaluate.print_table(scores)

        with announced(4, "films and report"):
            about = {"seed": FIRST_SEED, "command": runs.command(), "versions": runs.versions()}
            data = evaluate.to_json(scores, **setting, **about)
            runs.write_text(stage / "scores.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
            clips = film_all(scores, budget, stage)
            html = page.render(
                reproduction=reproduction,
                scores=scores,
                clips=clips,
                trained=trained,
                curve=page.read_curve(stage / "monitor.csv"),
                folder=stage,
                seeds=(FIRST_SEED, FIRST_SEED + budget.episodes - 1),
                training_seed=args.seed,
                quick=args.quick,
            )
            (stage / "report.html").write_text(html, encoding="utf-8")
    return args.out / "report.html"


def say(line: str) -> None:
    """A line of progress, under the title of its step."""
    print(f"      {line}", flush=True)


@contextmanager
def announced(number: int, title: str) -> Iterator[None]:
    """A numbered step: its title before, its time after."""
    print(f"[{number}/4] {title}", flush=True)
    started = time.monotonic()
    yield
    say(f"done in {time.monotonic() - started:.0f} s")


def evaluate_args(budget: Budget, policies: tuple[str, ...]) -> evaluate.Args:
    return evaluate.Args(policy=policies, episodes=budget.episodes, seed=FIRST_SEED, env_id=ENV_ID)


def train_agent(args: Args, budget: Budget, stage: Path) -> train.Trained:
    """Train with the settings of agents/hyperparams and put the run's files into `stage` itself."""
    folder = stage / "training"
    trained = train.train(
        train.Args(
            env_id=ENV_ID,
            seed=args.seed,
            steps=budget.steps,
            max_minutes=budget.max_minutes,
            params=budget.params,
            out=folder,
            checkpoint_every=0,
        )
    )
    if trained.stopped_by:
        raise KeyboardInterrupt
    for name in filter(lambda name: (folder / name).is_file(), (*runs.FILES, runs.STATISTICS)):
        os.replace(folder / name, stage / name)
    shutil.rmtree(folder)  # TensorBoard's curves are in monitor.csv too
    return trained


def film_all(scores: list[evaluate.Score], budget: Budget, stage: Path) -> list[page.Clip]:
    """Film the gaits and the agent on their own trunk, and the gaits, slowly, on a fixed one."""
    clips = []
    first_episodes = {score.policy: score.episodes[0] for score in scores}
    with runs.make_env(ENV_ID, render_mode="rgb_array") as env:
        for name in (TRAINED, *GAITS):
            model_or_name = str(stage / "model.zip") if name == TRAINED else name
            policy = evaluate.find_policy(model_or_name, env, ENV_ID)
            path = stage / f"{name.replace(' ', '-')}.mp4"
            video.film(env, policy, path, seed=FIRST_SEED, seconds=budget.film_seconds, crf=28)
            first = first_episodes[name]
            way = "forward" if first["distance_m"] >= 0 else "backward"
            caption = (
                f"{abs(first['distance_m']):.1f} m {way} in an episode of {first['seconds']:.0f} s, "
                f"return {first['return']:.1f}"
            )
            clips.append(page.Clip(f"{name.capitalize()}, moving trunk", caption, path))
            say(f"filmed {name}")
    for gait in GAITS:
        settings: dict[str, Any] = {"gait": gait, "dt": 0.02 / SLOW, "render_mode": "rgb_array"}
        with runs.make_env(FIXED_ID, **settings) as env:
            path = stage / f"{gait}-fixed.mp4"
            video.film(
                env, make_policy(gait, env), path, seed=0, seconds=min(1.0, budget.film_seconds),
                crf=28, speed=1 / SLOW,
            )  # fmt: skip
        caption = f"one cycle of 1 s as in the paper, {SLOW} times slower than life"
        clips.append(page.Clip(f"{gait.capitalize()}, fixed trunk", caption, path))
        say(f"filmed {gait} on a fixed trunk")
    return clips


def print_reproduction(reproduction: Reproduction) -> None:
    """Published beside simulated for every row, and the claims about shape."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for title, justify in (
        ("row", "left"), ("unit", "left"), ("published", "right"), ("bar", "right"),
        *(column for solver in SOLVERS for column in ((solver, "right"), ("error", "right"))),
    ):  # fmt: skip
        grid.add_column(title, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for row in page.rows(reproduction):
        cells = [text for cell in row.cells for text in (cell.value, f"{cell.error} {cell.mark}")]
        grid.add_row(row.id, row.unit, row.published, row.bar, *cells)
    for claim in page.claims(reproduction):
        marks = [text for verdict in claim.verdicts for text in (page.MARKS[verdict["holds"]], "")]
        grid.add_row(claim.id, "shape", "", "", *marks)
    Console(width=None if sys.stdout.isatty() else 170).print(grid)


def main(argv: list[str] | None = None) -> None:
    import tyro

    started = time.monotonic()
    report = demo(tyro.cli(Args, args=argv, prog="python -m agents.demo", description=__doc__))
    print(f"{time.monotonic() - started:.0f} s in all. Open {report}")


if __name__ == "__main__":
    run(main)
