"""Learning curves of stock algorithms with their library's own defaults: one environment, no wrapper.

    python -m agents.stock                                 all trainings that the table lacks, hours
    python -m agents.stock --env-id hoof_env/HorseLeg-v0 --algo ppo --seeds 3 --steps 100000 --out runs/stock
    python -m agents.stock --draw                          table and picture alone
    python -m agents.stock --preset klann                  of another leg, to docs/evidence/legs/klann
    python -m agents.stock --preset klann --half-rates     with actions that change its gait half as fast

PPO, SAC and TD3 are Stable-Baselines3's, TQC is sb3-contrib's, made as `PPO("MlpPolicy", env)` makes them. A
policy is scored without its noise on 100 starts that no training meets. A training is one set of rows in
curves.csv, written when it is through: after an interruption the same command goes on with those that are
missing. The curves are compared with policies that need no learning: the zero action, which keeps the gait
that an episode starts in, the scripted gait, and the best gait of `agents.open_loop`.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs, stock_page
from agents.command import run
from agents.settings import FOLDER, load_settings
from agents.stock_plan import (
    COLUMNS,
    FIGURES,
    HALF_RATES,
    LEGS,
    LEGS_PLAN,
    PLAN,
    TUNED,
    Curves,
    leg_folder,
    read_curves,
)
from agents.train import Args as TrainArgs
from agents.train import make_model
from hoof_env._output import check_folder
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows, play_rows
from hoof_env.policies.saved import ALGORITHMS, algorithm_class

OUT = Path(__file__).parents[1] / "docs" / "evidence" / "stock"
"""Folder of the published curves."""

LEGS_OUT = OUT.with_name("legs")
"""Folder with one for each other leg."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    env_id: str | None = None
    """only this id"""
    algo: str | None = None
    """only this algorithm: ppo, sac, td3, tqc, or ppo_flat with the settings of agents/hyperparams"""
    seeds: int | None = None
    """trainings of each, from seed 0 on; otherwise those of the table"""
    steps: int | None = None
    """of each training; otherwise those of the table. Of ppo_flat rounded up to whole rollouts"""
    preset: str | None = None
    """another leg than that of the ids: jansen, klann or fourbar; agents.legs writes its table"""
    half_rates: bool = False
    """with half the usual crank_rate and swing_rate; of a preset alone"""
    workers: int = 1
    """trainings side by side, each on one thread"""
    out: Path | None = None
    """folder of curves.csv, README.md and stock.png; otherwise docs/evidence/stock, of a preset
    docs/evidence/legs/PRESET, or PRESET-half-rates"""
    draw: bool = False
    """train nothing; write table and picture from what is there"""


@dataclass(frozen=True)
class Job:
    """Training of one algorithm on one id with one seed."""

    curves: Curves
    seed: int

    @property
    def key(self) -> tuple[str, str, int]:
        """Key of its rows in curves.csv."""
        return self.curves.env_id, self.curves.algo, self.seed


def jobs(args: Args) -> list[Job]:
    """Return the trainings that the arguments select.

    Raises:
        ParameterError: an unknown id or algorithm, or a count out of range.
    """
    if args.algo is not None:
        check_choice("algo", args.algo, (*ALGORITHMS, TUNED))
    for name in ("seeds", "steps", "workers"):
        if getattr(args, name) is not None:
            check_number(name, getattr(args, name), low=1, high=1e9)
    plan = PLAN
    if args.preset is not None:
        check_choice("preset", args.preset, LEGS)
        asked_for = (args.preset, args.half_rates)
        plan = tuple(curves for curves in LEGS_PLAN if (curves.preset, curves.half_rates) == asked_for)
    elif args.half_rates:
        raise ParameterError("--half-rates: expected with --preset, for another leg than that of the ids")
    chosen = [
        curves for curves in plan if args.env_id in (None, curves.env_id) and args.algo in (None, curves.algo)
    ]
    if not chosen:
        known = ", ".join(dict.fromkeys(f"{curves.algo} on {curves.env_id}" for curves in plan))
        raise ParameterError(f"expected one of {known}; got {args.algo} on {args.env_id}")
    trainings = []
    for curves in chosen:
        steps = whole_rollouts(curves, args.steps) if args.steps else curves.steps
        # Steps of the command's choice keep the distance of scores where they can
        asked = replace(curves, seeds=args.seeds or curves.seeds, steps=steps, every=min(curves.every, steps))
        trainings += [Job(asked, seed) for seed in range(asked.seeds)]
    return trainings


