"""Score scripted and trained policies on the same fresh episodes.

    python -m agents.evaluate --policy walk run idle random
    python -m agents.evaluate --policy run runs/ppo-HorseLeg-v0-s0 --json scores.json --video gait.mp4

A policy is a name (a gait of the preset, idle, random, bang-bang, drag, airborne; open-loop, the best stored
gait of the id), the .json of a gait, or a trained model: its .zip, .onnx or run folder. Brackets hold the
bootstrap's 95 % interval of the mean over episodes.

A model file is a pickle and can run any code when it is loaded: give only files that you trust.
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

import gymnasium as gym
import numpy as np

from agents import runs
from agents.command import parse_pairs, run
from agents.impact import LoadingRate
from hoof_env._output import check_folder
from hoof_env.envs.policies import make_policy, open_loop_record, policy_names, read_open_loop
from hoof_env.errors import OutputError, ParameterError, check_number
from hoof_env.onnx_policy import OnnxPolicy

DEFAULT_ENV = "hoof_env/HorseLeg-v0"


@dataclass(frozen=True)
class Metric:
    """One column of the table: `title`, factor and digits of what a person reads."""

    title: str
    factor: float = 1.0
    digits: int = 2


METRICS = {
    "return": Metric("return", digits=1),
    "distance_m": Metric("progress\nm", digits=1),
    "peak_grf_n": Metric("peak GRF\nkN", 1e-3),
    "stance_peak_n": Metric("stance peak\nkN", 1e-3),
    "mean_grf_n": Metric("mean GRF\nkN", 1e-3),
    "weight_share": Metric("weight\nshare"),
    "duty_factor": Metric("duty\nfactor"),
    "cost_of_transport": Metric("cost of\ntransport"),
    "failed": Metric("failed"),
    "loading_rate_n_s": Metric("loading rate\nkN/s", 1e-3, 1),
}
"""The columns: "return", figures of the episode summary (`hoof_env.envs.summary.summary_of`), and two means
over the stances of an episode, 0 without a stance: "stance_peak_n", of their highest force, and
"loading_rate_n_s" (`agents.impact`), of the steepest rise of the force at impact, where it is asked for."""


@dataclass(frozen=True)
class Estimate:
    """A mean over episodes and the bounds of its 95 % interval, None for one episode or an infinite mean."""

    mean: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Score:
    """What a policy did: one dictionary per episode, its return and the figures of its summary."""

    policy: str
    episodes: list[dict[str, float]]

    @cached_property
    def estimates(self) -> dict[str, Estimate]:
        """By key of `METRICS`, those that the episodes have."""
        return {
            key: estimate([one[key] for one in self.episodes]) for key in METRICS if key in self.episodes[0]
        }


def estimate(values: Sequence[float]) -> Estimate:
    """The mean of `values` and the bias-corrected bootstrap's 95 % interval of it."""
    from scipy.stats import bootstrap

    sample = np.asarray(values, dtype=float)
    mean = float(sample.mean())
    if len(sample) < 2 or not math.isfinite(mean):
        return Estimate(mean, None, None)
    if np.ptp(sample) <= 1e-12 * abs(mean):  # the bootstrap is undefined without variance
        return Estimate(mean, mean, mean)
    bounds = bootstrap((sample,), np.mean, rng=np.random.default_rng(0)).confidence_interval
    return Estimate(mean, float(bounds.low), float(bounds.high))


