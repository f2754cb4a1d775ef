"""All of it in one go, with a report to read: what `make demo` runs.

    python -m agents.demo              into runs/demo, in a minute or two
    python -m agents.demo --quick      tiny numbers, only to see that everything works

The paper's four conditions with every solver, published next to simulated; scripted gaits and the simplest
policies in hoof_env/HorseLeg-v0; a small PPO agent, trained for five seconds and scored on the same episodes;
and report.html, one file with tables, figures and films. The folder is a run folder, too, which
agents.evaluate plays. Ctrl-C leaves an older report as it was.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from agents import evaluate, runs, train
from agents.command import run
from agents.pages import draw_learning_curve, render_template
from hoof_env._output import check_folder, staged
from hoof_env.errors import check_number
from hoof_env.film import render_episode
from hoof_env.paper.report import format_error, format_number
from hoof_env.paper.reproduce import GAITS, SOLVERS, reproduce, write_reproduction
from hoof_env.paper.rows import OURS, REPORTED, Reproduction, counted

ENV_ID = "hoof_env/HorseLeg-v0"
FIXED_ID = "hoof_env/HorseLegFixed-v0"
TRAINED = "trained agent"
OPEN_LOOP = "open-loop"
SCRIPTED = ("walk", "run", OPEN_LOOP, "idle", "random", "bang-bang")
FIRST_SEED = 1000  # first of the scored episodes; training starts its own from another seed
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

SLOW = 4  # factor of the slow motion in which the films of the fixed trunk play


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


FULL = Budget(seconds=5.0, steps=1_000_000, episodes=20, film_seconds=8.0)
QUICK = Budget(60.0, 2_048, 2, 0.4, params=("n_envs=4", "n_steps=512", "batch_size=512", "n_epochs=1"))


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
    with staged(args.out) as stage:
        with announced(1, "the paper's four conditions, walking and running, elastic and inelastic"):
            reproduction = reproduce(say)
            write_reproduction(reproduction, stage, command=runs.command())
            print_counts(reproduction)

        with announced(2, f"scripted policies in {ENV_ID}, {budget.episodes} episodes each"):
            # The same episodes for all policies, the agent included
            playing = evaluate.Args(policy=SCRIPTED, episodes=budget.episodes, seed=FIRST_SEED, env_id=ENV_ID)
            scores, _ = evaluate.evaluate(playing)
            evaluate.print_table(scores)

        with announced(3, f"PPO learns for {budget.seconds:g} s, or {budget.steps:,} steps"):
            trained = train_agent(args, budget, stage)
            say(f"{trained.steps:,} steps in {trained.seconds:.1f} s, {trained.rate:,.0f} steps/s")
            (score,), setting = evaluate.evaluate(replace(playing, policy=(str(stage / runs.MODEL),)))
            scores.append(replace(score, policy=TRAINED))
            evaluate.print_table(scores)

        with announced(4, "films and report"):
            about = {"seed": FIRST_SEED, "command": runs.command(), "versions": runs.versions()}
            data = evaluate.to_json(scores, **setting, **about)
            runs.write_text(stage / "scores.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
            clips = film_all(scores, budget, stage)
            html = render(args, reproduction, scores, trained, clips, stage)
            (stage / "report.html").write_text(html, encoding="utf-8")
    return args.out / "report.html"


def say(line: str) -> None:
    """Print a line of a step's output."""
    print(f"      {line}", flush=True)


@contextmanager
def announced(number: int, title: str) -> Iterator[None]:
    """Print the title of a step, and its time at the end."""
    print(f"[{number}/4] {title}", flush=True)
    started = time.monotonic()
    yield
    say(f"done in {time.monotonic() - started:.0f} s")


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
        # Into the report's folder, so that agents.evaluate can play it as a run
        os.replace(folder / name, stage / name)
    shutil.rmtree(folder)  # TensorBoard's curves are in monitor.csv too
    return trained