def whole_rollouts(curves: Curves, steps: int) -> int:
    """So many steps, of ppo_flat rounded up to whole rollouts of its many environments: it passes over the
    steps between, where the last score would never be."""
    if curves.algo != TUNED:
        return steps
    settings = load_settings(FOLDER / f"{TUNED}.yml", curves.env_id)
    rollout = settings["n_envs"] * settings["n_steps"]
    return -(-steps // rollout) * rollout


def train(job: Job) -> list[dict[str, Any]]:
    """Train with the library's defaults, or `TUNED` with its own settings; return the rows of the curve."""
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    # Trainings share the cores; seconds are comparable only on one thread
    torch.set_num_threads(1)
    curves = job.curves
    envs = make_rows(curves.env_id, len(FINAL_SEEDS), **leg_of(curves))
    assert envs is not None
    rows: list[dict[str, Any]] = []
    commit = runs.versions().get("commit", "")
    processor = runs.processor()

    class Curve(BaseCallback):
        """Callback that scores the policy every `curves.every` steps and at the end."""

        began = 0.0
        scored = 0.0  # seconds that scores took

        def _on_training_start(self) -> None:
            self.began = time.process_time()

        def _on_step(self) -> bool:
            if self.num_timesteps % curves.every == 0 or self.num_timesteps == curves.steps:
                # The clock of learning stops while the policy is scored
                paused = time.process_time()
                spent = paused - self.began - self.scored
                add(self.model, self.num_timesteps, spent)
                self.scored += time.process_time() - paused
            return True

    def add(model: Any, steps: int, seconds: float) -> None:
        """Score a model and append the row."""
        episodes = play_rows(envs, model, FINAL_SEEDS)
        means = {
            name: float(np.mean([episode[name] for episode in episodes])) for name in ("return", *FIGURES)
        }
        figures = (steps, round(means["return"], 2), round(seconds, 1), commit, processor)
        rows.append(dict(zip(COLUMNS, (*job.key, *figures), strict=True)))
        if curves.preset:
            rows[-1] |= {name: round(means[name], 4) for name in FIGURES}

    model = tuned_model(job) if curves.algo == TUNED else stock_model(job)
    add(model, 0, 0.0)
    model.learn(curves.steps, callback=Curve())
    model.env.close()
    return rows


def leg_of(curves: Curves) -> dict[str, Any]:
    """Return the arguments of the environment that ask for another leg, if there is one."""
    leg = {"preset": curves.preset} if curves.preset else {}
    return {**leg, **(HALF_RATES if curves.half_rates else {})}


def stock_model(job: Job) -> Any:
    """Return the learner as its library makes it."""
    env = runs.make_env(job.curves.env_id, **leg_of(job.curves))
    return algorithm_class(job.curves.algo)("MlpPolicy", env, seed=job.seed, device="cpu")


def tuned_model(job: Job) -> Any:
    """Return the learner with the settings of agents/hyperparams, for as many steps."""
    curves = job.curves
    settings = load_settings(FOLDER / f"{curves.algo}.yml", curves.env_id) | {"n_timesteps": curves.steps}
    many = runs.make_vec_env(curves.env_id, settings["n_envs"])
    return make_model(TrainArgs(env_id=curves.env_id, algo=TUNED, seed=job.seed), settings, many)


def trained(pending: Sequence[Job], workers: int) -> Iterator[list[dict[str, Any]]]:
    """Yield the rows of each training when it is through."""
    if workers == 1:
        yield from map(train, pending)
        return
    # A fresh process for each training, which keeps nothing of the last one: kernels, caches of torch
    with multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=1) as pool:
        yield from pool.imap_unordered(train, pending)


def folder_of(args: Args) -> Path:
    """Return the folder that is written."""
    if args.out:
        return args.out
    return LEGS_OUT / leg_folder(args.preset, args.half_rates) if args.preset else OUT


def has_run(rows: Sequence[dict[str, Any]], job: Job) -> bool:
    """True if a training's rows are there, up to its last step."""
    steps = [row["steps"] for row in rows if (row["env_id"], row["algo"], row["seed"]) == job.key]
    return max(steps, default=-1) >= job.curves.steps


def stock(args: Args) -> list[dict[str, Any]]:
    """Train what is missing, then write table and picture; return all rows.

    Raises:
        ParameterError: an unknown id or algorithm, or a count out of range.
        DataFileError: the folder's curves.csv cannot be read.
        OutputError: the folder cannot be written.
    """
    wanted = jobs(args)
    out = folder_of(args)
    check_folder(out)
    out.mkdir(parents=True, exist_ok=True)
    rows = read_curves(out)
    pending = [] if args.draw else [job for job in wanted if not has_run(rows, job)]
    for steps in sorted({job.curves.steps for job in pending if args.steps not in (None, job.curves.steps)}):
        print(f"{TUNED}: {steps} steps instead of {args.steps}, which are no whole rollouts", flush=True)
    for done, new in enumerate(trained(pending, args.workers), 1):
        key = tuple(new[0][name] for name in ("env_id", "algo", "seed"))
        # A longer training replaces a shorter one of the same seed
        rows = [row for row in rows if (row["env_id"], row["algo"], row["seed"]) != key] + new
        rows.sort(key=lambda row: (row["env_id"], row["algo"], row["seed"], row["steps"]))
        runs.write_csv(out / "curves.csv", COLUMNS + FIGURES if args.preset else COLUMNS, rows)
        env_id, algo, seed = key
        returns = " ".join(f"{row['return']:.0f}" for row in new)
        print(f"{done} of {len(pending)}: {algo} on {env_id}, seed {seed}: {returns}", flush=True)
    if rows and args.preset is None:
        stock_page.write(out, rows)
    return rows


def main(argv: list[str] | None = None) -> None:
    """Train and write the page."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.stock", description=__doc__)
    stock(args)
    print(f"written: {folder_of(args)}")
    if folder_of(args) == OUT:
        print("next: python -m agents.gallery, which tells the pages of the ids")


if __name__ == "__main__":
    run(main)
