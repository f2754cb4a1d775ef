"""The environments of the package, in a line each, and the returns of the policies that ship for them."""

from __future__ import annotations

from pathlib import Path

from hoof_env.errors import DataFileError, parse_json
from hoof_env.tasks.registry import TASKS

SHIPPED = Path(__file__).parents[1] / "data" / "policies"
"""Folder with a folder of each id's trained policy, as `agents.ship` writes it: weights, how they were
trained, and returns of the policy and of gaits in the same episodes."""

SHOWN = {
    "policy": "shipped",
    "blind": "best without feedback",
    "constant": "constant",
    "run": "run",
    "zero": "zero",
    "reference": "reference",
}
"""Policies whose returns are shown, with the names by which commands take them. "blind" is the best policy
that sees nothing, a gait ("open-loop") or an agent."""


def summaries() -> dict[str, str]:
    """Return one line about each id of the package, by id."""
    from hoof_env.envs.horse_leg import HorseLegMOEnv

    found = {task.id: task.summary for task in TASKS.values()}
    return found | {"hoof_env/HorseLegMO-v0": (HorseLegMOEnv.__doc__ or "").partition("\n")[0]}


def shipped_returns(name: str) -> dict[str, float]:
    """Return the mean returns of the policies of an id in the published episodes, by the names of score.json:
    "policy" is the one that ships.

    Args:
        name: name of the id, without its namespace.

    Raises:
        DataFileError: there are none.
    """
    path = SHIPPED / name / "score.json"
    try:
        policies = parse_json(path.read_text(encoding="utf-8"))["policies"]
        return {policy: scores["mean"]["return"] for policy, scores in policies.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataFileError(
            f"scores {path}: expected the scores that agents.ship writes: {error!r}"
        ) from None


def is_one_episode(name: str) -> bool:
    """True if all published episodes of an id are the same, so that a return is not a mean."""
    path = SHIPPED / name / "score.json"
    try:
        return len(set(parse_json(path.read_text(encoding="utf-8"))["returns"])) == 1
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def good_returns(name: str) -> str:
    """Return the mean returns of the policies of an id as text; see `shipped_returns`."""
    returns = shipped_returns(name)
    return ", ".join(f"{SHOWN[policy]} {returns[policy]:.3g}" for policy in SHOWN if policy in returns)
