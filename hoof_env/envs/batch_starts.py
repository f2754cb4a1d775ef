"""Starts of episodes of a batch: options, drawn parameters, commanded speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.advance import LANES
from hoof_env.envs.batch_build import name_source, substeps_under
from hoof_env.envs.batch_pushes import begin_disturbances, check_can_be_pushed
from hoof_env.envs.conditions import enter
from hoof_env.errors import ParameterError
from hoof_env.tasks.disturbances import check_pushes
from hoof_env.tasks.parameters import draw_parameters, extremes
from hoof_env.tasks.reward import BEARING, LONGEST_STRIDE
from hoof_env.tasks.schedules import SPEED, drawn_names

Floats = NDArray[np.float64]


def check_options(batch: Any, options: Any, rows: NDArray[np.int64] | None = None) -> dict[str, Any]:
    """Check reset options completely, so that a refused reset changes nothing; return them in the form that
    `EpisodeBatch.reset` takes.

    Args:
        batch: an `EpisodeBatch`.
        options: the options.
        rows: rows that start, each under its coming conditions; None for all.

    Raises:
        ParameterError: an unknown option, or one that some of the episodes cannot have.
    """
    conditions = batch.conditions
    which = np.arange(batch.num_envs) if rows is None else rows
    if not conditions.are_due(which) and not conditions.are_mixed:
        return _check_options(batch, options)
    checked: dict[str, Any] = {}
    try:
        for k in np.unique(conditions.coming[which]).tolist():
            enter(batch, conditions.all[k])
            checked = _check_options(batch, options)
            conditions.all[k]["validated"] = batch.validated
    finally:
        enter(batch, conditions.newest)
    return checked


def _check_options(batch: Any, options: Any) -> dict[str, Any]:
    """Check reset options under the present conditions."""
    checked = batch.body.check_options(options, batch.engine.trunk, batch.settings)
    if batch.paper and checked.get("parameters"):
        raise ParameterError(
            f"options['parameters']: expected none with solver=\"paper\", got {checked['parameters']!r}"
        )
    gaits = checked.get("gait")
    if isinstance(gaits, np.ndarray) and gaits.ndim == 2 and len(gaits) != batch.num_envs:
        raise ParameterError(
            f"options['gait']: expected one gait or {batch.num_envs}, one for each environment, got"
            f" {len(gaits)}"
        )
    if "pushes" in checked:
        given = check_pushes("options['pushes']", checked["pushes"], batch.dt, batch.steps_per_episode)
        if given:
            check_can_be_pushed("options['pushes']", batch, any(upward for _, _, upward in given))
        checked["pushes"] = given
    check_extremes(batch, batch.randomize | checked.get("parameters", {}))
    return checked


def check_extremes(batch: Any, parameters: Mapping[str, float | tuple[float, float]]) -> None:
    """Check the limits of everything that can be drawn; warn if it needs shorter substeps.

    Raises:
        ParameterError: a parameter, or a combination of them, is out of range.
    """
    # The last ones are remembered: learners pass the same options at every reset.
    if parameters and batch.validated != (words := repr(parameters)):
        with name_source(batch, parameters):
            for corner in extremes(parameters):
                substeps_under(batch, corner, batch.engine.substeps)
        batch.validated = words


def start(
    batch: Any,
    which: NDArray[np.int64],
    generators: Sequence[np.random.Generator],
    options: Mapping[str, Any],
) -> dict[str, Floats]:
    """Start episodes, see `EpisodeBatch.reset`. The order of the draws from a generator is part of what a
    seed means."""
    episode = batch.episode_rows
    options = {**batch.task.start, **options}
    batch.unpushed = {env: values for env, values in batch.unpushed.items() if env not in which}
    batch.steps_before[which] += episode.steps[which]
    of_options = options.get("parameters", {})
    parameters = batch.randomize | of_options
    scheduled = [name for name in drawn_names(batch.schedule) if name not in of_options]
    drawn = {name: np.zeros(len(which)) for name in parameters}
    # Also without parameters if the last episode had some: they were for that one only.
    if parameters or batch.has_overrides[which].any():
        for k, (env, generator) in enumerate(zip(which, generators, strict=True)):
            for name in scheduled:
                parameters[name] = _now(batch, name, int(env))
            values = draw_parameters(parameters, generator)
            for name, value in values.items():
                drawn[name][k] = value
            vary(batch, int(env), values)
        batch.has_overrides[which] = bool(parameters)
    gaits: Any = options.get("gait")
    # Gaits of all environments, of which only some start.
    if np.ndim(gaits) == 2:
        options = {**options, "gait": gaits[which]}
    start = batch.body.draw(options, generators, batch.engine)
    _clear(batch, which)
    begin_targets(batch, which, generators, options)
    begin_disturbances(batch, which, generators, options)
    batch.body.complete_start(start, episode.target[which], options, batch.engine)
    batch.engine.reset(start.commands, start.theta, envs=which, **start.trunk)
    start_values = [*(start.values[name] for name in batch.body.start_names), *start.gaits.T]
    # Other rows may draw parameters that these do not.
    each = [
        drawn[name] if name in batch.randomize else np.full(len(which), np.nan) for name in batch.drawn_names
    ]
    batch.start_values[:, which] = [*start_values, *each]
    episode.x_before[which] = start.trunk["x"]
    batch.body.begin_episodes(episode, which, start)
    if batch.paper:
        batch.paper.start(which.tolist(), start.gaits, *(start.values[name] for name in ("crank_angle", "x")))
    # Whole groups of lanes, from that of the first environment to that of the last: kernels take no parts.
    begin, end = (int(row) // LANES * LANES for row in (which.min(), which.max() + LANES))
    groups = range(begin, min(batch.engine.columns, end))
    batch.observe(groups)
    if batch.frames.size or batch.past_actions.size:
        fill_past(batch, which)
        # Again, with what the first one saw as all that was ever seen.
        batch.observe(groups)
    return drawn


def _clear(batch: Any, which: NDArray[np.int64]) -> None:
    """Set what rows count and keep to its value at the start of an episode."""
    episode = batch.episode_rows
    for row in (episode.steps, episode.time, episode.distance, episode.commanded, episode.ended):
        row[which] = 0.0
    batch.rewards[which] = 0.0
    # The full allowance: a leg can bear its weight from the first step on.
    episode.allowance[which] = BEARING * LONGEST_STRIDE
    episode.terms[:, which] = 0.0
    episode.sums[:, which] = 0.0
    if batch.kept_begins.size:
        episode.own[:, which] = batch.kept_begins[:, None]


def begin_targets(
    batch: Any,
    which: NDArray[np.int64],
    generators: Sequence[np.random.Generator],
    options: Mapping[str, Any],
) -> None:
    """Draw or set the first commanded speeds of some rows."""
    episode = batch.episode_rows
    episode.target[which] = np.inf
    episode.switch[which] = np.inf
    if batch.target_speed:
        (low, high) = speeds_now(batch, which, vars(batch))
        episode.target[which] = low
        if batch.speed_changes:
            ends = zip(*np.broadcast_arrays(low, high, which)[:2], generators, strict=True)
            episode.target[which] = [generator.uniform(slow, fast) for slow, fast, generator in ends]
            draw_targets(batch, which, generators)
    # After the draws, so that the option does not change what follows from the generator.
    if "target_speed" in options:
        episode.target[which] = options["target_speed"]
        episode.switch[which] = np.inf


def _now(batch: Any, name: str, env: int) -> float | tuple[float, float]:
    """Return the value of a scheduled parameter at the start of an episode, or its range."""
    course = batch.schedule[name]
    low, high = map(float, course.after(batch.steps_before[env]))
    return (low, high) if course.is_range else low


def speeds_now(batch: Any, which: NDArray[np.int64], conditions: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return the lowest and highest commanded speed of the episodes of some rows, each one number or one for
    each row [m/s]."""
    course = conditions["schedule"].get(SPEED)
    ends: tuple[Any, Any] = conditions["target_speed"]
    return course.after(batch.steps_before[which]) if course else ends


