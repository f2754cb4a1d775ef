"""Pushes on the trunk in an episode: given ones, and ones that are drawn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.parts import MAX_IMPULSE
from hoof_env.episodes.rows import Rows
from hoof_env.errors import ParameterError, brief, check_number
from hoof_env.tasks.disturbances import MAX_STRENGTH
from hoof_env.tasks.parameters import check_range
from hoof_env.tasks.settings import ResolvedSettings

Index = NDArray[np.int64]
Generators = Sequence[np.random.Generator]

MAX_PUSH = MAX_IMPULSE / MAX_STRENGTH
"""Largest impulse of a planned push [N s], so that it is possible at any strength."""

Push = tuple[int, float, float]
"""Control step after which the trunk is pushed, impulse forward and upward [N s]."""

NO_PUSHES: tuple[Push, ...] = ((0, 0.0, 0.0),)
"""Pushes of an episode without any where they are drawn otherwise: its one push, of nothing, is past."""


def _listed(value: Any) -> Any:
    """Convert an array to a list; return any other value unchanged."""
    return value.tolist() if isinstance(value, np.ndarray) else value


def check_pushes(name: str, given: Any, dt: float, steps: int) -> tuple[Push, ...]:
    """Return given pushes in the order of their times.

    Args:
        name: name of the setting or option, for messages.
        given: rows of time [s], impulse forward and impulse upward [N s]; None without pushes.
        dt: control step [s], to which times are rounded.
        steps: number of control steps of an episode.

    Raises:
        ParameterError: a row of another form, or a time outside the episode.
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
            check_number(f"{name}[{k}], impulse", value, low=-MAX_PUSH, high=MAX_PUSH) for value in row[1:]
        )
        # A push at time 0 comes after the first step, because the start sets the speed.
        step = max(round(seconds / dt), 1)
        before = impulses.get(step, (0.0, 0.0))
        # The sum of all pushes of a step is one push, which is limited, too.
        impulses[step] = (
            check_number(f"{name}[{k}], impulse", before[0] + forward, low=-MAX_PUSH, high=MAX_PUSH),
            check_number(f"{name}[{k}], impulse", before[1] + upward, low=-MAX_PUSH, high=MAX_PUSH),
        )
    return tuple((step, *impulses[step]) for step in sorted(impulses))


@dataclass(frozen=True)
class Pushes:
    """Pushes on the trunk.

    Attributes:
        given: pushes of each episode, in the order of their times.
        impulse: smallest and largest impulse of pushes that are drawn [N s]; None if none are drawn.
        seconds: shortest and longest time from one push that is drawn to the next [s].
        trunk: kind of the trunk.
        dt: control step [s].
        steps_per_episode: control steps of an episode.
    """

    given: tuple[Push, ...]
    impulse: tuple[float, float] | None
    seconds: tuple[float, float]
    trunk: str
    dt: float
    steps_per_episode: int

    @classmethod
    def of(cls, s: ResolvedSettings, dt: float, steps_per_episode: int) -> Pushes:
        """Return the pushes from settings.

        Raises:
            ParameterError: a setting is out of range, or has no effect.
        """
        given = check_pushes("pushes", s.pushes, dt, steps_per_episode)
        impulse = None
        if s.push_impulse is not None:
            impulse = check_range("push_impulse", s.push_impulse, -MAX_PUSH, MAX_PUSH)
        # Intervals shorter than a control step do no harm where nothing is pushed.
        seconds = check_range("push_seconds", s.push_seconds, dt if impulse else 0.0)
        if given and impulse:
            raise ParameterError(f"pushes: expected none together with a push_impulse, got {brief(s.pushes)}")
        pushes = cls(given, impulse, seconds, s.trunk, dt, steps_per_episode)
        if impulse:
            pushes.check_trunk("push_impulse", upward=False)
        if given:
            pushes.check_trunk("pushes", upward=any(upward for _, _, upward in given))
        return pushes

    def check_trunk(self, name: str, *, upward: bool) -> None:
        """Check that the trunk can be pushed.

        Args:
            name: name of the setting, option or call, for messages.
            upward: True for an impulse that is not horizontal.

        Raises:
            ParameterError: it cannot.
        """
        if self.trunk == "fixed":
            raise ParameterError(f"{name}: expected none on a fixed trunk, which stays where it is")
        if self.trunk == "rail" and upward:
            raise ParameterError(
                f"{name}: expected no impulse upward on a rail, which holds the trunk's height"
            )

    def check_option(self, given: Any) -> tuple[Push, ...]:
        """Return the pushes of the reset option "pushes", in the order of their times.

        Raises:
            ParameterError: not such pushes, or the trunk cannot be pushed.
        """
        pushes = check_pushes("options['pushes']", given, self.dt, self.steps_per_episode)
        if pushes:
            self.check_trunk("options['pushes']", upward=any(upward for _, _, upward in pushes))
        return pushes

    def begin(self, rows: Rows, which: Index, generators: Generators, options: Mapping[str, Any]) -> None:
        """Plan the pushes of episodes that start in some rows."""
        given: tuple[Push, ...] = options.get("pushes", self.given)
        if "pushes" in options and self.impulse:
            given = given or NO_PUSHES
        for env in which.tolist():
            rows.pushes[env] = given
        rows.named.push_at[which] = np.inf
        rows.named.next_push[:, which] = 0.0
        if given or self.impulse:
            self.plan_next(rows, which, generators)

    def plan_next(self, rows: Rows, which: Index, generators: Generators) -> None:
        """Find the next push of some rows: the next one that was given, or one that is drawn."""
        episode = rows.named
        for env, generator in zip(which.tolist(), generators, strict=True):
            now = episode.steps[env]
            at = np.inf
            push: Sequence[float] = (0.0, 0.0)
            if rows.pushes[env]:
                later = [(step, push) for step, *push in rows.pushes[env] if step > now]
                (at, push) = later[0] if later else (at, push)
            elif self.impulse:
                when, how_much = generator.random(2)
                (shortest, longest) = self.seconds
                at = now + max(np.rint((shortest + (longest - shortest) * when) / self.dt), 1.0)
                push = (self.impulse[0] + (self.impulse[1] - self.impulse[0]) * how_much, 0.0)
            episode.push_at[env] = at
            episode.next_push[:, env] = push
