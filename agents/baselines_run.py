"""One training of the baselines table, scored as it goes and at its end, the plans that list all of them, and
their results.

    python -m agents.baselines_run --algo ppo --env-id hoof_env/HorseLeg-v0 --seed 0

The folder is that of `agents.train` with curve.csv, a row per score on the episodes of the learning curves,
and final.json, the last policy's score on fresh episodes. The same command goes on where it was interrupted.
Seconds are of training alone; wall time depends on the machine's other work, too.
"""

from __future__ import annotations

import csv
import json
import os
import shlex
import signal
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import yaml

from agents import runs
from agents.command import parse_pairs, run
from agents.settings import FOLDER, TrainingArgs, load_settings
from agents.train import Args as TrainArgs
from agents.train import train
from agents.watch import Scorer
from hoof_env.errors import DataFileError, check_number, parse_json
from hoof_env.evaluation.episodes import CURVE_SEEDS, FINAL_SEEDS, score_vector
from hoof_env.evaluation.statistics import FIGURES, Scored, mean_figures, over_seeds

PLANS = Path(__file__).with_name("plans")
Plan = Literal["full", "nightly", "trainers"]
"""Names of the plans, files of `PLANS`: the published table, a small part of it that runs in minutes, and the
trainers of PPO compared with each other."""

FOLDERS = {
    "full": Path("runs/baselines"),
    "nightly": Path("runs/baselines-nightly"),
    "trainers": Path("runs/trainers"),
}
"""Folders of the trainings, by plan."""

LEG = "hoof_env/HorseLeg-v0"

COLUMNS = ("steps", "wall_s", "cpu_s", *FIGURES)
"""Columns of curve.csv; a figure that the id does not have stays empty."""

CURVE = "curve.csv"
FINAL = "final.json"


@dataclass(frozen=True)
class Entry:
    """Row of the table, several seeds of one training; agents/plans/full.yml explains the fields."""

    algo: str
    env_id: str
    seeds: int
    steps: int | None = None
    points: int = 30
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
        """Return the arguments of this command that train it, into a folder of `folder` if that is given."""
        entry = self.entry
        words = ["--algo", entry.algo, "--env-id", entry.env_id]
        words += ["--seed", str(self.seed), "--points", str(entry.points)]
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
    """Yield all trainings of a plan, first seeds first: a table of whatever is done is fair at any time."""
    # One seed of every entry, then the next seed; entries with fewer seeds are padded with None
    for row in zip_longest(*([Run(entry, seed) for seed in range(entry.seeds)] for entry in plan)):
        yield from filter(None, row)


# One training


@dataclass(frozen=True)
class Args(TrainingArgs):
    """Arguments of the command."""

    seed: int = 0
    """of the training"""
    points: int = 30
    """scores on the way, at equal distances"""
    out: Path | None = None
    """run folder; otherwise runs/baselines/ALGO-ENV-sSEED"""


