"""Disturbances of an episode: checks of their settings, and when the trunk is pushed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hoof_env.dynamics.parts import MOST_IMPULSE
from hoof_env.errors import ParameterError, brief, check_number

MOST_NOISE = 10.0
"""Largest error of a number that is observed, of which the scale has mapped the usual range to [-1, 1]."""

MOST_STRENGTH = 10.0
"""Largest factor of all disturbances."""

MOST_PUSH = MOST_IMPULSE / MOST_STRENGTH
"""Largest impulse of a planned push [N s], so that it is possible at any strength."""

Push = tuple[int, float, float]
"""Control step after which the trunk is pushed, impulse forward and upward [N s]."""


def check_noise(name: str, given: Any, groups: Sequence[str]) -> dict[str, float]:
    """Return the largest errors of groups of the observation, by group.

    Args:
        name: name of the setting, for messages.
        given: the setting; None for no errors.
        groups: groups that are observed.

    Raises:
        ParameterError: not a mapping, a group that is not observed, or an error out of range.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not set(given) <= set(groups):
        raise ParameterError(
            f"{name}: expected a mapping with some of the groups that are observed, {', '.join(groups)}; got"
            f" {brief(given)}"
        )
    return {
        group: check_number(f"{name}[{group!r}]", value, low=0, high=MOST_NOISE)
        for group, value in given.items()
    }


def _listed(value: Any) -> Any:
    """Return an array as a list; other values as they are."""
    return value.tolist() if isinstance(value, np.ndarray) else value


def check_pushes(name: str, given: Any, dt: float, steps: int) -> tuple[Push, ...]:
    """Return given pushes in the order of their times.

    Args:
        name: name of the setting or option, for messages.
        given: rows of time [s], impulse forward and impulse upward [N s]; None for none.
        dt: control step [s], to which times are rounded.
        steps: number of control steps of an episode.

    Raises:
        ParameterError: not such rows, or a time that is not within the episode.
    """
    if given is None:
        return ()
    given = _listed(given)
    rows = list(given) if isinstance(given, Iterable) and not isinstance(given, (str, Mapping)) else [given]
    impulses: dict[int, tuple[float, float]] = {}
    for k, row in enumerate(map(_listed, rows)):
        if not isinstance(row, (list, tuple)) or len(row) != 3:
            raise ParameterError(f"{name}[{k}]: expected [s, N s forward, N s upward], got {brief(row)}")
        last = (steps - 1) * dt
        seconds = check_number(f"{name}[{k}], time", row[0], low=0.0, high=last)
        forward, upward = (
            check_number(f"{name}[{k}], impulse", value, low=-MOST_PUSH, high=MOST_PUSH) for value in row[1:]
        )
        # A push at the very start comes after the first step: the start has a speed of its own.
        step = max(round(seconds / dt), 1)
        before = impulses.get(step, (0.0, 0.0))
        # The sum of all pushes of a step is one push, which is limited, too.
        impulses[step] = (
            check_number(f"{name}[{k}], impulse", before[0] + forward, low=-MOST_PUSH, high=MOST_PUSH),
            check_number(f"{name}[{k}], impulse", before[1] + upward, low=-MOST_PUSH, high=MOST_PUSH),
        )
    return tuple((step, *impulses[step]) for step in sorted(impulses))


ROUGH_PUSH = 1.5
ROUGH_SLOPE = 0.1
ROUGHNESS = 0.05
"""Strengths of a horse's rough ground: largest push over the mass [m/s], steepest slope [-], largest bumps
[m]. legged_gym pushes robots with hips at 0.55 m by 1 m/s (`max_push_vel_xy`), which is this push at the same
Froude number, and its rough slopes have these bumps (`random_uniform_terrain`). The slope is that of a steep
road. Chosen before anything was trained on them."""


def rough_ground(strength: float, mass: float) -> dict[str, Any]:
    """Return the settings of a horse's rough ground.

    Args:
        strength: factor of all disturbances.
        mass: mass of the horse [kg].
    """
    return {
        "terrain": {
            "kind": "hills",
            "length": 2000.0,
            "rise": 10 * ROUGH_SLOPE * strength,
            # Hills take no slope of 0; those of no height have none.
            "slope": max(ROUGH_SLOPE * strength, 1e-3),
            "roughness": ROUGHNESS * strength,
            "stiffness": [1.0, 1.0],
            "friction": [1.0, 1.0],
        },
        "push_impulse": [-ROUGH_PUSH * mass, ROUGH_PUSH * mass],
        "push_seconds": [2.0, 4.0],
        "strength": strength,
    }
