"""Scores of policies on the same episodes: what `hoof-env evaluate` plays, prints and writes.

Brackets hold the bootstrap's 95 % interval of the mean over episodes. They say nothing about other trainings.
"""

from __future__ import annotations

import csv
import io
import json
import math
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import gymnasium as gym

from hoof_env._input import as_path
from hoof_env._output import markdown_table, staged
from hoof_env._version import __version__
from hoof_env.envs.make_env import make_env
from hoof_env.envs.policies import start_of
from hoof_env.errors import DataFileError, ParameterError, count
from hoof_env.evaluation.episodes import FINAL_SEEDS, play, score_vector
from hoof_env.evaluation.statistics import (
    TABLE,
    TRANSPORT,
    Interval,
    Scored,
    cells,
    estimate,
    mean_figures,
    over_episodes,
    over_seeds,
    transport,
)
from hoof_env.policies.actor import lost_command
from hoof_env.policies.find import find_policy, is_function, is_model, read_policy_record
from hoof_env.policies.record import environment_of

DEFAULT_ENV = "hoof_env/HorseLeg-v0"

TELL_SECONDS = 5.0
"""Time between two lines about the progress [s]."""

MAX_EPISODES = 1_000_000
"""Largest number of episodes of an evaluation."""


@dataclass(frozen=True)
class Metric:
    """Figure of an episode in a report: title, and factor and digits of the printed value."""

    title: str
    factor: float = 1.0
    digits: int = 2


METRICS = {
    "return": Metric("return", digits=1),
    "distance_m": Metric("progress\nm", digits=1),
    "highest_grf_n": Metric("peak GRF\nkN", 1e-3),
    "stance_peak_n": Metric("stance peak\nkN", 1e-3),
    "mean_normal_n": Metric("mean GRF\nkN", 1e-3),
    "weight_share": Metric("weight\nshare"),
    "duty_factor": Metric("duty\nfactor"),
    "cost_of_transport": Metric("cost of\ntransport"),
    "failed": Metric("failed"),
    "cost": Metric("cost", digits=1),
    "loading_rate_n_s": Metric("loading rate\nkN/s", 1e-3, 1),
}
"""Columns of reports: "return", figures of the episode (`hoof_env.episodes.summaries.SUMMARY`), and
"stance_peak_n", the mean over its stances of their highest force, 0 without a stance."""


@dataclass(frozen=True)
class Score:
    """Score of a policy: one dictionary per episode, with its return and the figures of its summary."""

    policy: str
    episodes: list[dict[str, float]]

    @cached_property
    def estimates(self) -> dict[str, Interval]:
        """Means and intervals of the `METRICS` that the episodes have, by key; the cost of transport is of
        all episodes together, as in every table."""
        found = {}
        for key in METRICS:
            if key == "cost_of_transport" and all(name in self.episodes[0] for name in TRANSPORT):
                found[key] = transport(self.episodes)
            elif key in self.episodes[0]:
                found[key] = estimate([one[key] for one in self.episodes])
        return found


@dataclass(frozen=True)
class Evaluation:
    """Scores of several policies in the episodes of one environment.

    Attributes:
        env_id: id of the environment.
        env_kwargs: its arguments.
        seeds: seeds of the episodes.
        scores: a score for each policy, in the order in which they were named.
    """

    env_id: str
    env_kwargs: dict[str, Any]
    seeds: range
    scores: list[Score]


