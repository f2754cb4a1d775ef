"""What the trainings of a plan left, entry by entry, and what scripted policies get in the same episodes."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from agents.baselines_plan import CURVE_SEEDS, FINAL_SEEDS, TRANSPORT, Entry, Run, figures
from agents.baselines_run import CURVE, FINAL, read_curve
from agents.baselines_stats import Interval, over_seeds
from agents.command import parse_pairs
from agents.evaluate import estimate
from agents.score import score_vector
from agents.settings import FOLDER, load_settings
from hoof_env.errors import DataFileError, HoofEnvError

GAITS = ("run", "walk")
OPEN_LOOP = "open-loop"
"""Name of the gait that CMA-ES found for an id, without learning."""


@dataclass(frozen=True)
class Result:
    """One training that is done."""

    folder: Path
    final: dict[str, Any]

    @cached_property
    def figures(self) -> dict[str, float]:
        """Of the last policy on fresh episodes."""
        return figures(self.final["episodes"])

    @cached_property
    def curve(self) -> list[dict[str, float]]:
        """Rows of its curve.csv."""
        return read_curve(self.folder / CURVE)

    @cached_property
    def record(self) -> dict[str, Any]:
        """Its run.json."""
        found: dict[str, Any] = json.loads((self.folder / "run.json").read_text(encoding="utf-8"))
        return found


@dataclass(frozen=True)
class Row:
    """An entry with the trainings of it that are done."""

    entry: Entry
    results: tuple[Result, ...]

    @property
    def title(self) -> str:
        """Algorithm, and what sets the entry apart."""
        return " ".join(filter(None, (self.entry.algo.upper(), self.entry.label)))

    @cached_property
    def intervals(self) -> dict[str, Interval]:
        """Figures over seeds, those that the id has."""
        return over_seeds([one.figures for one in self.results])

    def beaten(self, level: float) -> list[dict[str, float] | None]:
        """Of each seed the first row of its curve with a return above `level`."""
        return [first_above(one.curve, level) for one in self.results]

    @property
    def command(self) -> str:
        """What trains its first seed, without the folder."""
        told = Run(self.entry, 0).command(Path())
        cut = told.index("--out")
        return shlex.join(["python", "-m", "agents.baselines_run", *told[:cut], *told[cut + 2 :]])


def first_above(curve: Sequence[dict[str, float]], level: float) -> dict[str, float] | None:
    """The first row of a learning curve with a return above `level`."""
    return next((row for row in curve if row["return"] > level), None)


def read_results(plan: Sequence[Entry], folder: Path) -> list[Row]:
    """What is done of a plan; entries without a training that is done are left out.

    Raises:
        DataFileError: nothing is done, or a result cannot be read or is not what the plan asks for.
    """
    rows = []
    for entry in plan:
        found = []
        for one in (folder / Run(entry, seed).name for seed in range(entry.seeds)):
            if (one / FINAL).is_file():
                try:
                    found.append(Result(one, json.loads((one / FINAL).read_text(encoding="utf-8"))))
                except (OSError, ValueError) as error:
                    raise DataFileError(
                        f"{one / FINAL}: expected what agents.baselines_run wrote: {error}"
                    ) from None
                check(entry, found[-1])
        if found:
            rows.append(Row(entry, tuple(found)))
    if not rows:
        raise DataFileError(f"{folder}: expected trainings of agents.baselines, found none that is done")
    return rows


def wanted(entry: Entry) -> dict[str, Any]:
    """The hyperparameters that an entry asks for, with its steps."""
    settings = load_settings(FOLDER / f"{entry.algo}.yml", entry.env_id)
    return settings if entry.steps is None else settings | {"n_timesteps": entry.steps}


def check(entry: Entry, one: Result) -> None:
    """Raise `DataFileError` for a training with other arguments or hyperparameters than its entry has now."""
    config = load_settings(one.folder / "config.yml", entry.env_id)
    kwargs = parse_pairs("env_kwargs", entry.env_kwargs)
    for got, asked in ((one.final["env_kwargs"], kwargs), (config, wanted(entry))):
        keys = sorted(key for key in {**got, **asked} if got.get(key) != asked.get(key))
        if keys:
            here, there = ({key: some.get(key) for key in keys} for some in (asked, got))
            raise DataFileError(
                f"{one.folder}: expected a training with {here}, got {there}; remove what is outdated"
            )


def settings_of(row: Row) -> dict[str, Any]:
    """The hyperparameters that an entry was trained with."""
    (found,) = yaml.safe_load((row.results[0].folder / "config.yml").read_text(encoding="utf-8")).values()
    return dict(found)


@dataclass(frozen=True)
class Reference:
    """A policy that learns nothing.

    Attributes:
        figures: means over fresh episodes.
        intervals: of the means over these episodes.
        curve_return: mean return over the episodes of the learning curves.
    """

    name: str
    figures: dict[str, float]
    intervals: dict[str, Interval]
    curve_return: float


def references(env_id: str, env_kwargs: dict[str, Any] | None = None) -> dict[str, Reference]:
    """The paper's gaits and the open-loop gait of an id on the episodes of the agents; those that it has."""
    found = {}
    for name in (*GAITS, OPEN_LOOP):
        try:
            found[name] = reference(name, name, env_id, env_kwargs or {})
        except HoofEnvError:
            if name in GAITS:
                raise
    return found


def reference(name: str, policy: Any, env_id: str, env_kwargs: dict[str, Any]) -> Reference:
    """Score a policy that learns nothing, as `agents.score.score_vector` takes it."""
    episodes = score_vector(policy, env_id, FINAL_SEEDS, **env_kwargs)
    means = figures(episodes)
    intervals = {key: over_episodes(key, mean, episodes) for key, mean in means.items()}
    curve = score_vector(policy, env_id, CURVE_SEEDS, **env_kwargs)
    return Reference(name, means, intervals, float(np.mean([one["return"] for one in curve])))


def over_episodes(key: str, mean: float, episodes: Sequence[Mapping[str, float]]) -> Interval:
    """The bootstrap's interval around one of `figures`, a mean over episodes; the cost of transport is one of
    sums, of which whole episodes are drawn."""
    from scipy.stats import bootstrap

    if key != "cost_of_transport" or not np.isfinite(mean):
        around = estimate([one[key] for one in episodes])
        low, high = (np.nan if bound is None else bound for bound in (around.low, around.high))
        return Interval(mean, low, high)
    parts = np.array([[one[name] for one in episodes] for name in TRANSPORT])

    def cost(drawn: Any, axis: int = -1) -> Any:
        distance, work, force, share = parts[:, drawn].sum(axis)
        return work * share / (force * distance)

    rng = np.random.default_rng(0)
    bounds = bootstrap((np.arange(len(episodes)),), cost, vectorized=True, rng=rng).confidence_interval
    return Interval(mean, float(bounds.low), float(bounds.high))


def versions_of(rows: Sequence[Row]) -> dict[str, str]:
    """Versions that the trainings were made with; several of one package stand beside each other."""
    found: dict[str, set[str]] = {}
    for one in (one for row in rows for one in row.results):
        for name, value in one.record["versions"].items():
            found.setdefault(name, set()).add(value)
    return {name: ", ".join(sorted(values)) for name, values in found.items()}
