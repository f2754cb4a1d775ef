"""Score any policy on the episodes that the reported tables are made of.

    python -m agents.score run open-loop runs/ppo-HorseLeg-v0-s0
    python -m agents.score policy.onnx --csv episodes.csv
    python -m agents.score my_module:act --env-id hoof_env/HorseLegRail-v0

A policy is what agents.evaluate takes, or MODULE:NAME, a Python function of observations, shape (n, k), that
returns actions, one row each. Each gets the line that it would have in docs/evidence/baselines.md; several
trained ones, as the seeds of one algorithm, also a line for all of them. A policy that was trained for
another id, leg, setting or version is refused. A model file is a pickle and can run any code when it is
loaded, and a module is code: give only what you trust.

Episodes are rows of the native vector environment where the id has one. A row is the episode that `play`
gives with the same seed, to the bit where the policy acts in a batch as alone: scripted policies do, but for
"random", which draws for all rows at once; a network does to its last bits.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from tyro.conf import Positional

from agents import runs
from agents.command import parse_pairs, run
from agents.statistics import PUBLISHED, TABLE, Scored, cells, mean_figures, over_episodes, over_seeds
from hoof_env import records
from hoof_env._output import check_folder, markdown_table
from hoof_env.envs.policies import open_loop_record, start_of
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.errors import DataFileError, OutputError, ParameterError
from hoof_env.saved_policy import find_saved
from hoof_env.saved_record import environment_of

ROWS = 1024  # episodes side by side at most; more are played one batch after the other

CURVE_SEEDS = range(1000, 1020)
"""Episodes of the learning curves; training starts its own from other seeds."""

FINAL_SEEDS = range(1_000_000, 1_000_100)
"""Episodes of the final scores, on which nothing else is played: no training, curve, tuning or search."""


def play(
    env: gym.Env[Any, Any],
    policy: Any,
    seeds: Sequence[int],
    tick: Any = lambda: None,
) -> list[dict[str, float]]:
    """Play one episode per seed, with the start of the policy; return the return and the summary of each.
    `tick` is called after each."""
    episodes = []
    for seed in seeds:
        observation, info = env.reset(seed=seed, options=start_of(policy))
        total = 0.0
        start = np.ones(1, bool)
        done = False
        while not done:
            action, _ = policy.predict(observation, episode_start=start, deterministic=True)
            observation, reward, terminated, truncated, info = env.step(action)
            total += float(np.asarray(reward).sum())  # a vector reward: the sum of all objectives
            start = np.zeros(1, bool)
            done = terminated or truncated
        episodes.append({"return": total, **_with_stance_peak(info.get("episode_summary", {}))})
        tick()
    return episodes


def score_vector(policy: Any, env_id: str, seeds: Sequence[int], **env_kwargs: Any) -> list[dict[str, float]]:
    """Play one episode per seed, as `play` does, in batches of the native vector environment if the id has
    one.

    Args:
        policy: one with Stable-Baselines3's `predict` for many observations, shape (n, k), and
            `episode_start`, shape (n,), or its name or path as `find_policy` takes them.
        env_id: id of the environment.
        seeds: seeds of the episodes.
        **env_kwargs: arguments of the environment.

    Raises:
        ParameterError: unknown environment or policy.
        DataFileError: a model that does not fit.
    """
    with runs.make_env(env_id, **env_kwargs) as env:
        if isinstance(policy, str):
            policy = find_policy(policy, env, env_id)
        if not hasattr(policy, "predict"):
            raise ParameterError(f"policy: expected one with predict, or its name, got {policy!r}")
        episodes: list[dict[str, float]] = []
        envs = None
        for first in range(0, len(seeds), ROWS):
            batch = list(seeds[first : first + ROWS])
            # The last batch may be smaller
            if envs is None or envs.num_envs != len(batch):
                envs = make_rows(env_id, len(batch), **env_kwargs)
            episodes += play(env, policy, batch) if envs is None else play_rows(envs, policy, batch)
    return episodes


def make_rows(env_id: str, num_envs: int, **env_kwargs: Any) -> HorseLegVectorEnv | None:
    """Return the native vector environment of an id, None if there is none."""
    with suppress(gym.error.Error):
        many: dict[str, Any] = {"num_envs": num_envs, "vectorization_mode": "vector_entry_point"}
        envs = gym.make_vec(env_id, **many, **env_kwargs).unwrapped
        if isinstance(envs, HorseLegVectorEnv):
            return envs
    return None


def play_rows(envs: HorseLegVectorEnv, policy: Any, seeds: Sequence[int]) -> list[dict[str, float]]:
    """Play as `score_vector` does in an environment with one row for each seed."""
    observation, _ = envs.reset(seed=list(seeds), options=start_of(policy))
    start = np.ones(envs.num_envs, bool)
    going = np.ones(envs.num_envs, bool)
    total = np.zeros(envs.num_envs)
    state = None
    episodes: list[dict[str, float]] = [{} for _ in seeds]
    while going.any():
        actions, state = policy.predict(observation, state, episode_start=start, deterministic=True)
        observation, rewards, terminated, truncated, infos = envs.step(actions)
        total += np.where(going, rewards, 0.0)  # a row that is over starts again; that is not counted
        ended = going & (terminated | truncated)
        for row in np.flatnonzero(ended):
            columns = infos["episode_summary"]
            summary = {key: float(x[row]) for key, x in columns.items() if not key.startswith("_")}
            episodes[row] = {"return": float(total[row]), **_with_stance_peak(summary)}
        going &= ~ended
        # A row that has ended begins a new episode, which a policy with a memory must know
        start = terminated | truncated
    return episodes


def _with_stance_peak(summary: Mapping[str, float]) -> dict[str, float]:
    """Return a summary with the mean of the stances' highest forces [N]."""
    if "stances" not in summary:
        return dict(summary)
    return {**summary, "stance_peak_n": summary["stance_peak_sum_n"] / max(summary["stances"], 1.0)}


