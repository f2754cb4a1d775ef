"""What the trainings of a plan left, and what policies without learning get in the same episodes.

An agent dominates the scripted run where it is faster, its forces, its cost of transport and its loading rate
are lower by at least what `LOWER` says, and it bears between the run's share of the weight and all of it:
bearing less is a way to be soft, and with more the suspension pulls the animal down. An agent of
HorseLegSpeed-v0 follows its command by the slope of its speed over constant commands.
"""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.baselines_run import CURVE, FINAL, Entry, Run, read_curve
from agents.score import FINAL_SEEDS, score_vector
from agents.settings import FOLDER, load_settings
from agents.statistics import TABLE, Scored, cells, mean_figures, over_episodes, over_seeds
from hoof_env._output import markdown_table
from hoof_env.errors import DataFileError, HoofEnvError, parse_json
from hoof_env.saved_policy import ABOUT
from hoof_env.tasks.registry import TASKS

GAITS = ("run", "walk")
OPEN_LOOP = "open-loop"  # name of the gait that CMA-ES found for an id, without learning

SPEED = "hoof_env/HorseLegSpeed-v0"
COMMANDS = 5  # speeds between the lowest and the highest command
SETTLED = 4.0  # seconds after which the speed is that of the command

LOWER = {"stance_peak_n": 0.75, "peak_grf_n": 0.85, "cost_of_transport": 0.7, "loading_rate_n_s": 1.0}
"""What an agent that dominates has at most of the run's."""


@dataclass(frozen=True)
class Result:
    folder: Path
    final: dict[str, Any]

    @cached_property
    def figures(self) -> dict[str, float]:
        return mean_figures(self.final["episodes"])

    @cached_property
    def curve(self) -> list[dict[str, float]]:
        return read_curve(self.folder / CURVE)


@dataclass(frozen=True)
class Row:
    entry: Entry
    results: tuple[Result, ...]

    @property
    def title(self) -> str:
        return self.entry.title

    @cached_property
    def scored(self) -> Scored:
        seeds = [one.figures for one in self.results]
        return Scored(self.title, over_seeds(seeds), seeds)

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
        result = Result(folder, parse_json((folder / FINAL).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise DataFileError(f"{folder / FINAL}: expected what agents.baselines_run wrote: {error}") from None
    config = load_settings(folder / runs.CONFIG, entry.env_id)
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
    return settings | dict(entry.params) | ({} if entry.steps is None else {"n_timesteps": entry.steps})


def seconds_to(level: float, result: Result) -> float:
    """Wall time of training [s] until the learning curve first reaches a return; infinite if it does not."""
    before, *later = result.curve
    for row in later:
        if row["return"] >= level:
            part = (level - before["return"]) / (row["return"] - before["return"])
            return before["wall_s"] + max(part, 0.0) * (row["wall_s"] - before["wall_s"])
        before = row
    return float("inf")


def versions_of(rows: Sequence[Row]) -> dict[str, str]:
    """Versions that the trainings were made with; several of one package stand beside each other."""
    versions: dict[str, set[str]] = {}
    for one in (one for row in rows for one in row.results):
        for name, value in runs.read_record(one.folder)["versions"].items():
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
    return Scored(name, over_episodes(score_vector(policy, env_id, FINAL_SEEDS)))


def settled_speeds(row: Row) -> dict[int, list[float]]:
    """By seed, `settled_speed` under each of `following_commands`, of agents of `SPEED` whose policies are
    there."""
    found = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # they were trained with other commands, which is meant
        for one in row.results:
            if (one.folder / ABOUT).is_file():
                speeds = [settled_speed(str(one.folder), command) for command in following_commands()]
                found[one.final["seed"]] = speeds
    return found


def following_commands() -> list[float]:
    """Commands [m/s] from the slowest to the quickest of `SPEED`."""
    low, high = TASKS["speed"].defaults["target_speed"]
    return [float(command) for command in np.linspace(low, high, COMMANDS)]


def following(title: str, speeds: Mapping[int, Sequence[float]]) -> Scored:
    """Change of the settled speed over change of command: the slope of a line through them."""
    slopes = [{"follows": float(np.polyfit(following_commands(), one, 1)[0])} for one in speeds.values()]
    return Scored(title, over_seeds(slopes), slopes)


def settled_speed(policy: str, command: float) -> float:
    """Mean speed [m/s] behind the first `SETTLED` seconds under one command."""
    kwargs: dict[str, Any] = {"target_speed": [command, command]}
    with_start = score_vector(policy, SPEED, FINAL_SEEDS, **kwargs)
    start = score_vector(policy, SPEED, FINAL_SEEDS, **kwargs, episode_seconds=SETTLED)
    distance = np.mean([one["distance_m"] for one in with_start]) - np.mean(
        [one["distance_m"] for one in start]
    )
    return float(distance / (with_start[0]["seconds"] - SETTLED))


def dominates(figures: Mapping[str, float], run: Mapping[str, float]) -> bool:
    """Whether some means dominate those of the run."""
    lower = all(figures[key] <= part * run[key] for key, part in LOWER.items())
    bears = run["weight_share"] <= figures["weight_share"] <= 1.0
    return lower and bears and figures["speed_m_s"] > run["speed_m_s"]


def dominates_with_confidence(agent: Scored, run: Scored) -> bool:
    """Whether the intervals lie apart, too; that of the weight share must lie neither below the run's nor
    above 1."""
    ours = agent.intervals
    theirs = run.intervals
    lower = all(theirs[key].above(ours[key]) for key in LOWER)
    bears = not theirs["weight_share"].above(ours["weight_share"]) and ours["weight_share"].low <= 1.0
    return lower and bears and ours["speed_m_s"].above(theirs["speed_m_s"])


def compare(agents: Sequence[Scored], run: Scored) -> str:
    """The paper's run, and what is held against it, as a table."""
    means = {key: interval.mean for key, interval in run.intervals.items()}
    lines = [["run", *cells(run)]]
    for one in agents:
        mine = {key: interval.mean for key, interval in one.intervals.items()}
        parts = [f"{mine[key] / means[key]:.2f}" for key in LOWER]
        verdict = "yes" if dominates(mine, means) and dominates_with_confidence(one, run) else "no"
        count = sum(dominates(seed, means) for seed in one.seeds)
        seeds = f"{count}/{len(one.seeds)}" if one.seeds else ""
        lines.append([one.name, *cells(one), *parts, verdict, seeds])
    of_run = [f"{TABLE[key][0].rpartition(' ')[0] or key} / run's" for key in LOWER]
    titles = [title for title, *_ in TABLE.values()]
    return markdown_table(["", *titles, *of_run, "dominates", "seeds that do"], lines)
