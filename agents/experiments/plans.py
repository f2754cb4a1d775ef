"""Plans: the trainings of a table, read from the files of `agents/plans`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import yaml

from agents.settings import FOLDER, load_settings
from hoof_env.errors import DataFileError

PLANS = Path(__file__).parents[1] / "plans"
"""Folder of the plans."""

Plan = Literal["full", "nightly", "trainers", "stock", "costs", "hop", "seeing"]
"""Names of the plans: the table of baselines, a small part of it that takes minutes, trainers of PPO compared
with each other, learners with the defaults of their library, learners under a constraint, learners of a leg
that carries itself, and learners where seeing pays."""

FOLDERS: Mapping[Plan, Path] = {
    "full": Path("runs/baselines"),
    "nightly": Path("runs/baselines-nightly"),
    "trainers": Path("runs/trainers"),
    "stock": Path("runs/stock"),
    "costs": Path("runs/costs"),
    "hop": Path("runs/hop"),
    "seeing": Path("runs/seeing"),
}
"""Folders of the trainings, by plan."""

LEG = "hoof_env/HorseLeg-v0"


@dataclass(frozen=True)
class Entry:
    """Row of a table, several seeds of one training; agents/plans/full.yml explains the fields."""

    algo: str
    env_id: str
    seeds: int
    steps: int | None = None
    points: int = 30
    every: int | None = None
    hyperparams: str = ""
    env_kwargs: Mapping[str, Any] = field(default_factory=dict, hash=False)
    params: Mapping[str, Any] = field(default_factory=dict, hash=False)
    variant: str = ""

    @property
    def title(self) -> str:
        """Name in tables and pictures."""
        return " ".join(filter(None, (self.algo.upper(), self.variant)))

    @property
    def name(self) -> str:
        """Name of the folders, without the seed."""
        words = self.algo, *self.variant.split(), self.env_id.rpartition("/")[2]
        return "-".join(words)

    @property
    def settings_file(self) -> Path:
        """File of the hyperparameters."""
        return FOLDER / f"{self.hyperparams or self.algo}.yml"

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Hyperparameters of the training."""
        settings = load_settings(self.settings_file, self.env_id) | dict(self.params)
        return settings | ({} if self.steps is None else {"n_timesteps": self.steps})


@dataclass(frozen=True)
class Run:
    """Training of an entry with one seed."""

    entry: Entry
    seed: int

    @property
    def name(self) -> str:
        """Name of the training and of its folder."""
        return f"{self.entry.name}-s{self.seed}"

    def command(self, folder: Path | None = None) -> list[str]:
        """Return the arguments of `agents.experiments.training`, into a folder of `folder` if that is
        given."""
        entry = self.entry
        words = ["--algo", entry.algo, "--env-id", entry.env_id, "--seed", str(self.seed)]
        if entry.every is None:
            words += ["--points", str(entry.points)]
        else:
            words += ["--every", str(entry.every)]
        if entry.hyperparams:
            # Whole where it runs, short where it is shown
            file = entry.settings_file if folder else entry.settings_file.relative_to(FOLDER.parents[1])
            words += ["--hyperparams", str(file)]
        words += ["--out", str(folder / self.name)] if folder else []
        words += ["--steps", str(entry.steps)] if entry.steps is not None else []
        for option, values in (("--env-kwargs", entry.env_kwargs), ("--params", entry.params)):
            pairs = [f"{key}={json.dumps(value)}" for key, value in values.items()]
            words += [option, *pairs] if pairs else []
        return words


def load_plan(name: str) -> tuple[Entry, ...]:
    """Return the entries of a plan; `DataFileError` if there is no such file, or an entry is malformed."""
    path = PLANS / f"{name}.yml"
    try:
        return tuple(Entry(**entry) for entry in yaml.safe_load(path.read_text(encoding="utf-8")))
    except (OSError, yaml.YAMLError, TypeError, RecursionError) as error:
        raise DataFileError(f"plan {path}: expected a list of entries: {error}") from None


def runs_of(plan: Sequence[Entry]) -> Iterator[Run]:
    """Yield all trainings of a plan, first seeds first, so that an unfinished table has as many seeds in each
    row."""
    # One seed of every entry, then the next seed; entries with fewer seeds are padded with None
    for row in zip_longest(*([Run(entry, seed) for seed in range(entry.seeds)] for entry in plan)):
        yield from filter(None, row)
