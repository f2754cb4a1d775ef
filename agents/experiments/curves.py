"""Published learning curves of stock learners, docs/evidence/stock/curves.csv."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from agents import runs
from agents.experiments.outcomes import Outcome, is_done, read_outcome
from agents.experiments.plans import Entry, Run
from hoof_env.errors import DataFileError

PUBLISHED = Path(__file__).parents[2] / "docs" / "evidence" / "stock"
"""Folder of the published curves and their page."""

CURVES = "curves.csv"

COLUMNS = ("env_id", "algo", "seed", "steps", "return", "train_seconds", "commit", "processor")
"""Columns of curves.csv: a line for each score. The seconds are the processor's for learning alone so
far; the commit has the code that trained, empty if there is no git. The processor is empty in rows
from before it was noted."""

TUNED: Final = "ppo_flat"
"""Name of the one learner that is not stock, for comparison: its settings are in agents/hyperparams."""


def read_curves(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of curves.csv; an empty list if there is no such file.

    Raises:
        DataFileError: it cannot be read.
    """
    path = folder / CURVES
    if not path.is_file():
        return []
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [
                {
                    "env_id": row["env_id"],
                    "algo": row["algo"],
                    "seed": int(row["seed"]),
                    "steps": int(row["steps"]),
                    "return": float(row["return"]),
                    "train_seconds": float(row["train_seconds"]),
                    "commit": row["commit"] or "",
                    "processor": row.get("processor") or "",
                }
                for row in csv.DictReader(file)
            ]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise DataFileError(f"{path}: expected columns {', '.join(COLUMNS)}: {error!r}") from None


def has_run(rows: Sequence[dict[str, Any]], one: Run) -> bool:
    """True if the rows of a training are there, up to its last step."""
    steps = [row["steps"] for row in rows if key_of(row) == (one.entry.env_id, one.entry.algo, one.seed)]
    return max(steps, default=-1) >= one.entry.settings["n_timesteps"]


def key_of(row: dict[str, Any]) -> tuple[str, str, int]:
    """Return the training of a row: id, algorithm and seed."""
    return row["env_id"], row["algo"], row["seed"]


def rows_of(outcome: Outcome) -> list[dict[str, Any]]:
    """Return the rows of a training that is done."""
    final = outcome.final
    commit = runs.read_record(outcome.folder)["versions"].get("commit", "")
    training = {key: final[key] for key in ("env_id", "algo", "seed")}
    made_by = {"commit": commit, "processor": final["processor"]}
    return [
        training
        | {
            "steps": int(score["steps"]),
            "return": round(score["return"], 2),
            "train_seconds": round(score["cpu_s"], 1),
        }
        | made_by
        for score in outcome.curve
    ]


def publish(plan: Sequence[Entry], folder: Path, out: Path) -> list[dict[str, Any]]:
    """Add trainings of `folder` that are done to curves.csv of `out`, and return all of its rows. A training
    replaces rows of the same id, algorithm and seed that end before it."""
    rows = old = read_curves(out)
    for one in (Run(entry, seed) for entry in plan for seed in range(entry.seeds)):
        if not has_run(rows, one) and is_done(one, folder):
            key = (one.entry.env_id, one.entry.algo, one.seed)
            rows = [row for row in rows if key_of(row) != key] + rows_of(read_outcome(one, folder))
    if rows is not old:
        rows.sort(key=lambda row: (*key_of(row), row["steps"]))
        out.mkdir(parents=True, exist_ok=True)
        runs.write_csv(out / CURVES, COLUMNS, rows)
    return rows
