"""All of it in one go, with a report to read: what `make demo` runs.

    python -m agents.demo              into runs/demo, in a minute or two
    python -m agents.demo --quick      tiny numbers, only to see that everything works

The report of `hoof-env demo` with an agent of its own: PPO learns for five seconds, and is scored and filmed
in place of the agent that ships. The folder is a run folder, too, which all commands play. Ctrl-C leaves an
older report as it was.
"""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import dataclass, replace
from pathlib import Path

from agents import runs, train
from agents.command import parse, run
from agents.pages import draw_learning_curve
from hoof_env._output import check_folder, staged
from hoof_env.demo.demo import (
    EPISODES,
    FILM_SECONDS,
    FIRST_SEED,
    PAGE,
    QUICK_EPISODES,
    QUICK_FILM_SECONDS,
    SCRIPTED,
    Steps,
    film_all,
    named,
    reproduce_paper,
)
from hoof_env.demo.report import OPEN_LOOP, Learning, Report
from hoof_env.errors import check_number
from hoof_env.evaluation.scores import Score, evaluate, text_table, write_json
from hoof_env.paper.reproduce import GAITS

ENV_ID = runs.DEFAULT_ENV
TRAINED = "trained agent"


@dataclass(frozen=True)
class Budget:
    """Limits of time and size.

    Attributes:
        seconds: time of learning [s]; importing, compiling and scoring come on top.
        steps: steps at which learning ends if it is faster, and over which learning rates fall.
        episodes: episodes of each policy that is scored.
        film_seconds: length of each film [s].
        params: hyperparameters that differ from the file's.
    """

    seconds: float
    steps: int
    episodes: int
    film_seconds: float
    params: tuple[str, ...] = ()


FULL = Budget(5.0, 1_000_000, EPISODES, FILM_SECONDS)
SMALL = ("n_envs=4", "n_steps=512", "batch_size=512", "n_epochs=1")
QUICK = Budget(60.0, 2_048, QUICK_EPISODES, QUICK_FILM_SECONDS, params=SMALL)


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    out: Path = Path("runs/demo")
    """folder of the report; an older report there is replaced when the new one is complete"""
    seed: int = 0
    """of the training"""
    quick: bool = False
    """tiny numbers: shows that everything works and nothing more; the report says so"""


def demo(args: Args) -> Path:
    """Do all four steps and return the path of the report.

    Raises:
        OutputError: the folder cannot be written.
        KeyboardInterrupt: Ctrl-C; nothing was replaced.
    """
    check_number("seed", args.seed, low=0, high=FIRST_SEED - 1)
    check_folder(args.out)
    budget = QUICK if args.quick else FULL
    steps = Steps(4, say)
    with staged(args.out) as stage:
        reproduction = reproduce_paper(stage, runs.command(), steps)
        with steps.announced(f"PPO learns for {budget.seconds:g} s, or {budget.steps:,} steps"):
            trained = train_agent(args, budget, stage)
            steps.say(f"{trained.steps:,} steps in {trained.seconds:.1f} s, {trained.rate:,.0f} steps/s")
        with steps.announced(f"the agent and scripted policies in {ENV_ID}, {budget.episodes} episodes each"):
            model = str(stage / runs.MODEL)
            found = evaluate((*SCRIPTED, model), ENV_ID, None, budget.episodes, FIRST_SEED)
            found = named(found, TRAINED)
            steps.say_all(text_table(found.scores))
            write_json(found, stage / "scores.json")
        with steps.announced("films and report"):
            clips = film_all(found.scores, model, budget.film_seconds, stage, steps)
            report = Report(
                reproduction, found.scores, clips, stage, FIRST_SEED, runs.command(), runs.versions()
            )
            curve = draw_curve(found.scores, stage)
            learning = Learning(trained.steps, trained.seconds, args.seed, curve)
            html = replace(report, learning=learning, quick=args.quick).html()
            (stage / PAGE).write_text(html, encoding="utf-8")
    return args.out / PAGE


def say(line: str) -> None:
    """Print a line at once."""
    print(line, flush=True)


def train_agent(args: Args, budget: Budget, stage: Path) -> train.Trained:
    """Train with the settings of agents/hyperparams and put the run's files into `stage` itself."""
    folder = stage / "training"
    trained = train.train(
        train.Args(
            env_id=ENV_ID,
            algo="ppo_flat",
            seed=args.seed,
            steps=budget.steps,
            max_minutes=budget.seconds / 60,
            params=budget.params,
            out=folder,
            checkpoint_every=0,
        )
    )
    # A report about half a training would mislead
    if trained.stopped_by:
        raise KeyboardInterrupt
    for name in filter(lambda name: (folder / name).is_file(), (*runs.FILES, runs.STATISTICS)):
        # Into the report's folder, so that commands can play it as a run
        os.replace(folder / name, stage / name)
    shutil.rmtree(folder)  # TensorBoard's curves are in monitor.csv too
    return trained


def draw_curve(scores: list[Score], stage: Path) -> Path:
    """Draw the learning curve of the run in `stage`, with the scripted gaits' returns; return the picture."""
    references = [score for score in scores if score.policy in (*GAITS, OPEN_LOOP)]
    path = stage / "curve.svg"
    draw_learning_curve(stage, [scores[-1], *references], path, metadata={"Date": None})
    return path


def main(argv: list[str] | None = None) -> None:
    """Make the report."""
    started = time.monotonic()
    report = demo(parse(Args, argv, "python -m agents.demo", __doc__))
    print(f"{time.monotonic() - started:.0f} s in all. Open {report}")


if __name__ == "__main__":
    run(main)
