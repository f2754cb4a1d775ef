"""Delays of observations and actions: checks of their settings, and the parts into which they divide a
control step."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hoof_env.errors import ParameterError, brief, check_number, count
from hoof_env.tasks.parameters import check_range

MOST_KEPT = 1000
"""Largest number of control steps that a delay lasts, and of observations and actions that are observed."""


class Delay(NamedTuple):
    """Delay in control steps: whole steps, between which each episode draws, and substeps.

    Attributes:
        least, most: whole control steps.
        substeps: further substeps of `sim_dt`.
    """

    least: int
    most: int
    substeps: int


def check_delay(name: str, given: Any, substeps: int, steps: int) -> Delay:
    """Return a delay from a setting.

    Args:
        name: name of the setting.
        given: the setting, one number or two whole ones [control steps].
        substeps: substeps of `sim_dt` in a control step.
        steps: control steps of an episode.

    Raises:
        ParameterError: a delay is negative, no whole number of substeps, or lasts a whole episode; or a range
            has ends that are not whole.
    """
    most = min(steps - 1, MOST_KEPT)
    if isinstance(given, (list, tuple)):
        low, high = check_range(name, given, 0.0, most)
        if low != round(low) or high != round(high):
            raise ParameterError(f"{name}: expected whole numbers of a range, got {brief(given)}")
        return Delay(round(low), round(high), 0)
    delay = check_number(name, given, low=0.0, high=most)
    whole = math.floor(delay + 1e-9)
    rest = (delay - whole) * substeps
    if abs(rest - round(rest)) > 1e-6:
        raise ParameterError(
            f"{name}: expected whole substeps, of which a control step has {substeps}, got {brief(given)}"
        )
    return Delay(whole, whole, round(rest))


def check_kept(name: str, given: Any, low: int) -> int:
    """Return a number of observations or actions that are observed.

    Raises:
        ParameterError: it is not a whole number from `low` to `MOST_KEPT`.
    """
    return count(name, given, low=low, most=MOST_KEPT)


class Parts(NamedTuple):
    """Parts of a control step between which an action begins to act, or an observation is made.

    Attributes:
        substeps: substeps of `sim_dt` of each part.
        acting: number of the part at whose begin an action acts.
        seeing: number of the part after which an observation is made, -1 if it is made at the step's end.
    """

    substeps: tuple[int, ...]
    acting: int
    seeing: int


def parts_of(substeps: int, acts_after: int, seen_before: int) -> Parts:
    """Return the parts of a control step.

    Args:
        substeps: substeps of the step.
        acts_after: substeps after which an action acts.
        seen_before: substeps before the end at which an observation is made.
    """
    ends = sorted({acts_after, substeps - seen_before, substeps} - {0})
    begins = [0, *ends[:-1]]
    lengths = tuple(end - begin for begin, end in zip(begins, ends, strict=True))
    seeing = ends.index(substeps - seen_before) if seen_before else -1
    return Parts(lengths, begins.index(acts_after), seeing)
