"""Returns of policies on the pages of docs/environments, and the overview of all ids."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from docs._manual.tables import WORDS, body_of, task
from hoof_env.envs.horse_leg import HorseLegMOEnv
from hoof_env.envs.manual import MULTI_OBJECTIVE, Table, observed
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.errors import DataFileError
from hoof_env.policies.catalogue import shipped_returns
from hoof_env.tasks.registry import TASKS

POLICIES = Path(__file__).parents[2] / "agents" / "policies"
RETURNS = "returns.json"
"""File of returns in the folder of policies, as agents.gallery writes it."""

STILL = "still.webp"
"""File of a policy's picture, as agents.gallery writes it."""

SCORED = {
    "random": "random actions",
    "zero": "zero action",
    "run": "scripted run",
    "reference": "reference gait (zero action)",
    "constant": "best constant gait",
    "blind": "best policy without feedback",
    "stock": "stock PPO",
    "policy": "shipped agent",
}
"""Policies whose returns a page shows, from what is bad to what is good."""


def policy_of(name: str) -> str:
    """Return the folder of the policy of a page's id, or of the id with the same policy."""
    id = f"hoof_env/{name}-v0"
    return STANDS_FOR.get(id, id).rpartition("/")[2]


@cache
def returns_of(name: str) -> dict[str, Any]:
    """Read mean returns of policies in the published episodes, and how fast a stock learner learns.

    Raises:
        DataFileError: the shipped policy has no scores, or the file of agents.gallery cannot be read.
    """
    scored = shipped_returns(policy_of(name))
    path = POLICIES / RETURNS
    try:
        others = json.loads(path.read_text(encoding="utf-8"))[f"hoof_env/{name}-v0"]
        return {key: scored[key] for key in SCORED if key in scored} | others
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataFileError(f"returns {path}: expected a file of agents.gallery: {error!r}") from None


def returns(name: str) -> Table:
    """Return the table that says which returns are good."""
    found = returns_of(name)
    titles = dict(SCORED)
    if "stock_steps" in found:
        titles["stock"] = f"[stock PPO](../evidence/stock/README.md), {found['stock_steps']:,.0f} steps"
    shown = [key for key in SCORED if key in found]
    return Table(tuple(titles[key] for key in shown), [tuple(f"{found[key]:.3g}" for key in shown)])


def learning(learnt: Mapping[str, Any]) -> str:
    """Write how long the best stock learner of an id takes; "" without one."""
    if not learnt:
        return ""
    seeds = f"{learnt['seeds']} seeds" if learnt["seeds"] > 1 else "1 seed"
    reached = f"reaches {learnt['return']:.3g} in " if "return" in learnt else ""
    spent = f"{learnt['steps']:,} steps, {learnt['seconds']:.0f} s"
    return f"{reached}{spent}<br>({learnt['algo'].upper()}, {seeds})"


def ids(_: str = "") -> Table:
    """Return the table of all ids: use, sizes, returns and the time to learn."""
    names = [found.name for found in TASKS.values()] + [
        MULTI_OBJECTIVE.rpartition("/")[2].removesuffix("-v0")
    ]
    rows: list[tuple[str, ...]] = []
    for name in names:
        is_task = name in (found.name for found in TASKS.values())
        summary = task(name).summary if is_task else str(HorseLegMOEnv.__doc__).splitlines()[0]
        still = f"../../agents/policies/{policy_of(name)}/{STILL}"
        link = f"[![{name} at work]({still})]({name}.md)<br>[`{name}-v0`]({name}.md)"
        found = returns_of(name)
        gaits = "<br>".join(f"{SCORED[key]} {found[key]:.3g}" for key in SCORED if key in found)
        sizes = f"{len(body_of(name).action_names)}, {len(observed(task(name)))}"
        use = f"{summary} For {WORDS['uses'][name]}."
        rows.append((link, use, sizes, gaits, learning(found.get("learnt", {}))))
    head = ("id", "what it asks, and what it is for", "actions, observations", "returns", "to learn it")
    return Table(head, rows)
