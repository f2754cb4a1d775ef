"""What the trainings of a plan left, entry by entry, and what policies without learning get in the same
episodes.

Statistics over seeds: interquartile means with bootstrap 95 % intervals (Agarwal et al. 2021, Deep
reinforcement learning at the edge of the statistical precipice).
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.baselines_run import CURVE, FINAL, Entry, Run, read_curve
from agents.evaluate import Interval, estimate
from agents.runs import CONFIG, read_record
from agents.score import CURVE_SEEDS, FINAL_SEEDS, TRANSPORT, mean_figures, score_vector
from agents.settings import FOLDER, load_settings
from hoof_env.errors import DataFileError, HoofEnvError

Floats = NDArray[np.float64]

GAITS = ("run", "walk")
OPEN_LOOP = "open-loop"
"""Name of the gait that CMA-ES found for an id, without learning."""

REPS = 5000
"""Of a bootstrap over seeds."""


@dataclass(frozen=True)
class Scored:
    """A policy without learning, or the seeds of an entry, on the episodes of the final score: figures over
    episodes or over seeds, those of each seed, and, without learning, the mean return over the episodes of
    the learning curves."""

    name: str
    intervals: Mapping[str, Interval]
    seeds: Sequence[Mapping[str, float]] = ()
    curve_return: float = math.nan


@dataclass(frozen=True)
class Result:
    folder: Path
    final: dict[str, Any]

    @cached_property
    def figures(self) -> dict[str, float]:
        """Of the last policy on fresh episodes."""
        return mean_figures(self.final["episodes"])

    @cached_property
    def curve(self) -> list[dict[str, float]]:
        return read_curve(self.folder / CURVE)


@dataclass(frozen=True)
class Row:
    """An entry with the trainings of it that are done."""

    entry: Entry
    results: tuple[Result, ...]

    @property
    def title(self) -> str:
        return " ".join(filter(None, (self.entry.algo.upper(), self.entry.label)))

    @cached_property
    def scored(self) -> Scored:
        """Figures over seeds, those that the id has."""
        seeds = [one.figures for one in self.results]
        return Scored(self.title, over_seeds(seeds), seeds)

    def times_above(self, level: float) -> list[float]:
        """Wall seconds of training until the curve is above a return, of the seeds that get there."""
        rows = [next((row for row in one.curve if row["return"] > level), None) for one in self.results]
        return [row["wall_s"] for row in rows if row]

    @property
    def settings(self) -> dict[str, Any]:
        return load_settings(self.results[0].folder / CONFIG, self.entry.env_id)

    @property
    def command(self) -> str:
        """What trains its first seed."""
        return shlex.join(["python", "-m", "agents.baselines_run", *Run(self.entry, 0).command()])


def read_results(plan: Sequence[Entry], folder: Path) -> list[Row]:
    """What is done of a plan; entries without a training that is done are left out. `DataFileError`: nothing
    is done, or a result cannot be read or is not what the plan asks for."""
    rows = []
    for entry in plan:
        folders = [folder / Run(entry, seed).name for seed in range(entry.seeds)]
        results = tuple(read_result(entry, one) for one in folders if (one / FINAL).is_file())
        if results:
            rows.append(Row(entry, results))
    if not rows:
        raise DataFileError(f"{folder}: expected trainings of agents.baselines, found none that is done")
    return rows


def read_result(entry: Entry, folder: Path) -> Result:
    """One training, checked to have the arguments and hyperparameters that its entry has now."""
    try:
        result = Result(folder, json.loads((folder / FINAL).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise DataFileError(f"{folder / FINAL}: expected what agents.baselines_run wrote: {error}") from None
    config = load_settings(folder / CONFIG, entry.env_id)
    for used, expected in (
        (result.final["env_kwargs"], entry.env_kwargs),
        (config, expected_settings(entry)),
    ):
        keys = sorted(key for key in {**used, **expected} if used.get(key) != expected.get(key))
        if keys:
            here, there = ({key: some.get(key) for key in keys} for some in (expected, used))
            raise DataFileError(
                f"{folder}: expected a training with {here}, got {there}; remove what is outdated"
            )
    return result


def expected_settings(entry: Entry) -> dict[str, Any]:
    settings = load_settings(FOLDER / f"{entry.algo}.yml", entry.env_id)
    return settings if entry.steps is None else settings | {"n_timesteps": entry.steps}


def versions_of(rows: Sequence[Row]) -> dict[str, str]:
    """Versions that the trainings were made with; several of one package stand beside each other."""
    versions: dict[str, set[str]] = {}
    for one in (one for row in rows for one in row.results):
        for name, value in read_record(one.folder)["versions"].items():
            versions.setdefault(name, set()).add(value)
    return {name: ", ".join(sorted(values)) for name, values in versions.items()}


def references(env_id: str) -> dict[str, Scored]:
    """The paper's gaits and the open-loop gait of an id on the episodes of the agents; those that it has."""
    known = {}
    for name in (*GAITS, OPEN_LOOP):
        try:
            known[name] = reference(name, name, env_id)
        except HoofEnvError:
            if name in GAITS:
                raise
    return known


