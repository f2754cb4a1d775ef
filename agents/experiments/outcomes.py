"""Outcomes of the trainings of a plan, read from their folders."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from agents import runs
from agents.experiments.plans import Entry, Run
from agents.experiments.training import CURVE, FINAL, read_curve
from agents.settings import load_settings
from hoof_env.errors import DataFileError, brief, parse_json
from hoof_env.evaluation.statistics import Scored, mean_figures, over_seeds


@dataclass(frozen=True)
class Outcome:
    """Outcome of one training: its folder and the content of its final.json."""

    folder: Path
    final: dict[str, Any]

    @cached_property
    def figures(self) -> dict[str, float]:
        """Means over the episodes of the final score, by name."""
        return mean_figures(self.final["episodes"])

    @cached_property
    def curve(self) -> list[dict[str, float]]:
        """Rows of curve.csv."""
        return read_curve(self.folder / CURVE)


@dataclass(frozen=True)
class Row:
    """Entry with the outcomes of the seeds that are done."""

    entry: Entry
    outcomes: tuple[Outcome, ...]

    @property
    def title(self) -> str:
        """Name of the entry in tables and pictures."""
        return self.entry.title

    @cached_property
    def scored(self) -> Scored:
        """Figures over the seeds, with intervals, and of each seed."""
        seeds = [outcome.figures for outcome in self.outcomes]
        return Scored(self.title, over_seeds(seeds), seeds)

    @property
    def command(self) -> str:
        """Command that trains the first seed."""
        return shlex.join(["python", "-m", "agents.experiments.training", *Run(self.entry, 0).command()])


def read_rows(plan: Sequence[Entry], folder: Path) -> list[Row]:
    """Return the rows of a plan with at least one training that is done.

    Raises:
        DataFileError: nothing is done, or an outcome cannot be read or is not what the plan asks for.
    """
    rows = []
    for entry in plan:
        trainings = [Run(entry, seed) for seed in range(entry.seeds)]
        outcomes = tuple(read_outcome(one, folder) for one in trainings if is_done(one, folder))
        if outcomes:
            rows.append(Row(entry, outcomes))
    if not rows:
        raise DataFileError(f"{folder}: expected trainings of agents.experiments, found none that is done")
    return rows


def is_done(one: Run, folder: Path) -> bool:
    """True if a training has its final score."""
    return (folder / one.name / FINAL).is_file()


def read_outcome(one: Run, folder: Path) -> Outcome:
    """Read one training, checked to have the arguments and hyperparameters that its entry has now."""
    path = folder / one.name
    try:
        outcome = Outcome(path, parse_json((path / FINAL).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise DataFileError(f"{path / FINAL}: expected the score of a training: {error}") from None
    entry = one.entry
    config = load_settings(path / runs.CONFIG, entry.env_id)
    for used, expected in ((outcome.final["env_kwargs"], entry.env_kwargs), (config, entry.settings)):
        # A table must not mix outcomes of different settings
        keys = sorted(key for key in {**used, **expected} if used.get(key) != expected.get(key))
        if keys:
            wanted = {key: expected.get(key) for key in keys}
            got = {key: used.get(key) for key in keys}
            raise DataFileError(f"{path}: expected a training with {wanted}, got {got}; remove the folder")
    return outcome


def seconds_to(level: float, outcome: Outcome) -> float:
    """Return the wall time of training [s] until the learning curve first reaches a return; infinite if it
    does not. The curve is linear between two scores."""
    # The first row is the untrained policy
    before, *later = outcome.curve
    for row in later:
        if row["return"] >= level:
            # Linear between two scores, but not before the earlier one
            part = (level - before["return"]) / (row["return"] - before["return"])
            return before["wall_s"] + max(part, 0.0) * (row["wall_s"] - before["wall_s"])
        before = row
    return float("inf")


def versions_of(rows: Sequence[Row]) -> dict[str, str]:
    """Return the versions of the packages that trained; several of one package are listed together."""
    versions: dict[str, set[str]] = {}
    for row in rows:
        for outcome in row.outcomes:
            for name, value in runs.read_record(outcome.folder)["versions"].items():
                versions.setdefault(name, set()).add(value)
    return {name: ", ".join(sorted(values)) for name, values in versions.items()}


def read_figures(path: Path) -> dict[str, Any]:
    """Return the figures of a page in their file; empty if there is no such file.

    Raises:
        DataFileError: the file is malformed.
    """
    if not path.is_file():
        return {}
    try:
        content: Any = parse_json(path.read_text(encoding="utf-8"))
        if not isinstance(content, dict):
            raise ValueError(f"got {brief(content)}")
    except (OSError, ValueError) as error:
        raise DataFileError(f"{path}: expected the figures that agents.experiments writes: {error}") from None
    figures: dict[str, Any] = content
    return figures