def play(
    env: gym.Env[Any, Any],
    policy: Any,
    seeds: Sequence[int],
    tick: Any = lambda: None,
    *,
    loading_rate: bool = False,
) -> list[dict[str, float]]:
    """One episode per seed; its return and its summary. `tick` is called after each. The loading rate needs
    an environment of this package, whose substeps it records."""
    episodes = []
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        rate = LoadingRate(env) if loading_rate else None
        total, start, done = 0.0, np.ones(1, bool), False
        while not done:
            action, _ = policy.predict(observation, episode_start=start, deterministic=True)
            observation, reward, terminated, truncated, info = env.step(action)
            total += float(np.asarray(reward).sum())  # of a vector, all objectives
            if rate:
                rate.add()
            start, done = np.zeros(1, bool), terminated or truncated
        summary = info.get("episode_summary", {})
        if "stances" in summary:
            summary["stance_peak_n"] = summary["stance_peak_sum_n"] / max(summary["stances"], 1.0)
        if rate:
            summary["loading_rate_n_s"] = rate.mean()
        episodes.append({"return": total, **summary})
        tick()
    return episodes


def is_model(name: str) -> bool:
    """Whether a policy's name is the path of a model rather than that of a scripted policy or of a gait."""
    if name.endswith(".json"):
        return False
    return name.endswith((".zip", ".onnx")) or Path(name).name != name or Path(name, "model.zip").is_file()


def saved(path: Path) -> OnnxPolicy | runs.SavedModel:
    """A policy in a file or a folder: an exported one, or a model of agents.train.

    Raises:
        DataFileError: there is none.
    """
    return OnnxPolicy(path) if OnnxPolicy.stands_at(path) else runs.SavedModel.find(path)


def recorded(name: str) -> dict[str, Any]:
    """What a policy's file says of itself, env_id and env_kwargs among it; empty for a scripted policy.

    Raises:
        DataFileError: no such model or gait.
    """
    if name.endswith(".json"):
        return open_loop_record(Path(name))
    return saved(Path(name)).record if is_model(name) else {}


def find_policy(name: str, env: gym.Env[Any, Any], env_id: str) -> Any:
    """A scripted policy by its name, or a trained one or an open-loop gait by its path.

    Raises:
        ParameterError: unknown name. DataFileError: no such model or gait, or one that does not fit.
    """
    if name.endswith(".json"):
        return read_open_loop(Path(name), env)
    if is_model(name):
        return saved(Path(name)).load(env, env_id)
    names = [*policy_names(env), "open-loop"] if hasattr(env.unwrapped, "gaits") else []
    if name not in names:
        known = ", ".join(names) or f"none is scripted for {env_id}"
        raise ParameterError(
            f"policy: expected a name ({known}), the path of a trained model or a gait's .json, got {name!r}"
        )
    if name == "open-loop":
        from agents.open_loop import load_open_loop

        return load_open_loop(env_id, env)
    return make_policy(name, env)


def film_paths(video: Path, names: Sequence[str]) -> dict[str, Path]:
    """Where the film of each policy goes: `video`, with the policy's name added if there are several.

    Raises:
        ParameterError: two films would have one name, or it is not that of an MP4.
    """
    if video.suffix.lower() not in ("", ".mp4"):
        raise ParameterError(f"--video: expected a file that ends in .mp4, got {str(video)!r}")
    paths: dict[str, Path] = {}
    for name in dict.fromkeys(names):
        short = Path(name).parent.name if name.endswith("model.zip") else Path(name).stem
        suffix = f"-{short}" if len(set(names)) > 1 else ""
        path = video.with_name(f"{video.stem}{suffix}{video.suffix or '.mp4'}")
        if path in paths.values():
            raise ParameterError(f"--video: expected policies of different names, got two films {path}")
        paths[name] = path
    return paths


@dataclass(frozen=True)
class Args:
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
    loading_rate: bool = False
    """also how steeply the force rises at impact; every substep is recorded, which takes 0.2 s an episode"""
    json: Path | None = None
    """write all figures of all episodes to this file"""
    video: Path | None = None
    """film the first episode of each policy to this MP4; with several policies the name is added to it"""


