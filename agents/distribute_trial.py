"""Trials under Ray Tune: a training as a trial on a worker, and the progress and the table of all trials."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any, ClassVar

from ray import tune

from agents import checkpoints, runs
from agents.settings import ENV
from agents.train import Args, train
from agents.watch import DivergedError, Scorer
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.evaluation.episodes import CURVE_SEEDS

FIXED = ("train", "env_kwargs", "params", "report_every", "seed", "command")
"""Keys of a trial's configuration that no search chooses, seeds aside."""


def train_trial(config: dict[str, Any]) -> None:
    """Train as `config` says (`agents.distribute.prepare`).

    Every `report_every` steps and at the end it reports the score to Tune and, as a checkpoint, the run
    folder. A trial that is retried goes on from its last checkpoint. One that diverges or has settings that
    do not fit would do so again: it ends with the reason as its figure "failed".
    """
    chosen = {key: value for key, value in config.items() if key not in FIXED}
    env_kwargs = config["env_kwargs"] | {
        k.removeprefix(ENV): v for k, v in chosen.items() if k.startswith(ENV)
    }
    params = config["params"] | {k: v for k, v in chosen.items() if not k.startswith(ENV)}
    folder = Path("run").absolute()  # in the trial's own folder on the worker
    shutil.rmtree(folder, ignore_errors=True)  # a worker that died here left it
    checkpoint = tune.get_checkpoint()
    if checkpoint:
        checkpoint.to_directory(str(folder))
    reporter = Reporter(folder, config, env_kwargs, checkpoint.get_metadata() if checkpoint else {})
    # The reporter keeps the checkpoints: two of the same step would not go into one folder
    args = Args(
        **config["train"],
        seed=config["seed"],
        out=folder,
        resume=True,
        checkpoint_every=0,
        env_kwargs=(json.dumps(env_kwargs),),
        params=(json.dumps(params),),
    )
    # run.json shall name the user's command, not that of Ray's worker
    sys.orig_argv = shlex.split(config["command"])
    try:
        train(args, reporter)
    except (ParameterError, DataFileError, DivergedError) as error:
        tune.report({"return": float("nan"), **reporter.last, "failed": str(error)})
    else:
        reporter.report()


class Reporter(Scorer):
    """Scorer that keeps a checkpoint and reports it to Tune with the score.

    Attributes:
        last: the last score: "return", mean over the episodes of `CURVE_SEEDS`, "steps", and "train_s",
            seconds of training alone, those of earlier tries included.
    """

    def __init__(
        self, folder: Path, config: dict[str, Any], env_kwargs: dict[str, Any], last: dict[str, float]
    ) -> None:
        super().__init__(config["train"]["env_id"], env_kwargs, CURVE_SEEDS, config["report_every"])
        self.folder = folder
        self.last = dict(last)
        self.wall_s = self.last.get("train_s", 0.0)

    def keep(self, episodes: list[dict[str, float]]) -> None:
        mean = sum(episode["return"] for episode in episodes) / len(episodes)
        self.last = {"return": mean, "steps": self.num_timesteps, "train_s": self.wall_s}

    def _on_rollout_start(self) -> None:
        before = self.scored_at
        super()._on_rollout_start()
        if self.scored_at > before:
            checkpoints.save(self.model, self.folder, self.wall_s)
            # Each report uploads the folder: one checkpoint is enough
            checkpoints.tidy(self.folder, keep=1)
            self.report()
            self._start_clock()

    def report(self) -> None:
        """Report the last score with the run folder as its checkpoint."""
        checkpoint = tune.Checkpoint.from_directory(str(self.folder))
        checkpoint.set_metadata(self.last)
        tune.report(self.last, checkpoint=checkpoint)


FIGURES = ("return", "steps", "train_s")  # numbers of a report


class Progress(tune.Callback):
    """Callback that prints a line for each score, and when a trial ends, when its worker died and when it
    goes on.

    Attributes:
        going: ids of trials that had not ended at the last step; an attribute of the class, for Tune works
            with a copy of the callback.
    """

    going: ClassVar[set[str]] = set()

    def on_step_end(self, iteration: int, trials: list[Any], **info: Any) -> None:
        Progress.going = {t.trial_id for t in trials if t.status not in ("TERMINATED", "ERROR")}

    def on_trial_result(
        self, iteration: int, trials: list[Any], trial: Any, result: dict[str, Any], **info: Any
    ) -> None:
        write_line(trial, f"{result.get('steps', 0):,.0f} steps, return {result['return']:.2f}")

    def on_trial_recover(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        report = trial.latest_checkpoint_result
        steps = report.metrics["steps"] if report else 0
        write_line(trial, f"{last_failure(trial)} Retry {trial.num_failures}, from step {steps:,.0f}")

    def on_trial_error(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        write_line(trial, f"{last_failure(trial)} No retry is left")

    def on_trial_complete(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        write_line(trial, f"done, return {trial.last_result['return']:.2f}")


def write_line(trial: Any, what: str) -> None:
    """Print a line about a trial."""
    print(f"trial {trial.trial_id.rpartition('_')[2]}: {what}", flush=True)


def last_failure(trial: Any) -> str:
    """Return the last failure of a trial in one line."""
    path = Path(trial.error_file or "")
    return reason(path.read_text() if path.is_file() else "")


def reason(error: str) -> str:
    """Return the last failure in a line: Ray writes its message first, but after a traceback Python's is
    last."""
    # Ray colours its messages
    error = re.sub(r"\x1b\[[\d;]*m", "", error)
    lines = [line.strip() for line in error.rpartition("Failure #")[2].strip().splitlines()]
    lines = [line for line in lines if "(occurred at" not in line] or ["unknown."]
    return lines[-1 if any(line.startswith(("Traceback", "ray::")) for line in lines) else 0]


def write_table(results: Any, folder: str, varied: list[str]) -> int:
    """Write `folder`/trials.csv if that is a path, print the outcome of the trials, and return the exit code:
    0, 1 if a trial failed for good, 130 if one has not ended."""
    rows = []
    reasons = []
    # Whether a trial is done stands in its status alone; but after Ctrl-C all look as if they were
    pairs = zip(results, results._experiment_analysis.trials, strict=True)
    for result, trial in sorted(pairs, key=lambda pair: Path(pair[0].path).name):
        report = result.metrics or {}
        config = result.config or {}
        # A trial that failed at once has no checkpoint
        run = result.checkpoint.path if result.checkpoint else ""
        why = reason(str(result.error)) if result.error else report.get("failed")
        is_done = trial.status == "TERMINATED" and trial.trial_id not in Progress.going
        state = "done" if is_done else "unfinished"
        if why:
            state = "failed"
            reasons.append(f"  {run or 'a trial'}: {why}")
        row = {key: config.get(key) for key in varied} | {key: report.get(key) for key in FIGURES}
        rows.append(row | {"state": state, "run": str(run).removeprefix(f"{folder}/")})
    if "://" not in folder and rows:
        runs.write_csv(Path(folder, "trials.csv"), list(rows[0]), rows)
    states = [row["state"] for row in rows]
    counts = {state: states.count(state) for state in ("done", "failed", "unfinished")}
    print(", ".join(f"{count} {state}" for state, count in counts.items() if count) + f": {folder}")
    print("\n".join(reasons), end="\n" if reasons else "")
    if counts["unfinished"]:
        print("interrupted; the same command goes on")
        return 130
    return 1 if counts["failed"] else 0