def is_model(name: str) -> bool:
    """True if a policy's name is the path of a model, not that of a scripted policy or of a gait."""
    is_path = (
        name.lower().endswith((".zip", ".onnx"))
        or Path(name).name != name
        or Path(name, runs.MODEL).is_file()
    )
    return is_path and not name.endswith(".json")


def read_policy_record(name: str) -> dict[str, Any]:
    """Return the record in a policy's file, env_id and env_kwargs among it; empty for a scripted policy.
    `DataFileError`: no such model or gait."""
    if name.endswith(".json"):
        return open_loop_record(Path(name))
    return find_saved(Path(name)).record if is_model(name) else {}


def find_policy(name: str, env: gym.Env[Any, Any], env_id: str) -> Any:
    """Return a policy as `hoof_env.records.find_policy` does, or a model of any environment by its path.

    Raises:
        ParameterError: unknown name.
        DataFileError: no such model or gait, or one that does not fit.
    """
    if is_model(name):
        return find_saved(Path(name)).load(env, env_id)
    if not hasattr(env.unwrapped, "gaits"):
        raise ParameterError(
            f"policy: expected the path of a trained model, for none is scripted for {env_id}, got {name!r}"
        )
    return records.find_policy(name, env, env_id)


# The command


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policy: Positional[tuple[str, ...]]
    """names of scripted policies, paths of gaits and trained models, or MODULE:NAME"""
    env_id: str | None = None
    """environment; otherwise that of the first model or gait file, or hoof_env/HorseLeg-v0"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object; what was trained with others is refused"""
    csv: Path | None = None
    """write a line for each episode to this file"""


@dataclass(frozen=True)
class Function:
    """Policy from a Python function of observations, shape (n, k), that returns actions, a row each."""

    name: str
    act: Callable[[Any], Any]
    actions: int

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return actions for observations, shape (n, k) or (k,); `ParameterError` if the function does not
        fit."""
        rows = np.atleast_2d(observation)
        try:
            actions = np.asarray(self.act(rows), np.float32)
        except (TypeError, ValueError) as error:
            raise ParameterError(
                f"policy {self.name}: expected a function of observations: {error}"
            ) from error
        if actions.shape != (len(rows), self.actions) or not np.isfinite(actions).all():
            raise ParameterError(
                f"policy {self.name}: expected finite actions of shape {(len(rows), self.actions)} for"
                f" observations of shape {rows.shape}, got shape {actions.shape} and"
                f" {np.sum(~np.isfinite(actions))} that are not finite"
            )
        return actions.reshape(*np.shape(observation)[:-1], self.actions), state


def is_function(name: str) -> bool:
    """True if a policy's name has the form MODULE:NAME."""
    module, _, function = name.partition(":")
    return function.isidentifier() and all(part.isidentifier() for part in module.split("."))


