"""Model cards of the policies that ship, from data of the package.

    python -m agents.cards      after a change of agents/templates/model_card.md.j2

`agents.ship` writes the card of a policy that it ships in the same way. Nothing is played or trained.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.command import parse, run
from agents.pages import render_template
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.errors import parse_json
from hoof_env.evaluation.scores import METRICS, cell
from hoof_env.evaluation.statistics import Interval
from hoof_env.policies.catalogue import SHIPPED
from hoof_env.policies.saved import WEIGHTS
from hoof_env.records import surroundings
from hoof_env.tasks.registry import TASKS

POLICIES = Path(__file__).with_name("policies")

CARD = "card.md"
FILM = "film.gif"
SCORE = "score.json"

SHOWN = ("return", "cost", "distance_m", "stance_peak_n", "weight_share", "cost_of_transport", "failed")
"""Columns of the card's table, keys of `METRICS`."""

TITLES = {
    "policy": "**this policy**",
    "zero": "zero action",
    "constant": "best constant gait",
    "open-loop": "best gait locked to the crank",
    "blind": "**best without feedback**",
    "stock": "stock PPO, all its runs",
}
"""Names of policies in the card's table."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    out: Path = POLICIES
    """folder of the policies' folders"""


def estimates_of(policy: Mapping[str, Any]) -> dict[str, Interval]:
    """Return means and intervals of a policy in score.json, which has null for what is infinite, and for the
    bounds of an unknown interval."""
    found = {}
    for name, mean in policy["mean"].items():
        low, high = (math.nan if bound is None else bound for bound in policy["interval95"][name])
        found[name] = Interval(math.inf if mean is None else mean, low, high)
    return found


def card(
    env_id: str,
    record: Mapping[str, Any],
    score: Mapping[str, Any],
    config: str,
    film: str,
    has_weights: bool = True,
) -> str:
    """Return the model card of a policy, Markdown.

    Args:
        env_id: id of its environment.
        record: content of its run.json.
        score: content of its score.json.
        config: its hyperparameters, YAML.
        film: its film, a link from the card.
        has_weights: True if the package has its weights as plain data.
    """
    estimates = {name: estimates_of(policy) for name, policy in score["policies"].items()}
    keys = [key for key in SHOWN if key in estimates["policy"]]
    with runs.make_env(env_id) as env:
        is_suspended = surroundings(env).trunk == "suspended"
        summaries = {task.id: task.summary for task in TASKS.values()}
        summary = summaries.get(env_id) or (type(env.unwrapped).__doc__ or "").partition("\n")[0]
    of_runs = f"the best of {score['runs']} runs by mean return in 100 other episodes" * (score["runs"] > 1)
    chosen = "; ".join(filter(None, (of_runs, score.get("chosen"))))
    return render_template(
        "model_card.md.j2",
        env_id=env_id,
        name=env_id.rpartition("/")[2],
        summary=summary,
        trained_on=record.get("trained_on", env_id),
        record=record,
        settings=config.strip(),
        score=score,
        spread=float(np.std(score["returns"])),
        chosen=chosen or "the only run",
        is_chosen=bool(chosen),
        is_one_episode=len(score["returns"]) > 1 and np.ptp(score["returns"]) == 0.0,
        titles=[METRICS[key].title.replace("\n", " ") for key in keys],
        rows=[
            # A score from elsewhere may lack figures
            (
                TITLES.get(name, name),
                [" ".join(cell(key, of_policy.get(key, Interval(math.nan)))).strip() for key in keys],
            )
            for name, of_policy in estimates.items()
            # The gait is often the best without feedback, and would stand twice
            if not (
                name == "open-loop" and of_policy.get("return") == estimates.get("blind", {}).get("return")
            )
        ],
        estimates=estimates,
        film=film,
        has_weights=has_weights,
        suspended=is_suspended,
    )


def main(argv: list[str] | None = None) -> None:
    """Write the cards."""
    args = parse(Args, argv, "python -m agents.cards", __doc__)
    for folder in sorted(path.parent for path in SHIPPED.glob(f"*/{SCORE}")):
        score, record = (
            parse_json((folder / name).read_text(encoding="utf-8")) for name in (SCORE, runs.RECORD)
        )
        env_id = score["env_id"]
        beside = POLICIES / folder.name
        film = FILM if (beside / FILM).is_file() else f"../{STANDS_FOR[env_id].rpartition('/')[2]}/{FILM}"
        config = (beside / runs.CONFIG).read_text(encoding="utf-8")
        runs.write_text(
            args.out / folder.name / CARD,
            card(env_id, record, score, config, film, (folder / WEIGHTS).is_file()),
        )
        print(args.out / folder.name / CARD)


if __name__ == "__main__":
    run(main)