def evaluate(
    policies: Sequence[str],
    env_id: str | None = None,
    env_kwargs: Mapping[str, Any] | None = None,
    episodes: int | None = None,
    seed: int | None = None,
    published: bool = False,
) -> Evaluation:
    """Play the same episodes with several policies.

    >>> from hoof_env.evaluation.scores import evaluate
    >>> found = evaluate(["run", "shipped"], "hoof_env/HorseLeg-v0", episodes=2)
    >>> run, shipped = found.scores
    >>> shipped.estimates["return"].mean > run.estimates["return"].mean
    True

    Args:
        policies: policies as `load_policy` takes them as texts.
        env_id: id of the environment; None takes the first policy's from a file, or HorseLeg-v0.
        env_kwargs: its arguments; None takes the first policy's from a file.
        episodes: number of episodes, 20 if None.
        seed: seed of the first episode, 1000 if None; the others follow it.
        published: play the episodes of the published tables, and refuse policies of other settings.

    Raises:
        ParameterError: an argument or a policy does not fit; nothing has been played.
        DataFileError: a model or a gait does not fit; nothing has been played.
    """
    seeds = _seeds(episodes, seed, published)
    if not policies:
        raise ParameterError("policy: expected a name or the path of a trained model, got none")
    known, of_record, file = _environment(policies, env_id, published)
    arguments = dict(of_record if env_kwargs is None else env_kwargs)
    with _made(known, arguments, file if env_kwargs is None else "") as env:
        find = _find_same if published else find_policy
        # All are found before the first is played.
        found = {name: find(name, env, known) for name in policies}
        for name, policy in found.items():
            _tell_of_own_command(name, policy, env, published)
        tell = _Progress(len(found) * len(seeds))
        scores = []
        for name, policy in found.items():
            try:
                if published:
                    played = score_vector(policy, known, seeds, **arguments)
                    tell(len(seeds))
                else:
                    played = play(env, policy, seeds, tell)
            except ParameterError as error:
                raise _of_policy(name, error) from error
            scores.append(Score(name, played))
    return Evaluation(known, arguments, seeds, scores)


def _tell_of_own_command(name: str, policy: Any, env: gym.Env[Any, Any], published: bool) -> None:
    """Warn of a policy whose episodes start with a commanded speed in place of the one that was asked for.

    Raises:
        ParameterError: a policy has a commanded speed of its own, and the episodes of the published tables,
            with the task's commands, are asked for.
    """
    start = start_of(policy)
    speed = start.get("target_speed")
    if published and speed is not None:
        raise ParameterError(
            f"policy {name}: expected one for the task's commands in the published episodes, got one that"
            f" starts with its own, {float(speed):.2f} m/s"
        )
    if lost := lost_command(start, env):
        warnings.warn(f"policy {name}: plays with its own {lost}", stacklevel=3)


def _seeds(episodes: int | None, seed: int | None, published: bool) -> range:
    """Return the seeds of the episodes; `ParameterError` for impossible ones."""
    if published:
        if episodes is not None or seed is not None:
            raise ParameterError(
                f"published: expected neither episodes nor seed with it, which plays {FINAL_SEEDS[0]:,} to"
                f" {FINAL_SEEDS[-1]:,}"
            )
        return FINAL_SEEDS
    number = 20 if episodes is None else count("episodes", episodes, most=MAX_EPISODES)
    first = 1000 if seed is None else count("seed", seed, low=0)
    return range(first, first + number)


def _made(env_id: str, arguments: Mapping[str, Any], file: str) -> gym.Env[Any, Any]:
    """Make the environment; an error of arguments that come from a policy's file names the file."""
    try:
        return make_env(env_id, **arguments)
    except ParameterError as error:
        if not (file and arguments):
            raise
        raise DataFileError(f"{file}: its record has arguments that do not fit: {error}") from None


def _of_policy(name: str, error: ParameterError) -> ParameterError:
    """Return an error in the play of a policy with the policy's name, where it lacks it."""
    return error if name in str(error) else ParameterError(f"policy {name}: {error}")


def _environment(
    policies: Sequence[str], env_id: str | None, published: bool
) -> tuple[str, dict[str, Any], str]:
    """Return id and arguments of the environment, `env_id`, else the first policy's with a file; and
    the name of that policy, "" without one."""
    records = {name: read_policy_record(name) for name in policies if not is_function(name)}
    for name in filter(is_model, records):
        if published and name != "shipped" and not records[name].get("env_id"):
            warnings.warn(f"policy {name}: nothing says what it was trained for", stacklevel=3)
    name, record = next(((name, record_of) for name, record_of in records.items() if record_of), ("", {}))
    known, arguments = environment_of(name, record, env_id)
    return DEFAULT_ENV if known is None else known, arguments, name


def _find_same(name: str, env: gym.Env[Any, Any], env_id: str) -> Any:
    """Return a policy that was made for just this environment, or for none; `DataFileError` if it was made
    for another id, leg, setting or version."""
    # What is a warning for a player is an error for a score.
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*(trained with|trained under|found for)", UserWarning)
        try:
            return find_policy(name, env, env_id)
        except UserWarning as unlike:
            raise DataFileError(f"{unlike}: its score would belong to another task") from None