def fill_past(batch: Any, which: NDArray[np.int64]) -> None:
    """Fill what some rows keep of before with their first frame, and with zeros for actions."""
    batch.past_actions[which] = 0.0
    batch.frames[which] = batch.frames[which, :1]


def vary(batch: Any, env: int, values: Mapping[str, float]) -> None:
    """Set physical parameters of one environment, by name; the others are those of the settings."""
    trunk, ground, limbs = batch.body.parts(replace(batch.settings, **dict(values)))
    batch.engine.vary(env, trunk, ground, limbs=limbs)
    batch.episode_rows.weight[env] = (trunk.mass + sum(limb.geometry.mass for limb in limbs)) * GRAVITY


def draw_targets(batch: Any, envs: NDArray[np.int64], generators: Sequence[np.random.Generator]) -> None:
    """Draw the next commanded speeds of some environments, and the control steps after which they are
    commanded, from a generator for each of `envs`."""
    # Rows under older conditions draw from the older ranges.
    if batch.conditions.are_mixed:
        each = dict(zip(envs.tolist(), generators, strict=True))
        for conditions, rows in batch.conditions.groups(envs):
            _draw_between(batch, rows, [each[env] for env in rows.tolist()], conditions)
    else:
        _draw_between(batch, envs, generators, vars(batch))


def _draw_between(
    batch: Any,
    envs: NDArray[np.int64],
    generators: Sequence[np.random.Generator],
    conditions: Mapping[str, Any],
) -> None:
    """Draw commanded speeds from the ranges of some conditions."""
    when, which = np.array([generator.random(2) for generator in generators]).reshape(-1, 2).T
    (shortest, longest) = conditions["target_seconds"]
    (low, high) = speeds_now(batch, envs, conditions)
    steps = np.rint((shortest + (longest - shortest) * when) / batch.dt)
    present = batch.episode_rows.target[envs]
    step = batch.body.command_step
    low = np.maximum(low, present - step)
    high = np.minimum(high, present + step)
    batch.episode_rows.switch[envs] = batch.episode_rows.steps[envs] + steps
    batch.episode_rows.next_target[envs] = low + (high - low) * which
