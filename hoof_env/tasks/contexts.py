"""Contexts: fixed sets of physical parameters for training and testing, as in contextual learning.

A split varies some parameters. Its three sets have `COUNT` contexts each: "train"; "interpolation", further
contexts in the same ranges; and "extrapolation", with every parameter outside these ranges, above or below. A
parameter is the environment's own value times a factor. The logarithms of the factors are spread evenly by
Roberts' sequence, without random numbers: the sets are the same on any machine.

Terms follow Kirk et al. (2023), "A survey of zero-shot generalisation in deep reinforcement learning", and
numbered contexts follow CARL (Benjamins et al. 2023).
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError, brief
from hoof_env.tasks.settings import ResolvedSettings, check_effect

FACTORS = MappingProxyType(
    {
        "stiffness": (2.0, 4.0),
        "friction": (1.4, 2.0),
        "trunk_mass": (1.25, 1.6),
        "trunk_share": (1.1, 1.2),
    }
)
"""Largest factor of a parameter in training and in extrapolation; the smallest are their reciprocals."""

SPLITS = MappingProxyType(
    {
        "ground": ("stiffness", "friction"),
        "body": ("trunk_mass", "trunk_share"),
        "all": tuple(FACTORS),
    }
)
"""Parameters of each split; only a suspended trunk has `trunk_share`."""

SETS = ("train", "interpolation", "extrapolation")

COUNT = 32
"""Contexts of a set."""

ROOT = 1.1673039782614187
"""Root of x^5 = x + 1 above 1; its inverse powers are the steps of Roberts' sequence in four dimensions."""


def check_context_set(s: ResolvedSettings) -> tuple[str, str] | None:
    """Return split and set of the setting `context_set`; None without one.

    Raises:
        ParameterError: not a string of the form SPLIT/SET, an unknown split or set, the paper's solver, or
            `context_visible` without a set.
    """
    given = s.context_set
    if given is None:
        if s.context_visible:
            raise ParameterError("context_visible: expected a context_set with it, got context_set=None")
        return None
    split, _, name = given.partition("/") if isinstance(given, str) else ("", "", "")
    if split not in SPLITS or name not in SETS:
        raise ParameterError(
            f"context_set: expected SPLIT/SET of the splits {', '.join(SPLITS)} and the sets"
            f" {', '.join(SETS)}, such as 'ground/train', got {brief(given)}"
        )
    if s.solver == "paper":
        raise ParameterError(f'context_set: expected None with solver="paper", got {given!r}')
    return split, name


def parameters_of(split: str, s: ResolvedSettings) -> tuple[str, ...]:
    """Return the parameters of a split that have an effect with settings."""
    found = []
    for name in SPLITS[split]:
        try:
            check_effect(name, s)
        except ParameterError:
            continue
        found.append(name)
    return tuple(found)


def contexts_of(split: str, name: str, s: ResolvedSettings) -> tuple[dict[str, float], ...]:
    """Return the contexts of a set: parameters by name, as for `reset(options={"parameters": ...})`.

    Args:
        split, name: name in `SPLITS` and in `SETS`.
        s: settings, whose values are multiplied.
    """
    taken = parameters_of(split, s)
    # Every set has places of its own in one sequence: interpolation never meets a context of training.
    first = SETS.index(name) * COUNT
    places = np.arange(first, first + COUNT)[:, np.newaxis]
    # All parameters have their own dimension, so that a split has the factors that "all" has.
    spread = (0.5 + (places + 1.0) * ROOT ** -np.arange(1.0, len(FACTORS) + 1)) % 1.0
    contexts = []
    for row in spread:
        context: dict[str, float] = {}
        for part, (key, (inner, outer)) in zip(row.tolist(), FACTORS.items(), strict=True):
            if key in taken:
                power = _power(part, name == "extrapolation", np.log(inner), np.log(outer))
                context[key] = float(getattr(s, key) * np.exp(power))
        contexts.append(context)
    return tuple(contexts)


def _power(part: float, is_outside: bool, inner: float, outer: float) -> float:
    """Return the logarithm of a factor: `part` of the way, from 0 to 1, through the range between -inner and
    inner; or, outside, through the range from -outer to -inner and then from inner to outer."""
    if not is_outside:
        return (2.0 * part - 1.0) * inner
    side = 1.0 if part >= 0.5 else -1.0
    return side * (inner + abs(2.0 * part - 1.0) * (outer - inner))


def bounds_of(split: str, s: ResolvedSettings) -> dict[str, Any]:
    """Return the lowest and highest value of each parameter in all sets of a split: with one time step for
    all, returns of its sets can be compared."""
    found = {}
    for name in parameters_of(split, s):
        usual, outer = getattr(s, name), FACTORS[name][1]
        found[name] = (usual / outer, usual * outer)
    return found
