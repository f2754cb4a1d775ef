"""Disturbances of a batch of episodes: what is drawn at a start, and pushes on the trunk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.errors import ParameterError, check_number
from hoof_env.tasks.disturbances import (
    MOST_PUSH,
    MOST_STRENGTH,
    Push,
    check_noise,
    check_pushes,
)
from hoof_env.tasks.parameters import check_range
from hoof_env.tasks.schedules import STRENGTH

Generators = Sequence[np.random.Generator]
Rows = NDArray[np.int64]

UNPUSHED: tuple[Push, ...] = ((0, 0.0, 0.0),)
"""Plan of an episode without pushes where they are drawn otherwise: its one push, of nothing, is past."""


def check_disturbances(batch: Any) -> None:
    """Check the settings of the disturbances of an `EpisodeBatch`, and set the attributes that follow from
    them.

    Raises:
        ParameterError: a setting is out of range, or has no effect.
    """
    s = batch.settings
    batch.noise = check_noise("noise", s.noise, batch.groups)
    batch.bias = check_noise("bias", s.bias, batch.groups)
    batch.strength = check_number("strength", s.strength, low=0.0, high=MOST_STRENGTH)
    batch.given_pushes = check_pushes("pushes", s.pushes, batch.dt, batch.steps_per_episode)
    batch.push_impulse = None
    if s.push_impulse is not None:
        batch.push_impulse = check_range("push_impulse", s.push_impulse, -MOST_PUSH, MOST_PUSH)
    # Intervals shorter than a control step do no harm where nothing is pushed
    shortest = batch.dt if batch.push_impulse else 0.0
    batch.push_seconds = check_range("push_seconds", s.push_seconds, shortest)
    if batch.given_pushes and batch.push_impulse:
        raise ParameterError(f"pushes: expected none beside a push_impulse, got {s.pushes!r}")
    if batch.push_impulse:
        check_can_be_pushed("push_impulse", batch, upward=False)
    if batch.given_pushes:
        check_can_be_pushed("pushes", batch, any(upward for _, _, upward in batch.given_pushes))


def check_can_be_pushed(name: str, batch: Any, upward: bool) -> None:
    """Check that the trunk of an `EpisodeBatch` can be pushed.

    Args:
        name: name of the setting, option or call, for messages.
        batch: the batch.
        upward: True for an impulse that is not horizontal.

    Raises:
        ParameterError: it cannot.
    """
    s = batch.settings
    if s.trunk == "fixed":
        raise ParameterError(f"{name}: expected none on a fixed trunk, which stays where it is")
    if s.trunk == "rail" and upward:
        raise ParameterError(f"{name}: expected no impulse upward on a rail, which holds the trunk's height")


def begin_disturbances(batch: Any, which: Rows, generators: Generators, options: Mapping[str, Any]) -> None:
    """Draw the disturbances of episodes that start in some rows."""
    episode = batch.episode_rows
    course = batch.schedule.get(STRENGTH)
    strength = course.after(batch.steps_before[which])[0] if course else batch.strength
    episode.strength[which] = options.get("strength", strength)
    draws = bool(batch.noise or batch.bias)
    episode.noise_key[which] = [generator.random() for generator in generators] if draws else 0.0
    for name in ("observation_delay", "action_delay"):
        delay = getattr(batch, name)
        is_drawn = delay.least < delay.most
        whole = [generator.integers(delay.least, delay.most + 1) for generator in generators if is_drawn]
        getattr(episode, name)[which] = whole if is_drawn else delay.most
    given: tuple[Push, ...] = options.get("pushes", batch.given_pushes)
    if "pushes" in options and batch.push_impulse:
        given = given or UNPUSHED
    for env in which.tolist():
        batch.push_plans[env] = given
    episode.push_at[which] = np.inf
    episode.next_push[:, which] = 0.0
    if given or batch.push_impulse:
        plan_pushes(batch, which, generators)


def plan_pushes(batch: Any, which: Rows, generators: Generators) -> None:
    """Find the next push of some rows: the next of those that were given, or one that is drawn."""
    episode = batch.episode_rows
    for env, generator in zip(which.tolist(), generators, strict=True):
        now = episode.steps[env]
        conditions = batch.conditions.of(env) or vars(batch)
        impulse = conditions["push_impulse"]
        at = np.inf
        push: Sequence[float] = (0.0, 0.0)
        if batch.push_plans[env]:
            later = [(step, push) for step, *push in batch.push_plans[env] if step > now]
            (at, push) = later[0] if later else (at, push)
        elif impulse:
            when, how_much = generator.random(2)
            (shortest, longest) = conditions["push_seconds"]
            at = now + max(np.rint((shortest + (longest - shortest) * when) / batch.dt), 1.0)
            push = (impulse[0] + (impulse[1] - impulse[0]) * how_much, 0.0)
        episode.push_at[env] = at
        episode.next_push[:, env] = push


def push_due(batch: Any, due: Rows, generators: Generators) -> None:
    """Push the trunks of some rows as planned, and plan their next pushes."""
    episode = batch.episode_rows
    measured = batch.measurements.read(batch.engine.arrays[0][:, due])
    batch.unpushed = dict(zip(due.tolist(), measured.T, strict=True))
    batch.engine.push(*(episode.strength[due] * episode.next_push[:, due]), due)
    batch.is_push_unseen = True
    plan_pushes(batch, due, generators)


def push_now(batch: Any, forward: Any, upward: Any, envs: Any) -> None:
    """Push the trunks of some rows at once, see `LegBase.push`.

    Raises:
        ParameterError: an impulse is not finite or of the wrong shape, or the trunk cannot be pushed.
    """
    engine: TrunkEngine = batch.engine
    check_can_be_pushed("push", batch, bool(np.any(upward)))
    engine.push(forward, upward, envs)
    batch.is_push_unseen = True
