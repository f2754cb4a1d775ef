"""What a person sees of an experiment of Ray Tune: a bar, a line for each retry, a table at the end."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import Any, ClassVar

from ray import tune
from tqdm import tqdm

from agents import runs


def figures(found: dict[str, Any] | None) -> dict[str, Any]:
    """Of a report of `distribute_trial` or of RLlib: return, steps and seconds of training."""
    found = found or {}
    runner = found.get("env_runners", {})
    return {
        "return": found.get("return", runner.get("episode_return_mean")),
        "steps": found.get("steps", found.get("num_env_steps_sampled_lifetime")),
        "train_s": found.get("train_s", found.get("time_total_s")),
    }


class Progress(tune.Callback):
    """A bar over trials, and a line when one ends, when its worker died and when it goes on.

    Attributes:
        going: ids of trials that had not ended at the last step; of the class, for Tune works with a copy.
    """

    going: ClassVar[set[str]] = set()

    def setup(self, **info: Any) -> None:
        self.shown: tuple[int, str] = (-1, "")
        self.bar: Any = None  # made where the experiment runs: Ray may send this object there

    def on_step_end(self, iteration: int, trials: list[Any], **info: Any) -> None:
        Progress.going = {t.trial_id for t in trials if t.status not in ("TERMINATED", "ERROR")}
        ended = len(trials) - len(Progress.going)
        if self.bar is None:
            self.bar = tqdm(unit=" trials", initial=ended, mininterval=0.0)
        best = [x for trial in trials if (x := figures(trial.last_result)["return"]) is not None]
        running = sum(trial.status == "RUNNING" for trial in trials)
        told = f"{running} running" + (f", best return {max(best):.1f}" if best else "")
        if (ended, told) != self.shown:
            self.shown, self.bar.total, self.bar.n = (ended, told), len(trials), ended
            self.bar.set_postfix_str(told)

    def on_trial_recover(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        kept = trial.latest_checkpoint_result
        steps = figures(kept.metrics)["steps"] if kept else 0
        self._tell(trial, f"{last_failure(trial)} Retry {trial.num_failures}, from step {steps:,.0f}")

    def on_trial_error(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        self._tell(trial, f"{last_failure(trial)} No retry is left")

    def on_trial_complete(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        found = figures(trial.last_result)["return"]  # none where no episode of RLlib's ended
        self._tell(trial, "done" if found is None else f"done, return {found:.2f}")

    def on_experiment_end(self, trials: list[Any], **info: Any) -> None:
        if self.bar is not None:
            self.bar.close()

    def _tell(self, trial: Any, what: str) -> None:
        tqdm.write(f"trial {trial.trial_id.rpartition('_')[2]}: {what}")


def last_failure(trial: Any) -> str:
    """Why a trial failed the last time, from the file where Tune tells it."""
    path = Path(trial.error_file or "")
    return reason(path.read_text() if path.is_file() else "")


def reason(error: str) -> str:
    """The last failure in one line: Ray puts the news first, but behind a traceback that of Python last."""
    error = re.sub(r"\x1b\[[\d;]*m", "", error)
    lines = [line.strip() for line in error.rpartition("Failure #")[2].strip().splitlines()]
    lines = [line for line in lines if "(occurred at" not in line] or ["unknown."]
    return lines[-1 if any(line.startswith(("Traceback", "ray::")) for line in lines) else 0]


def is_done(trial: Any) -> bool:
    """Whether a trial ended by itself or by its scheduler, in this run or an earlier one."""
    return trial.status == "TERMINATED" and trial.trial_id not in Progress.going


def write_table(results: Any, folder: str, varied: list[str]) -> int:
    """Write `folder`/trials.csv where that is a path, print what came of the trials.

    Returns:
        The exit code: 0, 1 where a trial failed for good, 130 where one has not ended.
    """
    rows, reasons = [], []
    # Whether a trial is done stands in its status alone; but after Ctrl-C all look as if they were
    pairs = zip(results, results._experiment_analysis.trials, strict=True)
    for result, trial in sorted(pairs, key=lambda pair: Path(pair[0].path).name):
        found, config = result.metrics or {}, result.config or {}
        kept = result.checkpoint.path if result.checkpoint else ""
        why = reason(str(result.error)) if result.error else found.get("failed")
        state = "failed" if why else "done" if is_done(trial) else "unfinished"
        reasons += [f"  {kept or 'a trial'}: {why}"] if why else []
        rows.append(
            {key: config.get(key) for key in varied}
            | figures(found)
            | {"state": state, "run": str(kept).removeprefix(f"{folder}/")}
        )
    if "://" not in folder and rows:
        text = io.StringIO()
        writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        runs.write_text(Path(folder, "trials.csv"), text.getvalue())
    counts = {state: sum(row["state"] == state for row in rows) for state in ("done", "failed", "unfinished")}
    print(", ".join(f"{count} {state}" for state, count in counts.items() if count) + f": {folder}")
    print("\n".join(reasons), end="\n" if reasons else "")
    if counts["unfinished"]:
        print("interrupted; the same command goes on")
        return 130
    return 1 if counts["failed"] else 0
