"""One training of a plan, with its learning curve and the score of its last policy.

    python -m agents.experiments.training --algo ppo --env-id hoof_env/HorseLeg-v0 --seed 0

The folder holds the files of `agents.train`, curve.csv, a row per score, and final.json, the last policy's
score on fresh episodes. The same command goes on where it was interrupted. Seconds are of training alone;
wall time depends on the machine's other work, too.
"""

from __future__ import annotations

import csv
import json
import os
import signal
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents import runs
from agents.command import parse, parse_pairs, run
from agents.settings import FOLDER, TrainingArgs, load_settings
from agents.train import Args as TrainArgs
from agents.train import train
from agents.watch import Scorer
from hoof_env.errors import check_number
from hoof_env.evaluation.episodes import CURVE_SEEDS, FINAL_SEEDS, score_vector
from hoof_env.evaluation.statistics import FIGURES, mean_figures

COLUMNS = ("steps", "wall_s", "cpu_s", *FIGURES)
"""Columns of curve.csv; a figure that the id does not have stays empty."""

CURVE = "curve.csv"
FINAL = "final.json"


@dataclass(frozen=True)
class Args(TrainingArgs):
    """Arguments of the command."""

    seed: int = 0
    """of the training"""
    points: int = 30
    """scores on the way, at equal distances, between two rollouts"""
    every: int | None = None
    """steps between two scores, in place of their number; at that very step, on the episodes of
    the final score"""
    hyperparams: Path | None = None
    """YAML file in rl-baselines3-zoo's format; otherwise agents/hyperparams/ALGO.yml"""
    out: Path | None = None
    """run folder; otherwise runs/baselines/ALGO-ENV-sSEED"""


def train_one(args: Args) -> bool:
    """Train, or go on training, and score; return False if it was interrupted. Errors as
    in `train`."""
    check_number("points", args.points, low=1)
    if args.every is not None:
        check_number("every", args.every, low=1)
    # Episodes of a training start at its seed: they must not reach the scored ones
    check_number("seed", args.seed, low=0, high=CURVE_SEEDS[0] // 2)
    name = args.env_id.rpartition("/")[2]
    folder = args.out or Path("runs/baselines", f"{args.algo}-{name}-s{args.seed}")
    # final.json is written last, so a training that has it is complete
    if (folder / FINAL).is_file():
        return True
    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    settings = load_settings(args.hyperparams or FOLDER / f"{args.algo}.yml", args.env_id)
    settings |= parse_pairs("--params", args.params)
    steps = args.steps if args.steps is not None else int(settings["n_timesteps"])
    training = TrainArgs(
        env_id=args.env_id,
        env_kwargs=args.env_kwargs,
        algo=args.algo,
        seed=args.seed,
        steps=steps,
        params=args.params,
        hyperparams=args.hyperparams,
        out=folder,
        resume=True,
    )
    if args.every is None:
        scorer = CurveScorer(args.env_id, env_kwargs, folder, max(1, steps // args.points))
    else:
        scorer = StepScorer(args.env_id, env_kwargs, folder, args.every, steps)
    if train(training, scorer).stopped_by:
        return False
    last = read_curve(folder / CURVE)[-1]
    final = {
        "algo": args.algo,
        "env_id": args.env_id,
        "env_kwargs": env_kwargs,
        "seed": args.seed,
        **{key: last[key] for key in ("steps", "wall_s", "cpu_s")},
        "processor": runs.processor(),
        "seeds": [FINAL_SEEDS.start, FINAL_SEEDS.stop],
        "episodes": score_vector(str(folder), args.env_id, FINAL_SEEDS, **env_kwargs),
    }
    runs.write_text(folder / FINAL, json.dumps(final) + "\n")
    return True


class CurveScorer(Scorer):
    """Scorer into curve.csv of `folder`, between two rollouts; it scores the untrained policy, too.

    Scores that a resumed training has yet to reach again are dropped. The training ends, with a checkpoint,
    if the process that began it is gone.
    """

    seeds = CURVE_SEEDS

    def __init__(self, env_id: str, env_kwargs: Mapping[str, Any], folder: Path, every: int) -> None:
        super().__init__(env_id, env_kwargs, self.seeds, every)
        self.path = folder / CURVE

    def _on_training_start(self) -> None:
        super()._on_training_start()
        steps = self.num_timesteps
        self.rows = [row for row in read_curve(self.path) if row["steps"] <= steps] if steps else []
        self.starter = os.getppid()
        # A new curve begins with the untrained policy
        if not self.rows:
            self.score()
            return
        last = self.rows[-1]
        self.scored_at = int(last["steps"])
        # Seconds from the last score to the checkpoint are not known: as many a step as before
        self.wall_s, self.cpu_s = (
            last.get(key, 0.0) * steps / max(last["steps"], 1.0) for key in ("wall_s", "cpu_s")
        )

    def _on_step(self) -> bool:
        # An orphan would train on unseen; SIGTERM leaves a checkpoint
        if os.getppid() != self.starter:
            os.kill(os.getpid(), signal.SIGTERM)
            self.starter = os.getppid()
        return True

    def keep(self, episodes: list[dict[str, float]]) -> None:
        clock = {"steps": float(self.num_timesteps), "wall_s": self.wall_s, "cpu_s": self.cpu_s}
        self.rows.append(clock | mean_figures(episodes))
        runs.write_csv(self.path, COLUMNS, self.rows, "{:.10g}")


class StepScorer(CurveScorer):
    """Scorer at every `every` steps and at the last of `steps`, also within a rollout, where the policy is
    that before the next update."""

    seeds = FINAL_SEEDS

    def __init__(
        self, env_id: str, env_kwargs: Mapping[str, Any], folder: Path, every: int, steps: int
    ) -> None:
        super().__init__(env_id, env_kwargs, folder, every)
        self.steps = steps

    def _on_step(self) -> bool:
        is_due = self.num_timesteps // self.every > self.scored_at // self.every
        if is_due or self.scored_at < self.steps <= self.num_timesteps:
            self.score()
        return super()._on_step()

    def _on_rollout_start(self) -> None:
        pass

    def _on_training_end(self) -> None:
        pass


def read_curve(path: Path) -> list[dict[str, float]]:
    """Return the rows of a curve.csv, without empty cells; an empty list if there is no file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [{key: float(x) for key, x in row.items() if x} for row in csv.DictReader(file)]


def main(argv: list[str] | None = None) -> int:
    """Train, and return the exit code."""
    done = train_one(parse(Args, argv, "python -m agents.experiments.training", __doc__))
    print("done" if done else "interrupted; the same command goes on")
    return 0 if done else 130


if __name__ == "__main__":
    run(main)