def train_one(args: Args) -> bool:
    """Train, or go on training, and score; return False if it was interrupted. Errors are those of
    `train`."""
    check_number("points", args.points, low=1)
    # Episodes of a training start at its seed: they must not reach the scored ones
    check_number("seed", args.seed, low=0, high=CURVE_SEEDS[0] // 2)
    name = args.env_id.rpartition("/")[2]
    folder = args.out or Path("runs/baselines", f"{args.algo}-{name}-s{args.seed}")
    # final.json is written last, so a training that has it is complete
    if (folder / FINAL).is_file():
        return True
    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    settings = load_settings(FOLDER / f"{args.algo}.yml", args.env_id) | parse_pairs("--params", args.params)
    steps = args.steps if args.steps is not None else int(settings["n_timesteps"])
    training = TrainArgs(
        env_id=args.env_id,
        env_kwargs=args.env_kwargs,
        algo=args.algo,
        seed=args.seed,
        steps=steps,
        params=args.params,
        out=folder,
        resume=True,
    )
    trained = train(training, CurveScorer(args.env_id, env_kwargs, folder, max(1, steps // args.points)))
    if trained.stopped_by:
        return False
    last = read_curve(folder / CURVE)[-1]
    final = {
        "algo": args.algo,
        "env_id": args.env_id,
        "env_kwargs": env_kwargs,
        "seed": args.seed,
        **{key: last[key] for key in ("steps", "wall_s", "cpu_s")},
        "seeds": [FINAL_SEEDS.start, FINAL_SEEDS.stop],
        "episodes": score_vector(str(folder), args.env_id, FINAL_SEEDS, **env_kwargs),
    }
    runs.write_text(folder / FINAL, json.dumps(final) + "\n")
    return True


class CurveScorer(Scorer):
    """Scorer into curve.csv of `folder`, which scores the untrained policy, too.

    Scores that a resumed training has yet to reach again are dropped. The training ends, with a checkpoint,
    if the process that began it is gone.
    """

    def __init__(self, env_id: str, env_kwargs: Mapping[str, Any], folder: Path, every: int) -> None:
        super().__init__(env_id, env_kwargs, CURVE_SEEDS, every)
        self.path = folder / CURVE

    def _on_training_start(self) -> None:
        super()._on_training_start()
        steps = self.num_timesteps
        self.rows = [row for row in read_curve(self.path) if row["steps"] <= steps] if steps else []
        self.starter = os.getppid()
        # A new curve begins with the untrained policy
        if not self.rows:
            self.score()
            return
        last = self.rows[-1]
        self.scored_at = int(last["steps"])
        # Seconds from the last score to the checkpoint are not known: as many a step as before
        self.wall_s, self.cpu_s = (
            last.get(key, 0.0) * steps / max(last["steps"], 1.0) for key in ("wall_s", "cpu_s")
        )

    def _on_step(self) -> bool:
        # An orphan would train on unseen; SIGTERM leaves a checkpoint
        if os.getppid() != self.starter:
            os.kill(os.getpid(), signal.SIGTERM)
            self.starter = os.getppid()
        return True

    def keep(self, episodes: list[dict[str, float]]) -> None:
        clock = {"steps": float(self.num_timesteps), "wall_s": self.wall_s, "cpu_s": self.cpu_s}
        self.rows.append(clock | mean_figures(episodes))
        runs.write_csv(self.path, COLUMNS, self.rows, "{:.10g}")


def read_curve(path: Path) -> list[dict[str, float]]:
    """Return the rows of a curve.csv, without empty cells; an empty list if there is no file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [{key: float(x) for key, x in row.items() if x} for row in csv.DictReader(file)]


# Results


@dataclass(frozen=True)
class Result:
    """Result of one training: its folder and what its final.json holds."""

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
    """Entry with the results of the seeds that are done."""

    entry: Entry
    results: tuple[Result, ...]

    @property
    def title(self) -> str:
        """Name of the entry in tables and pictures."""
        return self.entry.title

    @cached_property
    def scored(self) -> Scored:
        """Figures over the seeds, with intervals, and those of each seed."""
        seeds = [result.figures for result in self.results]
        return Scored(self.title, over_seeds(seeds), seeds)

    @property
    def command(self) -> str:
        """Command that trains the first seed."""
        return shlex.join(["python", "-m", "agents.baselines_run", *Run(self.entry, 0).command()])


def read_results(plan: Sequence[Entry], folder: Path) -> list[Row]:
    """Return the rows of a plan, those with at least one training that is done.

    Raises:
        DataFileError: nothing is done, or a result cannot be read or is not what the plan asks for.
    """
    rows = []
    for entry in plan:
        folders = [folder / Run(entry, seed).name for seed in range(entry.seeds)]
        results = tuple(read_result(entry, path) for path in folders if (path / FINAL).is_file())
        if results:
            rows.append(Row(entry, results))
    if not rows:
        raise DataFileError(f"{folder}: expected trainings of agents.baselines, found none that is done")
    return rows


def read_result(entry: Entry, folder: Path) -> Result:
    """Read one training, checked to have the arguments and hyperparameters that its entry has now."""
    try:
        result = Result(folder, parse_json((folder / FINAL).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise DataFileError(f"{folder / FINAL}: expected what agents.baselines_run wrote: {error}") from None
    config = load_settings(folder / runs.CONFIG, entry.env_id)
    for used, expected in (
        (result.final["env_kwargs"], entry.env_kwargs),
        (config, expected_settings(entry)),
    ):
        # A table must not mix results of different settings
        keys = sorted(key for key in {**used, **expected} if used.get(key) != expected.get(key))
        if keys:
            wanted = {key: expected.get(key) for key in keys}
            got = {key: used.get(key) for key in keys}
            raise DataFileError(
                f"{folder}: expected a training with {wanted}, got {got}; remove what is outdated"
            )
    return result


def expected_settings(entry: Entry) -> dict[str, Any]:
    """Return the hyperparameters that an entry asks for."""
    settings = load_settings(FOLDER / f"{entry.algo}.yml", entry.env_id)
    return settings | dict(entry.params) | ({} if entry.steps is None else {"n_timesteps": entry.steps})


def seconds_to(level: float, result: Result) -> float:
    """Return the wall time of training [s] until the learning curve first reaches a return; infinite if it
    does not. The curve is linear between two scores."""
    # The first row is the untrained policy
    before, *later = result.curve
    for row in later:
        if row["return"] >= level:
            # Linear between two scores, but not before the earlier one
            part = (level - before["return"]) / (row["return"] - before["return"])
            return before["wall_s"] + max(part, 0.0) * (row["wall_s"] - before["wall_s"])
        before = row
    return float("inf")


def versions_of(rows: Sequence[Row]) -> dict[str, str]:
    """Return the versions that the trainings were made with; several of one package are listed together."""
    versions: dict[str, set[str]] = {}
    for row in rows:
        for result in row.results:
            for name, value in runs.read_record(result.folder)["versions"].items():
                versions.setdefault(name, set()).add(value)
    return {name: ", ".join(sorted(values)) for name, values in versions.items()}


def main(argv: list[str] | None = None) -> int:
    """Train, and return the exit code."""
    import tyro

    done = train_one(tyro.cli(Args, args=argv, prog="python -m agents.baselines_run", description=__doc__))
    print("done" if done else "interrupted; the same command goes on")
    return 0 if done else 130


if __name__ == "__main__":
    run(main)
