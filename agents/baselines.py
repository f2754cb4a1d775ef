"""The table of baselines: many trainings, one process each, and the page that they make.

    python -m agents.baselines                        all of agents/plans/full.yml: hours on two cores
    python -m agents.baselines --subset nightly       a small one in minutes, into a folder of its own
    python -m agents.baselines --only sac td3         some rows of it
    python -m agents.baselines --subset trainers --workers 1      how fast PPO and PPO_FLAT train, by turns

The files of agents/plans list the trainings. A training that is done is not repeated; Ctrl-C, or kill -9, and
the same command go on where it was. Each has its log next to its results, RUN/log.txt.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from agents import baselines_report
from agents.baselines_run import FINAL, FOLDERS, Plan, Run, load_plan, runs_of
from agents.command import run
from hoof_env._output import check_folder
from hoof_env.errors import ParameterError, check_number


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    subset: Plan = "full"
    """which plan; each has a folder of its own"""
    only: tuple[str, ...] = ()
    """only trainings with one of these in their names, which are ALGO-ENV-sSEED"""
    workers: int = 2
    """trainings at a time, one thread each"""
    out: Path | None = None
    """folder of trainings and page; otherwise runs/baselines, or the plan's own"""
    report: bool = True
    """write the page when nothing is left"""


def train_all(args: Args) -> list[Run]:
    """Train what is not done yet and return the trainings that failed.

    Raises:
        ParameterError: there is no training of that name.
        OutputError: the folder cannot be written.
        KeyboardInterrupt: Ctrl-C; the same call goes on.
    """
    check_number("workers", args.workers, low=1)
    folder = args.out or FOLDERS[args.subset]
    names = args.only or ("",)
    chosen = [
        training
        for training in runs_of(load_plan(args.subset))
        if any(text in training.name for text in names)
    ]
    if not chosen:
        raise ParameterError(f"only: expected a part of a training's name, got {args.only!r}")
    check_folder(folder)
    return work_off(chosen, folder, args.workers)


def work_off(chosen: Sequence[Run], folder: Path, workers: int) -> list[Run]:
    """Train `workers` at a time until all are done; return those that failed."""
    waiting = [training for training in chosen if not is_done(training, folder)]
    running: dict[Run, subprocess.Popen[bytes]] = {}
    failed: list[Run] = []
    interval = 1.0 if sys.stderr.isatty() else 60.0  # seconds between two lines, where each is kept
    with tqdm(
        total=len(chosen), mininterval=interval, bar_format="{l_bar}{bar:20}{r_bar}", unit=" runs"
    ) as bar:
        try:
            while waiting or running:
                # Free places are filled at once, so that a long training holds up no other
                while waiting and len(running) < workers:
                    training = waiting.pop(0)
                    running[training] = start(training, folder)
                # Trainings take minutes: half a second between looks costs nothing
                time.sleep(0.5)
                for training in [
                    training for training, process in running.items() if process.poll() is not None
                ]:
                    running.pop(training)
                    # Whatever the exit code says, a training is done if it has its final score
                    if not is_done(training, folder):
                        failed.append(training)
                        tqdm.write(f"{training.name} failed: {last_line(folder / training.name)}")
                bar.n = len(chosen) - len(waiting) - len(running) - len(failed)
                bar.set_postfix_str(", ".join(training.name for training in running), refresh=False)
                bar.update(0)
        finally:
            for process in running.values():  # each ends in good order, with a checkpoint
                process.terminate()
            for process in running.values():
                process.wait()
    return failed


def is_done(one: Run, folder: Path) -> bool:
    """True if the training has its final score."""
    return (folder / one.name / FINAL).is_file()


def start(one: Run, folder: Path) -> subprocess.Popen[bytes]:
    """Begin a training, or go on with it, in a process that Ctrl-C does not reach."""
    # The log needs the folder before the training makes it
    (folder / one.name).mkdir(parents=True, exist_ok=True)
    # One thread each: several trainings share the cores
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with (folder / one.name / "log.txt").open("ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "agents.baselines_run", *one.command(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            env=os.environ | threads,
        )


def last_line(folder: Path) -> str:
    """Return the last line of a training's log, which says why it failed."""
    lines = (folder / "log.txt").read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line for line in reversed(lines) if line.strip()), "its log is empty")


def main(argv: list[str] | None = None) -> int:
    """Train all, write the page and return the exit code."""
    import tyro

    # SIGTERM ends the trainings as Ctrl-C does, each with a checkpoint
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    args = tyro.cli(Args, args=argv, prog="python -m agents.baselines", description=__doc__)
    failed = train_all(args)
    if args.report:
        print(f"written: {baselines_report.report(baselines_report.Args(args.subset, args.out))}")
    for training in failed:
        print(f"failed: {training.name}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    run(main)
