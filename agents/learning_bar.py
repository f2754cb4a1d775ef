"""How long learning takes: trainings from nothing, scored as they go, until they beat the scripted gaits.

    python -m agents.learning_bar                                            hoof_env/HorseLeg-v0, five seeds
    python -m agents.learning_bar --env-id hoof_env/HorseLegRail-v0 --seeds 3

Each seed is trained by agents.train with its settings. Every so many steps the policy's mean return over the
same 20 episodes, with which no training starts, is compared with those of the scripted gaits. Into the folder
go SEED/ (the run; its model is the last), curve.csv (a row per score) and bar.json (what they say). Seeds
that are there are not trained again.

Seconds are of training alone: without scores, imports and the compilation of kernels. Wall time tells of the
machine's other work, too; the processor's time of this process does not.
"""

from __future__ import annotations

import csv
import io
import json
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse_pairs, run
from agents.train import Args as TrainArgs
from agents.train import train
from hoof_env._output import check_folder
from hoof_env.errors import ParameterError, check_number

EPISODES, FIRST_SEED = 20, 1000
"""Scored episodes; training starts its own from other seeds."""

COLUMNS = ("seed", "steps", "wall_s", "cpu_s", "return")
"""Of curve.csv."""


@dataclass(frozen=True)
class Args:
    env_id: str = "hoof_env/HorseLeg-v0"
    """registered environment with scripted gaits"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object"""
    seeds: int = 5
    """trainings, from seed 0 on"""
    every: int = 50_000
    """training steps between two scores"""
    steps: int | None = None
    """of each training; otherwise n_timesteps of the hyperparameter file"""
    minutes: float = 15.0
    """of wall time for each training at most, scores included"""
    params: tuple[str, ...] = ()
    """hyperparameters to change: key=value ..., or one JSON object"""
    torch_threads: int = 1
    """threads of torch"""
    out: Path | None = None
    """folder; otherwise runs/learning/ENV"""


def measure(args: Args) -> dict[str, Any]:
    """Train all seeds and write the folder; returns what bar.json holds.

    Raises:
        ParameterError, DataFileError, OutputError: as `train`. KeyboardInterrupt: Ctrl-C; seeds done stay.
    """
    check_number("seeds", args.seeds, low=1, high=FIRST_SEED)
    check_number("every", args.every, low=1)
    kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    folder = args.out or Path("runs/learning", args.env_id.rpartition("/")[2])
    check_folder(folder)
    scripted = gait_returns(args.env_id, kwargs)
    print(f"{args.env_id}: " + ", ".join(f"{name} {value:.2f}" for name, value in scripted.items()))
    found: dict[str, Any] = {
        "env_id": args.env_id, "env_kwargs": kwargs, "scripted": scripted, "seeds": {},
        "command": runs.command(), "versions": runs.versions(),
    }  # fmt: skip
    for seed in range(args.seeds):
        rows = read_rows(folder / "curve.csv", seed) or _train_one(args, kwargs, seed, folder)
        found["seeds"][str(seed)] = beaten = time_to_beat(rows, max(scripted.values()))
        print(f"seed {seed}: {beaten}", flush=True)
    runs.write_text(folder / "bar.json", json.dumps(found, indent=1) + "\n")
    return found


def _train_one(args: Args, kwargs: dict[str, Any], seed: int, folder: Path) -> list[dict[str, float]]:
    watch = make_scorer(args, kwargs, seed)
    shutil.rmtree(folder / str(seed), ignore_errors=True)  # of a training that was interrupted
    trained = train(
        TrainArgs(
            env_id=args.env_id, env_kwargs=args.env_kwargs, seed=seed, steps=args.steps, params=args.params,
            out=folder / str(seed), checkpoint_every=0, max_minutes=args.minutes,
            torch_threads=args.torch_threads,
        ),
        watch,
    )  # fmt: skip
    if trained.stopped_by:
        raise KeyboardInterrupt
    add_rows(folder / "curve.csv", watch.rows)
    rows: list[dict[str, float]] = watch.rows
    return rows


