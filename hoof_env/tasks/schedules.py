"""Schedules: settings that go from one value to another over a number of control steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, brief, check_number, count
from hoof_env.tasks.body import Body
from hoof_env.tasks.disturbances import MAX_STRENGTH
from hoof_env.tasks.parameters import check_parameters
from hoof_env.tasks.settings import PER_EPISODE, Settings

MAX_STEPS = 10**12
"""Largest number of control steps of a schedule."""

STRENGTH = "strength"
SPEED = "target_speed"
SCHEDULED = (STRENGTH, SPEED, *PER_EPISODE)
"""Settings that can be scheduled."""

Range = tuple[float, float]
Floats = NDArray[np.float64]


class Ramp(NamedTuple):
    """Ramp of a setting from one range to another; a single value is a range of width 0.

    Attributes:
        first, last: lowest and highest value at the start and after `steps`.
        steps: number of control steps.
        is_range: True if an episode draws between lowest and highest value.
    """

    first: Range
    last: Range
    steps: int
    is_range: bool

    @property
    def bounds(self) -> Range:
        """Lowest and highest value at any time."""
        return min(self.first[0], self.last[0]), max(self.first[1], self.last[1])

    def range_at(self, steps: Any) -> tuple[Floats, Floats]:
        """Return the lowest and highest value after a number of control steps, or after each of an array."""
        part = np.clip(np.asarray(steps) / self.steps, 0.0, 1.0)
        low, high = (
            (1.0 - part) * first + part * last for first, last in zip(self.first, self.last, strict=True)
        )
        # Rounding may leave the range that was checked.
        return np.clip(low, *self.bounds), np.clip(high, *self.bounds)


def check_unscheduled(name: str, settings: Settings) -> None:
    """Check that no schedule sets a setting.

    Args:
        name: name of the setting.
        settings: all settings, this one included.

    Raises:
        ParameterError: the schedule contains it.
    """
    if isinstance(settings.schedule, Mapping) and name in settings.schedule:
        raise ParameterError(
            f"{name}: expected none together with schedule[{name!r}], which sets it, got"
            f" {getattr(settings, name)!r}; change the schedule, or give it up with schedule=None"
        )


def check_schedule(given: Any, settings: Settings, body: Body) -> dict[str, Ramp]:
    """Return the ramps of scheduled settings, by name.

    Args:
        given: the setting `schedule`; None without a schedule.
        settings: settings of the environment.
        body: its body, which knows the range of commanded speeds.

    Raises:
        ParameterError: not a mapping of settings that can be scheduled to [first, last, control steps], a
            value out of range, or a setting that `randomize` draws, too.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not set(given) <= set(SCHEDULED):
        raise ParameterError(
            f"schedule: expected a mapping with some of {', '.join(SCHEDULED)}, got {brief(given)}"
        )
    return {name: _ramp(name, each, settings, body) for name, each in given.items()}


def _ramp(name: str, given: Any, settings: Settings, body: Body) -> Ramp:
    """Return the ramp of one setting."""
    title = f"schedule[{name!r}]"
    if not isinstance(given, (list, tuple)) or len(given) != 3:
        raise ParameterError(f"{title}: expected [first, last, control steps], got {brief(given)}")
    steps = count(f"{title}, control steps", given[2], most=MAX_STEPS)
    if name in (settings.randomize or {}):
        raise ParameterError(f"{title}: expected none together with randomize[{name!r}], got {brief(given)}")
    first, last = (
        _range(name, f"{title}, {which}", value, settings, body)
        for which, value in zip(("first", "last"), given, strict=False)
    )
    is_range = any(low < high for low, high in (first, last))
    return Ramp(first, last, steps, is_range)


def _range(name: str, title: str, value: Any, settings: Settings, body: Body) -> Range:
    """Return the range of one end of a ramp, from a number or a range."""
    if name == STRENGTH:
        number = check_number(title, value, low=0.0, high=MAX_STRENGTH)
        return number, number
    if name == SPEED:
        if settings.target_speed is None:
            raise ParameterError(f"{title}: expected a target_speed with it, got None")
        try:
            speeds = body.commanded_speeds(replace(settings, target_speed=value))
        except ParameterError as error:
            raise ParameterError(f"{title}: {error}") from None
        if speeds is None:
            raise ParameterError(f"{title}: expected a speed or two, got {brief(value)}")
        return speeds
    checked = check_parameters(title, {name: value}, settings)[name]
    return checked if isinstance(checked, tuple) else (checked, checked)


def drawn_names(schedule: Mapping[str, Ramp]) -> list[str]:
    """Return the names of the scheduled physical parameters, which an episode draws."""
    return [name for name in schedule if name in PER_EPISODE]
