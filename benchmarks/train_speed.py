"""Speed of training of Stable-Baselines3's PPO and agents/ppo_flat.py, and its parts.

    python -m benchmarks.train_speed      writes train_speed.json and .md, where `benchmarks.speed` does

Each round trains every case, in a new order, for one rollout and its updates, with the settings of
agents/hyperparams. `python -m agents.experiments --plan trainers` has the results of such trainings.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from stable_baselines3.common.logger import Logger

from agents import runs
from agents.settings import FOLDER, Algorithm, load_settings
from agents.train import Args, make_model
from benchmarks.history import RESULTS, write
from benchmarks.machine import machine, vector_bits
from benchmarks.rounds import bar_text, describe, interleave, spread
from hoof_env._output import markdown_table
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.simd.threads import available

ENV_ID = "hoof_env/HorseLeg-v0"
SB3 = "PPO, 1 thread"
BAR = 2.5

INTRO = """\
# How fast PPO trains

Written by `python -m benchmarks.train_speed`: PPO of Stable-Baselines3 and of agents/ppo_flat.py, settings
of agents/hyperparams for `{env_id}`. {rounds} interleaved rounds, each of one rollout and its updates
({units:,} steps); wall time, median (quartiles; extremes). Threads of PPO are torch's."""

PARTS = """\
## Where the time goes

Microseconds a step, the median over rounds. The kernel is one call for all legs; the environment is the rest
of its step, with what Stable-Baselines3 asks of it; play is the policy and the bookkeeping."""


def model_of(algo: Algorithm, env_threads: int = 1, **params: Any) -> Any:
    """Return a model of an algorithm with `params` instead of the file's, on its environments."""
    settings = load_settings(FOLDER / f"{algo}.yml", ENV_ID) | params
    many = runs.make_vec_env(ENV_ID, settings["n_envs"], env_threads)
    model = make_model(Args(env_id=ENV_ID, algo=algo), settings, many)
    model.set_logger(Logger(None, []))
    return model


def train(model: Any, torch_threads: int = 1) -> float:
    """Return the wall time [s] of a rollout and its updates."""
    torch.set_num_threads(torch_threads)
    begin = time.perf_counter()
    model.learn(model.n_steps * model.n_envs, reset_num_timesteps=False)
    return time.perf_counter() - begin


class Clock:
    """Sum of the time that functions take."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the same function, timed."""

        def call(*args: Any, **kwargs: Any) -> Any:
            begin = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                self.seconds += time.perf_counter() - begin

        return call

    def take(self) -> float:
        """Return the sum since the last call."""
        taken, self.seconds = self.seconds, 0.0
        return taken


def where_time_goes(model: Any, rounds: int) -> dict[str, float]:
    """Return the seconds of a rollout and its updates, by part; medians."""
    timed = [(EpisodeBatch, "step"), (model.env, "step_async"), (model.env, "step_wait"), (model, "train")]
    clocks = [Clock() for _ in timed]
    rows = []
    # Clocks stand around methods in this block alone: other models are not timed
    with ExitStack() as stack:
        for clock, (owner, name) in zip(clocks, timed, strict=True):
            stack.enter_context(patch.object(owner, name, clock.around(getattr(owner, name))))
        for _ in range(rounds):
            whole = train(model)
            kernel, begin, wait, update = (clock.take() for clock in clocks)
            rows.append((kernel, begin + wait - kernel, whole - begin - wait - update, update))
    names = ("kernel", "environment", "play", "updates")
    return dict(zip(names, np.median(rows, 0).tolist(), strict=True))


def measure(rounds: int) -> dict[str, Any]:
    """Return rates, ratios to Stable-Baselines3 on one thread, and parts."""
    threads = min(2, available())
    sb3 = model_of("ppo")
    flat = {n: model_of("ppo_flat", num_threads=n) for n in {1, threads}}
    cases = {SB3: partial(train, sb3), f"PPO, {threads} threads": partial(train, model_of("ppo"), threads)}
    cases |= {f"PPO_FLAT, {n} thread{'s' * (n > 1)}": partial(train, model) for n, model in flat.items()}
    too = f"{threads} threads, environments too"
    cases |= {
        f"PPO, {too}": partial(train, model_of("ppo", threads), threads),
        f"PPO_FLAT, {too}": partial(train, model_of("ppo_flat", threads), threads),
    }
    seconds = interleave(cases, rounds)
    units = sb3.n_steps * sb3.n_envs
    parts = {SB3: where_time_goes(sb3, rounds)}
    parts |= {f"PPO_FLAT, {n} thread{'s' * (n > 1)}": where_time_goes(m, rounds) for n, m in flat.items()}
    return {
        "machine": machine(),
        "bits": vector_bits(),
        "rounds": rounds,
        "env_id": ENV_ID,
        "units": units,
        "rows": [
            {
                "case": name,
                "rate": spread(units / values),
                "ratio": spread(seconds[SB3] / values),
                "bar": BAR if name.startswith("PPO_FLAT") else None,
            }
            for name, values in seconds.items()
        ],
        "parts": {name: {key: x / units for key, x in part.items()} for name, part in parts.items()},
    }


def page(result: dict[str, Any]) -> str:
    """Return the tables as Markdown."""
    rates = [
        [
            row["case"],
            f"{row['rate']['median']:,.0f}",
            f"{1e6 / row['rate']['median']:.1f}",
            describe(row["ratio"]),
            bar_text(row["bar"], row["ratio"]) if row["bar"] else "",
        ]
        for row in result["rows"]
    ]
    names = list(result["parts"][SB3])
    parts = [[case, *(f"{1e6 * part[name]:.1f}" for name in names)] for case, part in result["parts"].items()]
    tables = (
        INTRO.format(**result),
        markdown_table(["", ""], [[key, value] for key, value in result["machine"].items()]),
        markdown_table(["case", "steps/s", "us a step", f"beside {SB3}", "bar"], rates),
        PARTS,
        markdown_table(["case", *names], parts),
    )
    return "\n\n".join(tables) + "\n"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of results of all vector widths")
    args = parser.parse_args()
    result = measure(args.rounds)
    print(page(result))
    rows = [(row["case"], SB3, row["ratio"], row["bar"]) for row in result["rows"]]
    write(args.out, "train_speed", result, page(result), rows)


if __name__ == "__main__":
    main()