def reference(name: str, policy: Any, env_id: str) -> Scored:
    """Score a policy without learning, as `agents.score.score_vector` takes it."""
    episodes = score_vector(policy, env_id, FINAL_SEEDS)
    curve = score_vector(policy, env_id, CURVE_SEEDS)
    return Scored(
        name, over_episodes(episodes), curve_return=float(np.mean([one["return"] for one in curve]))
    )


def over_episodes(episodes: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """The bootstrap's intervals around `mean_figures`; the cost of transport is one of sums, of which whole
    episodes are drawn."""
    from scipy.stats import bootstrap

    means = mean_figures(episodes)
    intervals = {key: estimate([one[key] for one in episodes]) for key in means if key != "cost_of_transport"}
    if "cost_of_transport" in means:
        mean = means["cost_of_transport"]
        intervals["cost_of_transport"] = Interval(mean)
        if math.isfinite(mean):
            parts = np.array([[one[name] for one in episodes] for name in TRANSPORT])

            def cost(drawn: Any, axis: int = -1) -> Any:
                distance, work, force, share = parts[:, drawn].sum(axis)
                return work * share / (force * distance)

            rng, rows = np.random.default_rng(0), np.arange(len(episodes))
            bounds = bootstrap((rows,), cost, vectorized=True, rng=rng).confidence_interval
            intervals["cost_of_transport"] = Interval(mean, float(bounds.low), float(bounds.high))
    return intervals


def iqm(scores: ArrayLike) -> Floats:
    """Interquartile mean over seeds and the percentile bootstrap's interval of it, which draws whole seeds:
    mean, low and high, shape (3,) or (3, n), of scores of shape (seeds,) or (seeds, n). Low and high are NaN
    for one seed. The bootstrap draws the same seeds each time."""
    from scipy.stats import bootstrap, trim_mean

    def middle(some: Floats, axis: int) -> Floats:
        return np.asarray(trim_mean(some, 0.25, axis=axis))

    values = np.asarray(scores, np.float64)
    mean = middle(values, axis=0)
    if len(values) < 2:
        return np.stack([mean, *[np.full_like(mean, np.nan)] * 2])
    options = {"axis": 0, "n_resamples": REPS, "method": "percentile", "rng": np.random.default_rng(0)}
    bounds = bootstrap((values,), middle, **options).confidence_interval
    return np.stack([mean, bounds.low, bounds.high])


def over_seeds(each: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """`iqm` of every figure that the seeds have in common, by name."""
    names = [name for name in each[0] if all(name in one for one in each)]
    columns = iqm([[one[name] for name in names] for one in each]).T
    return {name: Interval(*map(float, column)) for name, column in zip(names, columns, strict=True)}