def film_all(scores: Sequence[evaluate.Score], budget: Budget, stage: Path) -> list[dict[str, str]]:
    """Film gaits and agent on their own trunk, and the gaits, slowly, on a fixed one; return title, caption
    and film of each."""
    clips = []
    size = (640, 360)
    first_episodes = {score.policy: score.episodes[0] for score in scores}
    for name in (TRAINED, *GAITS):
        policy = str(stage / runs.MODEL) if name == TRAINED else name
        path = stage / f"{name.replace(' ', '-')}.mp4"
        render_episode(path, policy, ENV_ID, seed=FIRST_SEED, seconds=budget.film_seconds, size=size)
        # The film shows the first scored episode: its caption has the figures of that
        first = first_episodes[name]
        way = "forward" if first["distance_m"] >= 0 else "backward"
        caption = (
            f"{abs(first['distance_m']):.1f} m {way} in an episode of {first['seconds']:.0f} s, "
            f"return {first['return']:.1f}"
        )
        title = f"{name.capitalize()}, moving trunk"
        clips.append({"title": title, "caption": caption, "film": data_uri(path)})
        say(f"filmed {name}")
    for gait in GAITS:
        path = stage / f"{gait}-fixed.mp4"
        seconds = min(1.0, budget.film_seconds)
        render_episode(path, gait, FIXED_ID, (f"gait={gait}",), seconds=seconds, slow=SLOW, size=size)
        caption = f"one cycle of 1 s as in the paper, in slow motion, {SLOW} x"
        title = f"{gait.capitalize()}, fixed trunk"
        clips.append({"title": title, "caption": caption, "film": data_uri(path)})
        say(f"filmed {gait} on a fixed trunk")
    return clips


def print_counts(reproduction: Reproduction) -> None:
    """Print how many published numbers each solver reproduces."""
    for solver in SOLVERS:
        say(f"{solver} solver: {counted(reproduction.rows, reproduction.shapes, solver)}")


def render(
    args: Args,
    reproduction: Reproduction,
    scores: Sequence[evaluate.Score],
    trained: train.Trained,
    clips: Sequence[dict[str, str]],
    folder: Path,
) -> str:
    """Return the report: one HTML page that holds its pictures and films and needs no network.

    The trained policy is the last of `scores`; its run folder is `folder`, which also has the figures as SVG.
    """
    *others, agent = scores
    episodes = len(agent.episodes)
    gaits = [score for score in others if score.policy in GAITS]
    references = [*gaits, *(score for score in others if score.policy == OPEN_LOOP)]
    draw_learning_curve(folder, [agent, *references], folder / "curve.svg", metadata={"Date": None})
    return render_template(
        "report.html.j2",
        quick=args.quick,
        reproduction=reproduction,
        simulated={(row["id"], row["solver"]): row for row in reproduction.rows},
        shapes={(shape["id"], shape["solver"]): shape for shape in reproduction.shapes},
        number=format_number,
        error=format_error,
        solvers=SOLVERS,
        figures={path.stem: data_uri(path) for path in folder.glob("figure*.svg")},
        metrics=[evaluate.METRICS[key] for key in agent.estimates],
        scores=[
            (score.policy, [evaluate.cell(*pair) for pair in score.estimates.items()]) for score in scores
        ],
        episodes=episodes,
        seeds=(FIRST_SEED, FIRST_SEED + episodes - 1),
        by_policy={score.policy: score.estimates for score in scores},
        reported=REPORTED,
        ours=[shape["claim"] for shape in reproduction.shapes if shape["claim"].startswith(OURS)],
        worse=worse(agent, next(score for score in gaits if score.policy == "run")),
        agent=agent.policy,
        open_loop=OPEN_LOOP,
        gaits=[score.policy for score in gaits],
        trained=trained,
        training_seed=args.seed,
        curve=data_uri(folder / "curve.svg"),
        clips=clips,
        command=runs.command(),
        versions=runs.versions(),
    )


def worse(agent: evaluate.Score, run: evaluate.Score) -> list[str]:
    """Return the figures of an agent that are worse than those of a gait, both in words."""
    found = []
    for key, sense in BETTER.items():
        if key in agent.estimates and key in run.estimates:
            own = agent.estimates[key]
            other = run.estimates[key]
            if sense * own.mean < sense * other.mean:
                title = evaluate.METRICS[key].title.replace("\n", " ")
                found.append(f"{title} {evaluate.cell(key, own)[0]} against {evaluate.cell(key, other)[0]}")
    return found


def data_uri(path: Path) -> str:
    """Return a file as a data URI."""
    kind = {".svg": "image/svg+xml", ".mp4": "video/mp4"}[path.suffix]
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"


def main(argv: list[str] | None = None) -> None:
    """Make the report."""
    import tyro

    started = time.monotonic()
    report = demo(tyro.cli(Args, args=argv, prog="python -m agents.demo", description=__doc__))
    print(f"{time.monotonic() - started:.0f} s in all. Open {report}")


if __name__ == "__main__":
    run(main)