def make_scorer(args: Args, kwargs: dict[str, Any], seed: int) -> Any:
    """The callback that scores the policy before training, every `every` steps, and at the end."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Scorer(BaseCallback):
        def _on_training_start(self) -> None:
            self.rows: list[dict[str, float]] = []
            self.envs = runs.make_vec_env(args.env_id, EPISODES, **kwargs)
            self.wall = self.cpu = 0.0  # of training alone
            self._clock()
            self._score()

        def _on_rollout_start(self) -> None:
            if self.num_timesteps >= self.rows[-1]["steps"] + args.every:
                self._score()

        def _on_training_end(self) -> None:
            if self.num_timesteps > self.rows[-1]["steps"]:
                self._score()
            self.envs.close()

        def _on_step(self) -> bool:
            return True

        def _clock(self) -> None:
            self.since = time.monotonic(), time.process_time()

        def _score(self) -> None:
            self.wall += time.monotonic() - self.since[0]
            self.cpu += time.process_time() - self.since[1]
            predict = lambda observation: self.model.predict(observation, deterministic=True)[0]  # noqa: E731
            values = (
                seed,
                self.num_timesteps,
                self.wall,
                self.cpu,
                float(np.mean(returns(self.envs, predict))),
            )
            self.rows.append(dict(zip(COLUMNS, values, strict=True)))
            self._clock()

    return Scorer()


def returns(envs: Any, predict: Any, first_seed: int = FIRST_SEED) -> NDArray[np.float64]:
    """Returns of one episode in each of `envs`, a `VecEnv`, from seed `first_seed` on; `predict` maps
    observations to actions."""
    envs.seed(first_seed)
    observation, total, going = envs.reset(), np.zeros(envs.num_envs), np.ones(envs.num_envs, bool)
    while going.any():
        observation, reward, done, _ = envs.step(predict(observation))
        total += reward * going
        going &= ~done
    return total


def gait_returns(env_id: str, kwargs: dict[str, Any]) -> dict[str, float]:
    """Mean return of every scripted gait of an environment, by name.

    Raises:
        ParameterError: an environment without scripted gaits.
    """
    with runs.make_env(env_id, **kwargs) as env:
        leg: Any = env.unwrapped
        if not hasattr(leg, "gaits"):
            raise ParameterError(f"env_id: expected an environment with scripted gaits, got {env_id!r}")
        actions = {name: leg.action_for(gait) for name, gait in leg.gaits.items()}
    envs, found = runs.make_vec_env(env_id, EPISODES, **kwargs), {}
    for name, action in actions.items():
        command = np.tile(action, (EPISODES, 1))
        found[name] = float(np.mean(returns(envs, lambda _, command=command: command)))
    envs.close()
    return found


def time_to_beat(rows: list[dict[str, float]], level: float) -> dict[str, float] | None:
    """Of the scores of one training, the first above `level`, with the last return; None if none is."""
    for row in rows:
        if row["return"] > level:
            return {**{key: row[key] for key in COLUMNS[1:]}, "last_return": rows[-1]["return"]}
    return None


def read_rows(path: Path, seed: int | None = None) -> list[dict[str, float]]:
    """The rows of a curve.csv, or those of one seed; none if there is no file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    return [row for row in rows if seed is None or row["seed"] == seed]


def add_rows(path: Path, rows: list[dict[str, float]]) -> None:
    """Add rows to a curve.csv, all or none."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for row in (*read_rows(path), *rows):
        writer.writerow({key: round(row[key], 3) for key in COLUMNS})
    runs.write_text(path, text.getvalue())


def main(argv: list[str] | None = None) -> None:
    import tyro

    found = measure(tyro.cli(Args, args=argv, prog="python -m agents.learning_bar", description=__doc__))
    beaten = [one["wall_s"] for one in found["seeds"].values() if one]
    print(f"{len(beaten)} of {len(found['seeds'])} beat every scripted gait", end="")
    print(f", after {min(beaten):.0f} to {max(beaten):.0f} s of wall time" if beaten else "")


if __name__ == "__main__":
    run(main)
