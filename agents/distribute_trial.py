"""One training as a trial of Ray Tune: what runs on a worker."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

from agents import checkpoints
from agents.baselines_plan import CURVE_SEEDS
from agents.baselines_run import policy_of
from agents.distribute_space import ENV
from agents.score import score_vector
from agents.train import Args, train
from agents.watch import DivergedError
from hoof_env.errors import DataFileError, ParameterError

FIXED = ("train", "env_kwargs", "params", "report_every", "seed", "command")
"""Keys of a trial's configuration that no search chooses, seeds aside."""


def train_trial(config: dict[str, Any]) -> None:
    """Train as `config` says; every `report_every` steps and at the end report to Tune the score and, as a
    checkpoint, the run folder. A trial that is retried goes on from its last one. One that diverges or whose
    settings do not fit would do so again: it ends with the reason as its figure "failed".

    Args:
        config: "train", fields of `agents.train.Args`; "env_kwargs" and "params", mappings; "report_every",
            steps; "seed"; "command", for run.json; and what the search chose: hyperparameters, and arguments
            of the environment behind "env.".
    """
    from ray import tune

    chosen = {key: value for key, value in config.items() if key not in FIXED}
    env_kwargs = config["env_kwargs"] | {
        k.removeprefix(ENV): v for k, v in chosen.items() if k.startswith(ENV)
    }
    params = config["params"] | {k: v for k, v in chosen.items() if not k.startswith(ENV)}
    folder = Path("run").absolute()  # in the trial's own folder on the worker
    shutil.rmtree(folder, ignore_errors=True)  # of a worker that died here
    kept = tune.get_checkpoint()
    if kept:
        kept.to_directory(str(folder))
    reporter = make_reporter(folder, config, env_kwargs, kept.get_metadata() if kept else {})
    # The reporter keeps the checkpoints: two of the same step would not go into one folder
    args = Args(
        **config["train"], seed=config["seed"], out=folder, resume=True, checkpoint_every=0,
        env_kwargs=(json.dumps(env_kwargs),), params=(json.dumps(params),),
    )  # fmt: skip
    sys.orig_argv = shlex.split(config["command"])
    try:
        # A trial is a thread of its worker, where signals cannot be caught; Tune stops it at a report
        with patch("agents.train.stop_on_signals", lambda watch: nullcontext()):
            train(args, reporter)
    except (ParameterError, DataFileError, DivergedError) as error:
        tune.report({"return": float("nan"), **reporter.last, "failed": str(error)})
    else:
        reporter.report()


def make_reporter(folder: Path, config: dict[str, Any], env_kwargs: dict[str, Any], last: Any) -> Any:
    """The callback that scores the policy, keeps a checkpoint and reports both to Tune. `last` holds the last
    score: "return", mean over the episodes of `CURVE_SEEDS`; "steps"; "train_s", seconds of training, scores
    and retried parts aside."""
    from ray import tune
    from stable_baselines3.common.callbacks import BaseCallback

    env_id, every = config["train"]["env_id"], config["report_every"]

    class Reporter(BaseCallback):
        last: dict[str, float]

        def _on_training_start(self) -> None:
            self.train_s, self.since = self.last.get("train_s", 0.0), time.monotonic()
            self.next = self.num_timesteps + every

        def _on_rollout_start(self) -> None:
            if self.num_timesteps >= self.next:
                self.next += every
                self._score()
                checkpoints.save(self.model, folder, self.train_s)
                checkpoints.tidy(folder, keep=1)
                self.report()
                self.since = time.monotonic()

        def _on_training_end(self) -> None:
            self._score()

        def _on_step(self) -> bool:
            return True

        def _score(self) -> None:
            self.train_s += time.monotonic() - self.since
            episodes = score_vector(policy_of(self.model), env_id, CURVE_SEEDS, **env_kwargs)
            score = sum(one["return"] for one in episodes) / len(episodes)
            self.last = {"return": score, "steps": self.num_timesteps, "train_s": self.train_s}

        def report(self) -> None:
            checkpoint = tune.Checkpoint.from_directory(str(folder))
            checkpoint.set_metadata(self.last)
            tune.report(self.last, checkpoint=checkpoint)

    reporter = Reporter()
    reporter.last = dict(last)
    return reporter
