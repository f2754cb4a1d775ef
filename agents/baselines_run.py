"""One training of the baselines table, scored as it goes and at its end.

    python -m agents.baselines_run --algo ppo --env-id hoof_env/HorseLeg-v0 --seed 0

The folder is that of `agents.train` with curve.csv, a row per score on the episodes of the learning curves,
and final.json, the last policy's score on fresh episodes. The same command goes on with a training that was
interrupted, and does nothing where it is done.

Seconds are of training alone: without scores, imports and the compilation of kernels. Wall time tells of the
machine's other work, too; the processor's time of this process does not.
"""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from agents import runs
from agents.baselines_plan import CURVE_SEEDS, FIGURES, FINAL_SEEDS, LEG, figures
from agents.command import parse_pairs, run
from agents.score import score_vector
from agents.settings import FOLDER, load_settings
from agents.train import Args as TrainArgs
from agents.train import train
from hoof_env.errors import check_number

COLUMNS = ("steps", "wall_s", "cpu_s", *FIGURES)
"""Of curve.csv; a figure that the id does not have stays empty."""

CURVE, FINAL = "curve.csv", "final.json"


@dataclass(frozen=True)
class Args:
    algo: Literal["ppo", "sac", "td3", "tqc"] = "ppo"
    """algorithm, with its file in agents/hyperparams"""
    env_id: str = LEG
    """registered environment"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object"""
    seed: int = 0
    """of the training"""
    steps: int | None = None
    """environment steps; otherwise n_timesteps of the hyperparameter file"""
    params: tuple[str, ...] = ()
    """hyperparameters to change: key=value ..., or one JSON object"""
    points: int = 30
    """scores on the way, at equal distances"""
    out: Path | None = None
    """run folder; otherwise runs/baselines/ALGO-ENV-sSEED"""


def train_one(args: Args) -> bool:
    """Train, or go on training, and score; whether it is done, and not interrupted.

    Raises:
        ParameterError, DataFileError, OutputError: as `agents.train.train`.
    """
    check_number("points", args.points, low=1)
    check_number("seed", args.seed, low=0, high=CURVE_SEEDS[0] // 2)
    name = args.env_id.rpartition("/")[2]
    folder = args.out or Path("runs/baselines", f"{args.algo}-{name}-s{args.seed}")
    if (folder / FINAL).is_file():
        return True
    kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    settings = load_settings(FOLDER / f"{args.algo}.yml", args.env_id) | parse_pairs("--params", args.params)
    steps = args.steps if args.steps is not None else int(settings["n_timesteps"])
    scorer = make_scorer(args.env_id, kwargs, folder, every=max(1, steps // args.points))
    trained = train(
        TrainArgs(
            env_id=args.env_id, env_kwargs=args.env_kwargs, algo=args.algo, seed=args.seed, steps=steps,
            params=args.params, out=folder, resume=True,
        ),
        scorer,
    )  # fmt: skip
    if trained.stopped_by:
        return False
    last = read_curve(folder / CURVE)[-1]
    found = {
        "algo": args.algo, "env_id": args.env_id, "env_kwargs": kwargs, "seed": args.seed,
        **{key: last[key] for key in ("steps", "wall_s", "cpu_s")},
        "seeds": [FINAL_SEEDS.start, FINAL_SEEDS.stop],
        "episodes": score_vector(str(folder), args.env_id, FINAL_SEEDS, **kwargs),
    }  # fmt: skip
    runs.write_text(folder / FINAL, json.dumps(found) + "\n")
    return True


def policy_of(model: Any) -> runs.TrainedPolicy:
    """The policy of a model in training, as it will be when it is loaded."""
    normalize = model.get_vec_normalize_env()
    return runs.TrainedPolicy(model, normalize.normalize_obs if normalize is not None else None)


def make_scorer(env_id: str, kwargs: dict[str, Any], folder: Path, every: int) -> Any:
    """The callback that scores the policy before training, every `every` steps and at the end, into
    curve.csv. Scores that a resumed training has yet to reach again are dropped."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Scorer(BaseCallback):
        def _on_training_start(self) -> None:
            steps = self.num_timesteps
            earlier = read_curve(folder / CURVE) if steps else []
            self.rows = [row for row in earlier if row["steps"] <= steps]
            last = self.rows[-1] if self.rows else {}
            part = steps / max(last.get("steps", 0.0), 1.0)
            self.wall, self.cpu = (last.get(key, 0.0) * part for key in ("wall_s", "cpu_s"))
            self.starter = os.getppid()
            self._clock()
            if not self.rows:
                self._score()

        def _on_rollout_start(self) -> None:
            if self.num_timesteps // every > self.rows[-1]["steps"] // every:
                self._score()

        def _on_training_end(self) -> None:
            if self.num_timesteps > self.rows[-1]["steps"]:
                self._score()

        def _on_step(self) -> bool:
            if os.getppid() != self.starter:  # who started this is gone: end as if told to
                os.kill(os.getpid(), signal.SIGTERM)
                self.starter = os.getppid()
            return True

        def _clock(self) -> None:
            self.since = time.monotonic(), time.process_time()

        def _score(self) -> None:
            self.wall += time.monotonic() - self.since[0]
            self.cpu += time.process_time() - self.since[1]
            episodes = score_vector(policy_of(self.model), env_id, CURVE_SEEDS, **kwargs)
            clock = {"steps": self.num_timesteps, "wall_s": self.wall, "cpu_s": self.cpu}
            self.rows.append({**clock, **figures(episodes)})
            write_curve(folder / CURVE, self.rows)
            self._clock()

    return Scorer()


def read_curve(path: Path) -> list[dict[str, float]]:
    """The rows of a curve.csv; none if there is no file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [{key: float(x) for key, x in row.items() if x} for row in csv.DictReader(file)]


def write_curve(path: Path, rows: list[dict[str, float]]) -> None:
    """Write a curve.csv, whole or not at all."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: f"{value:.10g}" for key, value in row.items()} for row in rows)
    runs.write_text(path, text.getvalue())


def main(argv: list[str] | None = None) -> int:
    import tyro

    done = train_one(tyro.cli(Args, args=argv, prog="python -m agents.baselines_run", description=__doc__))
    print("done" if done else "interrupted; the same command goes on")
    return 0 if done else 130


if __name__ == "__main__":
    run(main)