class _Progress:
    """Function that counts episodes, and says every `TELL_SECONDS` on stderr how many there were."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._count = 0
        self._told = time.monotonic()

    def __call__(self, episodes: int = 1) -> None:
        self._count += episodes
        if time.monotonic() - self._told >= TELL_SECONDS:
            self._told = time.monotonic()
            print(f"{self._count} of {self._most} episodes", file=sys.stderr, flush=True)


# -- tables ------------------------------------------------------------------------------------


def published_lines(scores: Sequence[Score]) -> str:
    """Return the lines of the published tables, in Markdown: one for each policy, with intervals over
    episodes, and one for all trained ones, the interquartile mean over these with its interval."""
    rows = [Scored(score.policy, over_episodes(score.episodes)) for score in scores]
    trained = [mean_figures(score.episodes) for score in scores if is_model(score.policy)]
    # Scripted policies and gaits are no seeds of an algorithm.
    if len(trained) > 1:
        rows.append(Scored(f"IQM of {len(trained)}", over_seeds(trained), trained))
    titles = ["policy", "return", *(title for title, *_ in TABLE.values())]
    lines = [[row.name, row.intervals["return"].text(), *cells(row)] for row in rows]
    if "cost" in scores[0].estimates:
        titles.append("cost")
        # The mean over trained policies has none: each keeps its limit or does not
        costs = [score.estimates["cost"].text() for score in scores]
        for line, cost in zip(lines, [*costs, *[""] * (len(lines) - len(costs))], strict=True):
            line.append(cost)
    return markdown_table(titles, lines)


def text_table(scores: Sequence[Score]) -> str:
    """Return the same figures for a terminal: a line of means for each policy, and their intervals below."""
    columns = {"return": ("return", 1, 1.0), **TABLE, "failed": ("failed", 2, 1.0), "cost": ("cost", 1, 1.0)}
    known = [{**score.estimates, **over_episodes(score.episodes)} for score in scores]
    shown = {key: column for key, column in columns.items() if key in known[0]}
    lines = [["policy", *(title for title, *_ in shown.values())]]
    for score, intervals in zip(scores, known, strict=True):
        parts = [intervals[key].parts(digits, factor) for key, (_, digits, factor) in shown.items()]
        lines.append([score.policy, *(mean for mean, _ in parts)])
        if any(interval for _, interval in parts):
            lines.append(["", *(interval for _, interval in parts)])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip()
        for line in lines
    )


def cell(key: str, value: Interval) -> tuple[str, str]:
    """Format mean and interval of a metric."""
    return value.parts(METRICS[key].digits, METRICS[key].factor)


# -- files -------------------------------------------------------------------------------------


def to_json(scores: Sequence[Score], **about: Any) -> dict[str, Any]:
    """Return the scores as plain data: JSON knows no infinity, so an infinite figure is null."""

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    policies = {}
    for score in scores:
        intervals = score.estimates.items()
        episodes = score.episodes
        policies[score.policy] = {
            "mean": {key: finite(interval.mean) for key, interval in intervals},
            "interval95": {key: [finite(each.low), finite(each.high)] for key, each in intervals},
            "episodes": [{key: finite(value) for key, value in episode.items()} for episode in episodes],
        }
    return {**about, "policies": policies}


def write_json(found: Evaluation, path: Path | str) -> None:
    """Write all figures of all episodes, with means and intervals, as JSON."""
    path = as_path("path", path)
    about = {"env_id": found.env_id, "env_kwargs": found.env_kwargs, "seed": found.seeds.start}
    data = to_json(found.scores, **about, hoof_env=__version__)
    with staged(path.parent) as stage:
        text = json.dumps(data, indent=1, allow_nan=False, default=str) + "\n"
        (stage / path.name).write_text(text, encoding="utf-8")


def write_csv(found: Evaluation, path: Path | str) -> None:
    """Write a line for each episode of each policy: its seed, its return and the figures of its summary."""
    path = as_path("path", path)
    names = list(found.scores[0].episodes[0])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["policy", "seed", *names])
    for score in found.scores:
        for seed, episode in zip(found.seeds, score.episodes, strict=True):
            writer.writerow([score.policy, seed, *(episode[name] for name in names)])
    with staged(path.parent) as stage:
        (stage / path.name).write_text(text.getvalue(), encoding="utf-8")


WRITERS = {".csv": write_csv, ".json": write_json}
"""Writers by suffix."""
