"""What a second worker brings: docs/distribute/scaling.csv and its picture.

    python -m agents.distribute_scaling

Each thing is done with one worker and with two in turns, through the commands that a user gives:

    plain     trainings by agents.train, one process after the other or two at once: what the machine allows
    trials    as many trainings, as trials of agents.distribute
    sampling  RLlib's collection of steps, on one or two workers with environments
    rllib     RLlib's training as a whole: its one learner learns while the workers wait
"""

from __future__ import annotations

import csv
import io
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agents import runs
from agents.command import run
from hoof_env.errors import HoofEnvError, check_number

COLUMNS = ("what", "workers", "round", "steps", "seconds", "load")
"""Of scaling.csv; `load` is the number of processes that wanted a core when the measurement began."""

TITLES = {
    "plain": "trainings, plain processes",
    "trials": "trainings, Ray trials",
    "sampling": "RLlib, collecting steps",
    "rllib": "RLlib, training",
}


@dataclass(frozen=True)
class Args:
    rounds: int = 2
    """of all measurements"""
    trainings: int = 4
    """in each measurement of the first two"""
    steps: int = 250_000
    """of each of them"""
    rllib_steps: int = 80_000
    """of RLlib's training"""
    out: Path = Path("docs/distribute")
    """folder"""


def measure(args: Args) -> list[dict[str, float | str]]:
    """All rounds; writes the table after each.

    Raises:
        ParameterError: too few rounds or steps.
        HoofEnvError: a command failed.
    """
    check_number("rounds", args.rounds, low=1)
    check_number("rllib_steps", args.rllib_steps, low=4 * 4096)  # iterations, of which two are not counted
    rows: list[dict[str, float | str]] = []
    for number in range(args.rounds):
        for workers in (1, 2) if number % 2 == 0 else (2, 1):
            total = args.trainings * args.steps
            for what, steps, work in (
                ("plain", total, plain),
                ("trials", total, trials),
                ("rllib", args.rllib_steps, rllib),
            ):
                load = os.getloadavg()[0]
                with tempfile.TemporaryDirectory() as folder:
                    for name, seconds, done in work(args, workers, Path(folder)):
                        values = (
                            name or what,
                            workers,
                            number,
                            done or steps,
                            round(seconds, 2),
                            round(load, 1),
                        )
                        rows.append(dict(zip(COLUMNS, values, strict=True)))
                        print(*values, flush=True)
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        runs.write_text(args.out / "scaling.csv", text.getvalue())
    return rows


Found = list[tuple[str, float, int]]
"""Names, seconds and steps; an empty name or no steps where there is one thing to tell."""


def plain(args: Args, workers: int, folder: Path) -> Found:
    """Trainings in processes without Ray, `workers` at once."""
    started = time.monotonic()
    going: list[subprocess.Popen[bytes]] = []
    for seed in range(args.trainings):
        if len(going) == workers:
            finish(going.pop(0))
        options = (
            "--steps",
            args.steps,
            "--seed",
            seed,
            "--out",
            folder / str(seed),
            "--checkpoint-every",
            0,
        )
        going.append(command("agents.train", *options))
    for process in going:
        finish(process)
    return [("", time.monotonic() - started, 0)]


def trials(args: Args, workers: int, folder: Path) -> Found:
    """The same as trials."""
    started = time.monotonic()
    options = ("--seeds", args.trainings, "--steps", args.steps, "--report-every", args.steps)
    finish(command("agents.distribute", "trials", *options, "--cpus", workers, "--out", folder))
    return [("", time.monotonic() - started, 0)]


def rllib(args: Args, workers: int, folder: Path) -> Found:
    """RLlib's iterations but for the first two."""
    options: tuple[object, ...] = (
        "--workers",
        workers,
        "--cpus",
        workers + 1,
        "--steps",
        args.rllib_steps,
        "--out",
        folder,
    )
    options += ("--params", "n_envs=128", "n_steps=32", "batch_size=1024", "n_epochs=4")  # short iterations
    finish(command("agents.distribute", "rllib", *options))
    (path,) = folder.glob("*/*/result.json")
    told = [json.loads(line) for line in path.read_text().splitlines()][2:]
    steps = sum(one["env_runners"]["num_env_steps_sampled"] for one in told)
    sampling = sum(one["timers"]["env_runner_sampling_timer"] for one in told)
    return [("sampling", sampling, steps), ("rllib", sum(one["time_this_iter_s"] for one in told), steps)]


def command(module: str, *options: object) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", module, *map(str, options)],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def finish(process: subprocess.Popen[bytes]) -> None:
    """Wait; what failed is no measurement."""
    if code := process.wait():
        raise HoofEnvError(f"ended with code {code}: {shlex.join(process.args)}")  # type: ignore[arg-type]


def rates(rows: list[dict[str, float | str]], what: str, workers: int) -> np.ndarray:
    """Steps per second of every round."""
    some = [row for row in rows if row["what"] == what and int(row["workers"]) == workers]
    return np.array([float(row["steps"]) / float(row["seconds"]) for row in some])


def table(rows: list[dict[str, float | str]]) -> str:
    """The page's table: steps per second, and what the second worker brings, in the same round."""
    lines = ["| | 1 worker, steps/s | 2 workers, steps/s | ratio by round |", "|---|---|---|---|"]
    for what, title in TITLES.items():
        one, two = rates(rows, what, 1), rates(rows, what, 2)
        cells = [", ".join(f"{x:,.0f}" for x in values) for values in (one, two)]
        lines.append(f"| {title} | {' | '.join(cells)} | {', '.join(f'{x:.2f}' for x in two / one)} |")
    return "\n".join(lines)


def draw(rows: list[dict[str, float | str]], path: Path) -> None:
    """The ratios as a picture."""
    from matplotlib.figure import Figure

    figure = Figure((6.0, 2.6), layout="constrained")
    axes = figure.subplots()
    widest = 2.0
    for place, what in enumerate(TITLES):
        ratio = rates(rows, what, 2) / rates(rows, what, 1)
        widest = max(widest, *ratio)
        axes.barh(place, ratio.mean(), color="tab:blue", alpha=0.6, label="" if place else "mean")
        axes.plot(ratio, np.full(len(ratio), place), "k.", markersize=6, label="" if place else "one round")
    for ratio, name in (1.0, "no gain"), (2.0, "ideal"):
        axes.axvline(ratio, color="0.4", linestyle="--", linewidth=1)
        axes.text(ratio, 1.02, name, transform=axes.get_xaxis_transform(), ha="center", color="0.4")
    axes.set(yticks=range(len(TITLES)), yticklabels=list(TITLES.values()), xlim=(0, 1.1 * widest))
    axes.set_xlabel("rate with 2 workers / rate with 1 [-]")
    axes.invert_yaxis()
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower right", ncols=2, frameon=False)
    figure.savefig(path, dpi=130)


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.distribute_scaling", description=__doc__)
    rows = measure(args)
    print(table(rows))
    draw(rows, args.out / "scaling.png")


if __name__ == "__main__":
    run(main)
