"""What a policy sees: numbers in [-1, 1], in groups that can be chosen. `episode.look` computes them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.episode import AHEAD
from hoof_env.errors import ParameterError
from hoof_env.gait.parameters import LIMITS

LOW, HIGH = (np.array([limit[i] for limit in LIMITS.values()]) for i in (0, 1))
MIDDLE, HALF_RANGE = (LOW + HIGH) / 2, (HIGH - LOW) / 2
"""Limits, middle and half range of the gait parameters, shape (4,)."""

GROUPS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "crank": (("sin(crank angle)", "none", "-"), ("cos(crank angle)", "none", "-")),
    "gait": (
        ("crank speed", "as action 0", "rad/s"),
        ("swing offset", "as action 1", "rad"),
        ("swing sine coefficient", "as action 2", "rad"),
        ("swing cosine coefficient", "as action 3", "rad"),
        ("rate of crank speed", "/ 20", "rad/s^2"),
        ("rate of swing offset", "/ 6", "rad/s"),
        ("rate of swing sine coefficient", "/ 6", "rad/s"),
        ("rate of swing cosine coefficient", "/ 6", "rad/s"),
    ),
    "trunk": (
        ("forward speed", "tanh(x / 5)", "m/s"),
        ("vertical speed", "tanh(x / 2)", "m/s"),
        ("height", "tanh((x - hip height) / 0.3)", "m"),
    ),
    "hoof": (
        ("toe contact", "0 or 1", "-"),
        ("heel contact", "0 or 1", "-"),
        ("toe load", "tanh(x / 3 weights)", "N"),
        ("heel load", "tanh(x / 3 weights)", "N"),
        ("toe approach speed", "tanh(x / 2)", "m/s"),
        ("heel approach speed", "tanh(x / 2)", "m/s"),
        ("running peak force", "tanh(x / 3 weights)", "N"),
    ),
    "action": tuple(
        (f"previous action: {name}", "none", "-")
        for name in ("crank speed", "swing offset", "swing sine coefficient", "swing cosine coefficient")
    ),
    "target": (("commanded speed", "tanh(x / 5)", "m/s"),),
    "ground": tuple((f"height of the ground {x:g} m ahead", "tanh(x / 0.5)", "m") for x in AHEAD),
}
"""Names, scaling and unit before scaling of all entries, by group, in the order in which kernels know them;
the height of the ground is that above the ground under O."""

_KNOWN = [entry[0] for group in GROUPS.values() for entry in group]
_NUMBERS = {name: k for k, name in enumerate(_KNOWN)}


def entries(groups: Iterable[str], trunk: str) -> list[tuple[str, str, str]]:
    """The entries of some groups on a kind of trunk: what cannot move is not observed."""
    absent = {"fixed": ("forward speed", "vertical speed", "height"), "rail": ("vertical speed", "height")}
    return [entry for group in groups for entry in GROUPS[group] if entry[0] not in absent.get(trunk, ())]


def check_groups(groups: Any, known: Iterable[str]) -> tuple[str, ...]:
    """The groups to observe, each once.

    Raises:
        ParameterError: not a row of known names, or none, or one twice.
    """
    names = tuple(known)
    given = tuple(groups) if isinstance(groups, (list, tuple)) else ()
    if not given or not all(group in names and given.count(group) == 1 for group in given):
        raise ParameterError(f"observation: expected a list of some of {', '.join(names)}, got {groups!r}")
    return given


def places(names: Iterable[str], count: int) -> NDArray[np.int64]:
    """Where each entry that the kernels know goes in the observation, -1 for those not asked for."""
    found = np.full(count, -1, np.int64)
    for place, name in enumerate(names):
        found[_NUMBERS[name]] = place
    return found
