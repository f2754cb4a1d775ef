"""Trainings side by side, each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tqdm import tqdm

from agents.experiments.outcomes import is_done
from agents.experiments.plans import Run
from agents.experiments.training import CURVE, read_curve


def train_all(
    chosen: Sequence[Run], folder: Path, workers: int, when_done: Callable[[Run], None] | None = None
) -> list[Run]:
    """Train `workers` at a time until all are done; return the failed ones.

    An interruption ends each training in good order, with a checkpoint, from which the same call goes on.

    Args:
        chosen: trainings, in their order.
        folder: folder of their folders.
        workers: number of trainings at a time, one thread each.
        when_done: called after each training that is through.

    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
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
                    elif when_done:
                        when_done(training)
                bar.n = len(chosen) - len(waiting) - len(running) - len(failed)
                parts = [f"{training.name} {share_of(training, folder):.0%}" for training in running]
                bar.set_postfix_str(", ".join(parts), refresh=False)
                bar.update(0)
        finally:
            for process in running.values():  # each ends in good order, with a checkpoint
                process.terminate()
            for process in running.values():
                process.wait()
    return failed


def start(one: Run, folder: Path) -> subprocess.Popen[bytes]:
    """Begin a training, or go on with it, in a process that Ctrl-C does not reach."""
    # The log needs the folder before the training makes it
    (folder / one.name).mkdir(parents=True, exist_ok=True)
    # One thread each: several trainings share the cores
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    with (folder / one.name / "log.txt").open("ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "agents.experiments.training", *one.command(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            env=os.environ | threads,
        )


def share_of(one: Run, folder: Path) -> float:
    """Return the share of a training's steps up to its last score."""
    curve = read_curve(folder / one.name / CURVE)
    return curve[-1]["steps"] / one.entry.settings["n_timesteps"] if curve else 0.0


def last_line(folder: Path) -> str:
    """Return the last line of a training's log, which says why it failed."""
    lines = (folder / "log.txt").read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line for line in reversed(lines) if line.strip()), "its log is empty")
