"""Train by a plan, and write its page.

    python -m agents.experiments                              the table of baselines: hours on two cores
    python -m agents.experiments --plan nightly               a small part in minutes, in a folder of its own
    python -m agents.experiments --plan stock                 stock learners that their page lacks: hours
    python -m agents.experiments --plan stock --only ppo-HorseLeg-v0 --seeds 3 --out runs/mine
    python -m agents.experiments --plan trainers --workers 1  speed of PPO and PPO_FLAT, by turns
    python -m agents.experiments --plan costs                 learners with and without a constraint
    python -m agents.experiments --plan hop                   learners of a leg that carries itself
    python -m agents.experiments --plan seeing                learners of a leg that balances its trunk
    python -m agents.experiments --plan stock --no-train      the page alone

The plans are files of agents/plans. A training that is done is not repeated: after Ctrl-C, or kill -9, the
same command goes on where it was. Each training has its log in its folder, log.txt. Stock learners are
Stable-Baselines3's and sb3-contrib's with the defaults of `PPO("MlpPolicy", env)`, scored without noise on
starts that no training meets; their page compares them with policies that need no learning.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from agents.command import parse, run
from agents.experiments import baselines_page, costs_page, curves, hop_page, runner, seeing_page, stock_page
from agents.experiments.outcomes import is_done, read_outcome
from agents.experiments.plans import FOLDERS, Entry, Plan, Run, load_plan, runs_of
from hoof_env._output import check_folder
from hoof_env.errors import ParameterError, check_number


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    plan: Plan = "full"
    """which plan; each has a folder of its own"""
    only: tuple[str, ...] = ()
    """only trainings with one of these in their names, which are ALGO-ENV-sSEED"""
    seeds: int | None = None
    """trainings of each row, from seed 0 on; otherwise as planned"""
    steps: int | None = None
    """of each training; otherwise as planned"""
    workers: int = 2
    """trainings at a time, one thread each"""
    out: Path | None = None
    """folder of trainings and page; otherwise runs/baselines, or the plan's own; the pages of stock learners,
    of costs and of the legs that carry themselves are in docs/evidence"""
    train: bool = True
    """train; otherwise write the page of the trainings that are done"""
    page: bool = True
    """write the page when nothing is left"""

    @property
    def folder(self) -> Path:
        """Folder of the trainings."""
        return self.out or FOLDERS[self.plan]

    @property
    def published(self) -> Path:
        """Folder of the page."""
        places = {
            "stock": curves.PUBLISHED,
            "costs": costs_page.PUBLISHED,
            "hop": hop_page.PUBLISHED,
            "seeing": seeing_page.PUBLISHED,
        }
        return self.out or places.get(self.plan, self.folder)


def entries_of(args: Args) -> tuple[Entry, ...]:
    """Return the rows that the arguments ask for; `ParameterError` for a count out of range."""
    changes: dict[str, Any] = {}
    for name in ("seeds", "steps"):
        if (value := getattr(args, name)) is not None:
            changes[name] = int(check_number(name, value, low=1, high=1e9))
    return tuple(replace(entry, **changes) for entry in load_plan(args.plan))


def trainings_of(args: Args, entries: Sequence[Entry]) -> list[Run]:
    """Return the trainings that the arguments select; `ParameterError` if there are none."""
    names = args.only or ("",)
    chosen = [one for one in runs_of(entries) if any(text in one.name for text in names)]
    if not chosen:
        rows = ", ".join(dict.fromkeys(entry.name for entry in entries))
        raise ParameterError(f"only: expected a part of a training's name ({rows}), got {args.only!r}")
    return chosen


def train_planned(args: Args) -> list[Run]:
    """Train what is not done yet and return the trainings that failed.

    Raises:
        ParameterError: there is no training of that name, or a count is out of range.
        DataFileError: a training that is done has other settings, or curves.csv cannot be read.
        OutputError: the folder cannot be written.
        KeyboardInterrupt: Ctrl-C; the same call goes on.
    """
    check_number("workers", args.workers, low=1)
    entries = entries_of(args)
    chosen = trainings_of(args, entries)
    check_folder(args.folder)
    check_folder(args.published)
    for one in chosen:
        if is_done(one, args.folder):
            read_outcome(one, args.folder)
    if args.plan != "stock":
        return runner.train_all(chosen, args.folder, args.workers)
    # Published rows are done, too: their folders stay on the machine that trained
    rows = curves.publish(entries, args.folder, args.published)
    missing = [one for one in chosen if not curves.has_run(rows, one)]

    def publish(one: Run) -> None:
        curves.publish([one.entry], args.folder, args.published)

    return runner.train_all(missing, args.folder, args.workers, publish)


def write_page(args: Args) -> Path:
    """Write the page of the trainings that are done, and return its path.

    Raises:
        DataFileError: nothing is done, or an outcome cannot be read.
    """
    entries = entries_of(args)
    if args.plan == "stock":
        return stock_page.write(args.published, curves.publish(entries, args.folder, args.published), entries)
    if args.plan == "costs":
        return costs_page.write(args.published, costs_page.publish(entries, args.folder, args.published))
    if args.plan == "hop":
        return hop_page.write(args.published, hop_page.publish(entries, args.folder, args.published))
    if args.plan == "seeing":
        return seeing_page.write(args.published, seeing_page.publish(entries, args.folder, args.published))
    return baselines_page.write(f"the {args.plan} plan", entries, args.folder)


def main(argv: list[str] | None = None) -> int:
    """Train all, write the page and return the exit code."""

    # SIGTERM ends the trainings as Ctrl-C does, each with a checkpoint
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    args = parse(Args, argv, "python -m agents.experiments", __doc__)
    failed = train_planned(args) if args.train else []
    if args.page:
        print(f"written: {write_page(args)}")
    if args.page and args.published == curves.PUBLISHED:
        print("next: python -m agents.gallery, which tells the pages of the ids")
    for training in failed:
        print(f"failed: {training.name}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    run(main)
