"""Score scripted and trained policies on the same fresh episodes.

    python -m agents.evaluate --policy walk run idle random
    python -m agents.evaluate --policy run runs/ppo-HorseLeg-v0-s0 --json scores.json --video gait.mp4

A policy is a name (a gait of the preset, idle, random, bang-bang, drag, airborne; open-loop, the best stored
gait of the id), the .json of a gait, or a trained model: its .zip, .onnx or run folder. Brackets hold the
bootstrap's 95 % interval of the mean over episodes. A model file is a pickle and can run any code when it is
loaded: give only files that you trust.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from agents import runs
from agents.command import parse_pairs, run
from agents.score import find_policy, play, read_policy_record
from agents.statistics import Interval, estimate
from hoof_env import records
from hoof_env._output import check_folder
from hoof_env.errors import OutputError, ParameterError, check_number
from hoof_env.saved_record import environment_of

FPS = 50.0  # frames a second of films


@dataclass(frozen=True)
class Metric:
    """Column of the table: title, and factor and digits of the printed value."""

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
    "loading_rate_n_s": Metric("loading rate\nkN/s", 1e-3, 1),
}
"""Columns of the table: "return", figures of the episode (`hoof_env.envs.batch.EpisodeBatch.summary`), and
"stance_peak_n", the mean over its stances of their highest force, 0 without a stance."""


@dataclass(frozen=True)
class Score:
    """Score of a policy: one dictionary per episode, with its return and the figures of its summary."""

    policy: str
    episodes: list[dict[str, float]]

    @cached_property
    def estimates(self) -> dict[str, Interval]:
        """Means and intervals by key of `METRICS`, those that the episodes have."""
        return {
            key: estimate([one[key] for one in self.episodes]) for key in METRICS if key in self.episodes[0]
        }


def film_paths(video: Path, names: Sequence[str]) -> dict[str, Path]:
    """Return the path of each policy's film: `video`, with the policy's name added if there are several;
    `ParameterError` if two films would have one name, or it is not that of an MP4."""
    if video.suffix.lower() not in ("", ".mp4"):
        raise ParameterError(f"--video: expected a file that ends in .mp4, got {str(video)!r}")
    paths: dict[str, Path] = {}
    for name in dict.fromkeys(names):
        # Every model has this file name; its run folder tells them apart
        short = Path(name).parent.name if name.endswith("model.zip") else Path(name).stem
        suffix = f"-{short}" if len(set(names)) > 1 else ""
        path = video.with_name(f"{video.stem}{suffix}{video.suffix or '.mp4'}")
        if path in paths.values():
            raise ParameterError(f"--video: expected policies of different names, got two films {path}")
        paths[name] = path
    return paths


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policy: tuple[str, ...] = ("walk", "run", "idle", "random")
    """names of scripted policies, paths of gaits and trained models (trusted ones only: a model is code)"""
    episodes: int = 20
    """of each policy"""
    seed: int = 1000
    """of the first episode; the others follow it"""
    env_id: str | None = None
    """environment; otherwise that of the first model or gait file, or hoof_env/HorseLeg-v0"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object; otherwise those of the first model or gait file"""
    json: Path | None = None
    """write all figures of all episodes to this file"""
    video: Path | None = None
    """film the first episode of each policy to this MP4; with several policies the name is added to it"""


def evaluate(args: Args) -> tuple[list[Score], dict[str, Any]]:
    """Score the policies of `args`; return the scores and the env_id and env_kwargs that they were measured
    in.

    Raises:
        ParameterError: an argument or a policy does not fit.
        DataFileError: a model does not fit.
        OutputError: the JSON or the video cannot be written.
    """
    from tqdm import tqdm

    _check(args)
    # Before anything is played: two policies may ask for one file
    films = film_paths(args.video, args.policy) if args.video else {}
    env_id, env_kwargs = _environment(args)
    scores = []
    with runs.make_env(env_id, **env_kwargs) as env:
        if args.video and not hasattr(env.unwrapped, "record"):
            raise ParameterError(f"--video: expected an environment of hoof_env, got {env_id}")
        runs.warm_up(env)
        # All are found before the first is played
        policies = {name: find_policy(name, env, env_id) for name in args.policy}
        with tqdm(total=args.episodes * len(policies), unit=" episodes", leave=False, disable=None) as bar:
            for name, policy in policies.items():
                bar.set_description(name)
                seeds = range(args.seed, args.seed + args.episodes)
                scores.append(Score(name, play(env, policy, seeds, bar.update)))
        for name, path in films.items():
            film(env, find_policy(name, env, env_id), path, args.seed)
            print(f"filmed {name}: {path}")
    return scores, {"env_id": env_id, "env_kwargs": env_kwargs}


def _check(args: Args) -> None:
    """Check the arguments before anything is played."""
    check_number("episodes", args.episodes, low=1)
    check_number("seed", args.seed, low=0)
    if not args.policy:
        raise ParameterError("policy: expected a name or the path of a trained model, got none")
    for path in filter(None, (args.json, args.video)):
        if path.is_dir():
            raise OutputError(f"cannot write to {str(path)!r}: expected a file, got a folder")
        check_folder(path.parent)


def _environment(args: Args) -> tuple[str, dict[str, Any]]:
    """Return id and arguments of the environment: those of the command, else those of the first policy with a
    file."""
    records_of = {name: read_policy_record(name) for name in args.policy}
    name, record = next(((name, record_of) for name, record_of in records_of.items() if record_of), ("", {}))
    env_id, env_kwargs = environment_of(name, record, args.env_id)
    return env_id or runs.DEFAULT_ENV, parse_pairs("--env-kwargs", args.env_kwargs) or env_kwargs


def film(env: Any, policy: Any, path: Path, seed: int) -> None:
    """Write one episode to an MP4; an older file is replaced at the end, `OutputError` if it cannot be."""
    from hoof_env.film import frames, write_film
    from hoof_env.render.renderer import new_renderer

    renderer = new_renderer(records.surroundings(env), FPS, (960, 540))
    write_film(frames(renderer, records.episode(env, policy, seed), FPS), path, FPS)


def cell(key: str, value: Interval) -> tuple[str, str]:
    """Format mean and interval of a metric."""
    return value.parts(METRICS[key].digits, METRICS[key].factor)


def table(scores: Sequence[Score]) -> Any:
    """Return the scores as a table of rich."""
    from rich import box
    from rich.table import Table

    columns = list(scores[0].estimates)
    grid = Table(box=box.SIMPLE_HEAD, show_lines=False, pad_edge=False)
    grid.add_column("policy", no_wrap=True)
    for key in columns:
        grid.add_column(METRICS[key].title, justify="right")
    for score in scores:
        cells = [cell(key, score.estimates[key]) for key in columns]
        grid.add_row(score.policy, *("\n".join(pair) for pair in cells))
    return grid


def print_table(scores: Sequence[Score]) -> None:
    """Print the scores; as wide as they need if the output is not a terminal."""
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else 180).print(table(scores))


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


def main(argv: list[str] | None = None) -> None:
    """Score, print and write."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.evaluate", description=__doc__)
    scores, setting = evaluate(args)
    print_table(scores)
    if args.json:
        data = to_json(scores, **setting, seed=args.seed, command=runs.command(), versions=runs.versions())
        runs.write_text(args.json, json.dumps(data, indent=1, allow_nan=False) + "\n")
        print(f"written: {args.json}")


if __name__ == "__main__":
    run(main)
