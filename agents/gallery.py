"""Stills and returns that the pages of docs/environments show of each id, besides the scores of its policy.

    python -m agents.gallery

Stills are cut out of the films of the policies. Returns are of random actions, and of stock PPO where
docs/evidence/stock has its curves, in the episodes of the published scores. Ids with curves also have
the steps and seconds that the best stock learner takes to pass the best policy without feedback.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.cards import FILM, POLICIES
from agents.command import parse, run
from agents.experiments.curves import PUBLISHED as CURVES
from agents.experiments.curves import TUNED, read_curves
from agents.experiments.stock_page import at
from docs._manual.results import RETURNS, STILL
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.evaluation.episodes import FINAL_SEEDS, score_vector
from hoof_env.evaluation.statistics import iqm
from hoof_env.policies.catalogue import shipped_returns

CUT = (27, 80, 413, 360)
"""Part of a film's frame that shows the animal: left, top, right, bottom [pixels]."""

SMALL = (290, 210)
"""Size of a still [pixels]."""

PLACE = 2 / 3
"""Place of the frame in the film, over its length: agents have found their gait there."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    out: Path = POLICIES
    """folder of the policies"""


def write_still(folder: Path) -> None:
    """Write the still of the film in a policy's folder."""
    from PIL import Image

    with Image.open(folder / FILM) as film:
        film.seek(int(PLACE * getattr(film, "n_frames", 1)))
        still = film.convert("RGB").crop(CUT).resize(SMALL, Image.Resampling.LANCZOS)
    still.save(folder / STILL, "WEBP", quality=80, method=6)


def stock_return(env_id: str) -> dict[str, float]:
    """Return the interquartile mean over seeds of the last return of stock PPO, and its steps; {} for no
    curve."""
    rows = [row for row in read_curves(CURVES) if (row["env_id"], row["algo"]) == (env_id, "ppo")]
    if not rows:
        return {}
    steps = max(row["steps"] for row in rows)
    return {"stock": float(iqm(at(rows, steps))[0]), "stock_steps": steps}


def passed(curve: Sequence[dict[str, Any]], bar: float) -> tuple[float, float]:
    """Return the steps and the seconds after which all scores of one training are above a bar; infinite if
    the last one is not."""
    first = (math.inf, math.inf)
    for row in sorted(curve, key=lambda row: -row["steps"]):
        if row["return"] <= bar:
            break
        first = (row["steps"], row["train_seconds"])
    return first


def learning_of(rows: Sequence[dict[str, Any]], bar: float) -> dict[str, Any]:
    """Return how fast the best stock learner of an id learns, with medians over its seeds.

    Args:
        rows: rows of curves.csv of one id.
        bar: return of the best policy without feedback.

    Returns:
        "algo", "seeds", and the "steps" and "seconds" after which it stays above the bar, for the algorithm
        that takes the fewest seconds. If none stays above it, the algorithm with the highest return at the
        end: its steps and seconds in all, and "return", an interquartile mean. {} without rows of a stock
        learner.
    """
    found = []
    for algo in sorted({row["algo"] for row in rows} - {TUNED}):
        own = [row for row in rows if row["algo"] == algo]
        curves = [[row for row in own if row["seed"] == seed] for seed in sorted({r["seed"] for r in own})]
        steps, seconds = np.median([passed(curve, bar) for curve in curves], axis=0)
        one = {"algo": algo, "seeds": len(curves)}
        last = max(row["steps"] for row in own)
        reached = float(iqm(at(own, last))[0])
        if math.isinf(seconds):
            one |= {"return": round(reached, 4)}
            steps = last
            seconds = np.median([max(row["train_seconds"] for row in curve) for curve in curves])
        rank = (seconds if "return" not in one else math.inf, -reached)
        found.append((rank, one | {"steps": round(float(steps)), "seconds": round(float(seconds), 1)}))
    return min(found, key=lambda pair: pair[0])[1] if found else {}


def random_return(env_id: str) -> float:
    """Return the mean return of random actions in the episodes of all scores."""
    played = STANDS_FOR.get(env_id, env_id)
    return float(np.mean([one["return"] for one in score_vector("random", played, FINAL_SEEDS)]))


def returns_of(env_id: str, random: float) -> dict[str, Any]:
    """Return the returns that the page of an id compares with, and how fast it is learnt; `random` is the
    return of random actions."""
    played = STANDS_FOR.get(env_id, env_id)
    found = {"random": round(random, 4), **{k: round(v, 4) for k, v in stock_return(played).items()}}
    scored = shipped_returns(env_id.rpartition("/")[2])
    rows = [row for row in read_curves(CURVES) if row["env_id"] == env_id]
    learnt = learning_of(rows, scored["blind"]) if rows else {}
    return found | ({"learnt": learnt} if learnt else {})


def main(argv: list[str] | None = None) -> None:
    """Write stills and returns."""
    args = parse(Args, argv, "python -m agents.gallery", __doc__)
    path = args.out / RETURNS
    returns = {}
    for folder in sorted(card.parent for card in args.out.glob("*/card.md")):
        if (folder / FILM).is_file():
            write_still(folder)
        env_id = f"hoof_env/{folder.name}"
        returns[env_id] = returns_of(env_id, random_return(env_id))
        print(env_id, returns[env_id], flush=True)
    runs.write_text(path, json.dumps(returns, indent=1) + "\n")
    print("next: python -m docs._manual")


if __name__ == "__main__":
    run(main)
