"""Stills and returns that the manual's pages show of each id, besides the scores of its policy.

    python -m agents.gallery        what is missing in agents/policies
    python -m agents.gallery --again    everything anew, as after new policies

Stills are cut out of the films of the policies. Returns are those of random actions, and of stock PPO where
docs/evidence/stock has its curves, in the episodes of the published scores.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.command import run
from agents.ship import FILM, POLICIES
from agents.stock import OUT as CURVES
from agents.stock_page import at
from agents.stock_plan import read_curves
from hoof_env.envs.manual import RETURNS, STILL
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.evaluation.episodes import FINAL_SEEDS, score_vector
from hoof_env.evaluation.statistics import iqm

CUT = (20, 60, 310, 270)
"""Part of a film's frame that shows the animal: left, top, right, bottom [pixels]."""

PLACE = 2 / 3
"""Place of the frame in the film, over its length: agents have found their gait there."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    again: bool = False
    """replace what is there, too"""
    out: Path = POLICIES
    """folder of the policies"""


def write_still(folder: Path) -> None:
    """Write the still of the film in a policy's folder."""
    from PIL import Image

    with Image.open(folder / FILM) as film:
        film.seek(int(PLACE * getattr(film, "n_frames", 1)))
        still = film.convert("RGB").crop(CUT)
    still.save(folder / STILL, "WEBP", quality=80, method=6)


def stock_return(env_id: str) -> dict[str, float]:
    """Return the interquartile mean over seeds of the last return of stock PPO, and its steps; {} for no
    curve."""
    rows = [row for row in read_curves(CURVES) if (row["env_id"], row["algo"]) == (env_id, "ppo")]
    if not rows:
        return {}
    steps = max(row["steps"] for row in rows)
    return {"stock": float(iqm(at(rows, steps))[0]), "stock_steps": steps}


def returns_of(env_id: str, known: dict[str, Any]) -> dict[str, float]:
    """Return the returns that the page of an id compares with; `known` are those of before."""
    played = STANDS_FOR.get(env_id, env_id)
    random = known.get("random")
    if random is None:
        random = float(np.mean([one["return"] for one in score_vector("random", played, FINAL_SEEDS)]))
    return {"random": round(random, 4), **{k: round(v, 4) for k, v in stock_return(played).items()}}


def main(argv: list[str] | None = None) -> None:
    """Write stills and returns."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.gallery", description=__doc__)
    path = args.out / RETURNS
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() and not args.again else {}
    returns = {}
    for folder in sorted(card.parent for card in args.out.glob("*/card.md")):
        if (folder / FILM).is_file() and (args.again or not (folder / STILL).is_file()):
            write_still(folder)
        env_id = f"hoof_env/{folder.name}"
        returns[env_id] = returns_of(env_id, known.get(env_id, {}))
        print(env_id, returns[env_id], flush=True)
    runs.write_text(path, json.dumps(returns, indent=1) + "\n")


if __name__ == "__main__":
    run(main)