def find_function(name: str, actions: int) -> Function:
    """Return the function MODULE:NAME, of this folder or installed; `ParameterError` if there is none."""
    module, _, function = name.partition(":")
    # MODULE may lie in the working folder, which not every interpreter searches
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        act = getattr(import_module(module), function)
    except (ImportError, AttributeError, SyntaxError) as error:
        raise ParameterError(f"policy: expected MODULE:NAME, got {name!r}: {error}") from error
    if not callable(act):
        raise ParameterError(f"policy {name}: expected a function of observations, got {act!r}")
    return Function(name, act, actions)


def find_same(name: str, env: gym.Env[Any, Any], env_id: str) -> Any:
    """Return a policy that was made for just this environment, or for none; `DataFileError` if it was made
    for another id, leg, setting or version."""
    if is_function(name):
        return find_function(name, gym.spaces.flatdim(env.action_space))
    # What is a warning for a player is an error for a score
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*(trained with|found for)", UserWarning)
        try:
            return find_policy(name, env, env_id)
        except UserWarning as unlike:
            raise DataFileError(f"{unlike}: its score would be that of another task") from None


def score(args: Args) -> list[tuple[str, list[dict[str, float]]]]:
    """Play the episodes of each policy, and print where they are played.

    Raises:
        ParameterError: an argument or a policy does not fit; nothing has been played.
        DataFileError: a model does not fit; nothing has been played.
        OutputError: the file cannot be written.
    """
    from tqdm import tqdm

    if args.csv:
        check_folder(args.csv.parent)
        if args.csv.is_dir():
            raise OutputError(f"--csv: expected the name of a file, {str(args.csv)!r} is a folder")
    read = {name: read_policy_record(name) for name in args.policy if not is_function(name)}
    for name in filter(is_model, read):
        if not read[name].get("env_id"):
            warnings.warn(f"policy {name}: nothing says what it was trained for", stacklevel=2)
    file, record = next(((name, record_of) for name, record_of in read.items() if record_of), ("", {}))
    asked, trained_kwargs = environment_of(file, record, args.env_id)
    env_id = asked or runs.DEFAULT_ENV
    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs) or trained_kwargs
    with runs.make_env(env_id, **env_kwargs) as env:
        policies = {name: find_same(name, env, env_id) for name in args.policy}
    with_what = f" with {env_kwargs}" if env_kwargs else ""
    print(f"{env_id}{with_what}, episodes {FINAL_SEEDS[0]:,} to {FINAL_SEEDS[-1]:,}\n", flush=True)
    bar = tqdm(policies.items(), unit=" policies", leave=False, disable=None)
    return [(name, score_vector(policy, env_id, FINAL_SEEDS, **env_kwargs)) for name, policy in bar]


def lines(scored: Sequence[tuple[str, list[dict[str, float]]]]) -> str:
    """Return the table: a line for each policy, with intervals over episodes, and one for all trained ones,
    the interquartile mean over these with its interval."""
    rows = [Scored(name, over_episodes(episodes)) for name, episodes in scored]
    trained = [mean_figures(episodes) for name, episodes in scored if is_model(name)]
    # Scripted policies and gaits are no seeds of an algorithm
    if len(trained) > 1:
        rows.append(Scored(f"IQM of {len(trained)}", over_seeds(trained), trained))
    titles = ["policy", "return", *(title for title, *_ in TABLE.values())]
    return markdown_table(titles, [[row.name, row.intervals["return"].text(), *cells(row)] for row in rows])


def main(argv: list[str] | None = None) -> None:
    """Score, print and write."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.score", description=__doc__)
    scored = score(args)
    print(lines(scored))
    if args.csv:
        rows: list[dict[str, Any]] = []
        for name, episodes in scored:
            for seed, figures in zip(FINAL_SEEDS, episodes, strict=True):
                published = {key: figures[key] for key in PUBLISHED if key in figures}
                rows.append({"policy": name, "episode": seed, **published})
        runs.write_csv(args.csv, ("policy", "episode", *PUBLISHED), rows)
        print(f"written: {args.csv}")


if __name__ == "__main__":
    run(main)