def evaluate(args: Args) -> tuple[list[Score], dict[str, Any]]:
    """Score the policies of `args`; returns the scores and what they were measured in (env_id, env_kwargs).

    Raises:
        ParameterError, DataFileError: the arguments, a policy or a model do not fit.
        OutputError: the JSON or the video cannot be written.
    """
    from tqdm import tqdm

    check_number("episodes", args.episodes, low=1)
    check_number("seed", args.seed, low=0)
    if not args.policy:
        raise ParameterError("policy: expected a name or the path of a trained model, got none")
    for path in filter(None, (args.json, args.video)):
        if path.is_dir():
            raise OutputError(f"cannot write to {str(path)!r}: expected a file, got a folder")
        check_folder(path.parent)
    record = next(filter(None, [recorded(name) for name in args.policy]), {})
    films = film_paths(args.video, args.policy) if args.video else {}
    env_id = args.env_id or record.get("env_id", DEFAULT_ENV)
    own = record.get("env_kwargs", {}) if env_id == record.get("env_id") else {}
    kwargs = parse_pairs("--env-kwargs", args.env_kwargs) or own
    scores = []
    with runs.make_env(env_id, **kwargs) as env:
        if args.loading_rate and not hasattr(env.unwrapped, "record"):
            raise ParameterError(f"--loading-rate: expected an environment of hoof_env, got {env_id}")
        runs.warm_up(env)
        # All are found before the first is played
        policies = {name: find_policy(name, env, env_id) for name in args.policy}
        with tqdm(total=args.episodes * len(policies), unit=" episodes", leave=False, disable=None) as bar:
            for name, policy in policies.items():
                bar.set_description(name)
                seeds = range(args.seed, args.seed + args.episodes)
                played = play(env, policy, seeds, bar.update, loading_rate=args.loading_rate)
                scores.append(Score(name, played))
    if args.video:
        from agents.video import film

        with runs.make_env(env_id, **{**kwargs, "render_mode": "rgb_array"}) as env:
            for name, path in films.items():
                film(env, find_policy(name, env, env_id), path, seed=args.seed)
                print(f"filmed {name}: {path}")
    return scores, {"env_id": env_id, "env_kwargs": kwargs}


def cell(metric: Metric, value: Estimate) -> tuple[str, str]:
    """Mean and interval as a person reads them; no interval where there is none or all episodes agree."""
    if not math.isfinite(value.mean):
        return "∞", ""
    mean, *bounds = (
        "" if x is None else f"{x * metric.factor:.{metric.digits}f}"
        for x in (value.mean, value.low, value.high)
    )
    return mean, f"[{bounds[0]}, {bounds[1]}]" if value.low != value.high else ""


def table(scores: Sequence[Score]) -> Any:
    """The scores as a `rich` table."""
    from rich import box
    from rich.table import Table

    columns = list(scores[0].estimates)
    grid = Table(box=box.SIMPLE_HEAD, show_lines=False, pad_edge=False)
    grid.add_column("policy", no_wrap=True)
    for key in columns:
        grid.add_column(METRICS[key].title, justify="right")
    for score in scores:
        cells = [cell(METRICS[key], score.estimates[key]) for key in columns]
        grid.add_row(score.policy, *("\n".join(pair) for pair in cells))
    return grid


def print_table(scores: Sequence[Score]) -> None:
    """Print the scores; as wide as they need where the output is not a terminal."""
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else 160).print(table(scores))


def to_json(scores: Sequence[Score], **about: Any) -> dict[str, Any]:
    """The scores as plain data: JSON knows no infinity, so an infinite figure is null."""

    def finite(value: float | None) -> float | None:
        return value if value is not None and math.isfinite(value) else None

    return {
        **about,
        "policies": {
            score.policy: {
                "mean": {key: finite(value.mean) for key, value in score.estimates.items()},
                "interval95": {key: [finite(v.low), finite(v.high)] for key, v in score.estimates.items()},
                "episodes": [{key: finite(value) for key, value in one.items()} for one in score.episodes],
            }
            for score in scores
        },
    }


def main(argv: list[str] | None = None) -> None:
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
