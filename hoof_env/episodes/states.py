"""States of a batch of episodes: reading, checks, and restoring, also into a batch of another size."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.layout import TrunkSettings
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.episodes.pushes import MAX_PUSH
from hoof_env.episodes.row_plans import CHANGEABLE, RowPlans
from hoof_env.episodes.rows import repeated
from hoof_env.errors import ParameterError
from hoof_env.simd.layout import Layout
from hoof_env.tasks.settings import Settings, to_json

Floats = NDArray[np.float64]

COSTS = ("costs", "cost_sums", "stance_rises", "debts")
"""Arrays of `Rows` about costs."""

UNBOUNDED = frozenset({"target", "switch", "next_target", "commanded", "push_at", "own", "terms"})
"""Fields of `episode.Episode` that are infinite where there is no command and no push, and rows of users'
terms, which may have any value."""


def state_of(batch: EpisodeBatch) -> dict[str, Any]:
    """Return everything that changes, except for the generators."""
    rows = batch.rows
    state: dict[str, Any] = {"engine": batch.engine.get_state()}
    state |= {name: rows.get(name) for name in rows.saved()}
    if batch.is_push_unseen or rows.frames.size:
        # As they were seen: a push shows in the state of the engine alone, and frames are of the past
        state["observations"] = rows.get("observations")
    if any(rows.pushes):
        state["pushes"] = rows.pushes.tolist()
    if len(batch.row_plans.plans) > 1:
        state["rows"] = batch.row_plans.to_plain()
    return state


def check_single(state: Any) -> None:
    """Check that a state is not one of a vector environment.

    Raises:
        ParameterError: it is.
    """
    if isinstance(state, Mapping) and "ended" in state:
        many = np.size(state["ended"])
        raise ParameterError(
            f"state: expected a state of a single environment, got one of {many} environments"
        )


def spread_state(batch: EpisodeBatch, state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the state of a single environment as one of a vector environment with this state in every row.

    Raises:
        ParameterError: `state` is not one of a single environment.
    """
    n = batch.num_envs
    try:
        if np.shape(state["episode"])[-1] != 1:
            raise ValueError
        spread = {**state, "engine": batch.engine.repeated(state["engine"], n)}
        of_rows = [*batch.rows.saved(), "observations"]
        spread |= {name: repeated(name, state[name], n) for name in of_rows if name in state}
        if "pushes" in state:
            spread["pushes"] = [*state["pushes"]] * n
        if "rows" in state:
            each = {name: np.repeat(state["rows"][name], n) for name in ("which", "coming")}
            spread["rows"] = {**state["rows"], **each}
    except (KeyError, TypeError, ValueError, IndexError):
        raise ParameterError(
            "state: expected what get_state returns for one environment, or of this vector environment"
        ) from None
    ended = spread["episode"][batch.ended_row] != 0.0
    return {**spread, "ended": ended, "generator": [state["generator"]] * n}


def set_state(batch: EpisodeBatch, state: Mapping[str, Any]) -> None:
    """Restore a state of `state_of`, and observe it. Everything is checked before anything changes.

    Raises:
        ParameterError: a part is missing or broken, or has a shape of another batch.
    """
    before = batch.row_plans, batch.plan, batch.drawn_names, batch.rows.start_values
    row_plans = _read_row_plans(batch, state.get("rows"))
    if row_plans is not batch.row_plans:
        batch.put_under(row_plans)
    engine, rows = batch.engine.snapshot(), batch.rows.snapshot()
    try:
        _set_state(batch, state)
        _check_observed(batch)
    except BaseException:
        batch.engine.restore(engine)
        batch.rows.restore(rows)
        batch.row_plans, plan, batch.drawn_names, batch.rows.start_values = before
        batch.enter(plan)
        raise


MAX_SETTING = 1e15
"""Largest absolute value of a leg's setting in a state: products of larger ones may overflow in a step."""


def _check_settings(engine: Mapping[str, Any]) -> None:
    """Check the masses and settings in the state of an engine.

    Raises:
        ParameterError: a mass is not positive, or a setting of a leg is beyond `MAX_SETTING`.
    """
    try:
        masses = np.asarray(engine["trunk_settings"], np.float64)[TrunkSettings.rows("total_mass")]
        largest = float(np.abs(np.asarray(engine["limb_settings"], np.float64)).max())
    except (TypeError, ValueError, KeyError, IndexError):
        return  # the engine raises the error
    if (masses <= 0.0).any():
        raise ParameterError(f"state['trunk_settings']: expected positive masses, got {masses.min():g}")
    if largest > MAX_SETTING:
        raise ParameterError(
            f"state['limb_settings']: expected numbers within +-{MAX_SETTING:g}, got {largest:g}"
        )


def _check_observed(batch: EpisodeBatch) -> None:
    """Check that a state gives observations; users' entries are checked where they are returned.

    Raises:
        ParameterError: an observation is not finite.
    """
    seen = batch.rows.observations[: batch.num_envs]
    if not batch.plan.observed.has_user_entries and not np.isfinite(seen).all():
        env, column = np.argwhere(~np.isfinite(seen))[0].tolist()
        raise ParameterError(
            "state: expected numbers of a motion that can be simulated, got some of which"
            f" {batch.plan.observation_names[column]!r} is {seen[env, column]} in environment {env}"
        )


def _set_state(batch: EpisodeBatch, state: Mapping[str, Any]) -> None:
    """Restore a state whose plans the batch is under."""
    rows, saved = batch.rows, batch.rows.saved()
    episode = _read_episode(batch, state["episode"])
    # States of older versions have no start values: infos then contain NaN.
    start_values = np.asarray(state.get("start_values", np.nan))
    if start_values.dtype.kind != "f" or start_values.shape not in ((), rows.start_values.shape):
        raise ParameterError(
            f"state['start_values']: expected numbers, shape {rows.start_values.shape}, got"
            f" {state['start_values']!r:.60}"
        )
    pushes = _read_pushes(batch, state.get("pushes"))
    costs = {name: _read_costs(batch, name, state.get(name)) for name in COSTS if name in saved}
    seen = [name for name in saved if name in ("frames", "past_actions")]
    if state.get("observations") is not None:
        seen.append("observations")
    observed = {name: _read_seen(batch, name, state.get(name)) for name in seen}
    steps_before = _read_steps(batch, state.get("steps_before"))
    _check_settings(state["engine"])
    batch.engine.set_state(state["engine"])
    if not batch.engine.in_kernels:
        batch.under_each(np.arange(batch.num_envs), batch.engine.adopt)
    rows.put("episode", episode)
    rows.put("start_values", start_values)
    rows.put("steps_before", steps_before)
    rows.pushes[:] = pushes
    for name in costs:
        rows.put(name, costs[name])
    # The state's engine may have drawn parameters, which the next reset must replace.
    rows.put("has_overrides", True)
    batch.is_push_unseen = "observations" in state
    batch.unpushed = {}
    batch.observe_all()
    for name, values in observed.items():
        rows.put(name, values)


def _read_episode(batch: EpisodeBatch, given: Any) -> Floats:
    """Return the memory of the episodes in a state.

    Raises:
        ParameterError: not numbers, impossible ones, or another shape.
    """
    expected = (len(batch.rows.episode), batch.num_envs)
    try:
        episode = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        episode = np.array(np.nan)
    if np.isnan(episode).any() or (episode.shape == expected and not _is_possible(batch, episode)):
        raise ParameterError(f"state['episode']: expected numbers, got {given!r:.60}")
    if episode.shape != expected:
        raise ParameterError(
            f"state['episode']: expected shape {expected} for {batch.num_envs} environments, "
            f"got {episode.shape}"
        )
    return episode


def _is_possible(batch: EpisodeBatch, episode: Floats) -> bool:
    """True if the episodes' memory has positive weights, and infinite numbers only where they are usual."""
    layout = batch.rows.layout
    bounded = np.isfinite(episode[_bounded_rows(layout)])
    speeds = episode[layout.rows("target")] if batch.plan.commands.speeds else np.zeros(1)
    weights = episode[layout.rows("weight")]
    return bool(bounded.all() and np.isfinite(speeds).all() and (weights > 0).all())


@cache
def _bounded_rows(layout: type[Layout]) -> NDArray[np.int64]:
    """Return the rows of a layout of episodes that are not in `UNBOUNDED`."""
    rows = [layout.rows(name) for name in layout.fields if name not in UNBOUNDED]
    return np.concatenate([np.arange(part.start, part.stop) for part in rows])


def _read_steps(batch: EpisodeBatch, given: Any) -> Floats:
    """Return the control steps of earlier episodes in a state, by which schedules go on.

    Raises:
        ParameterError: not a whole number for each environment.
    """
    steps = np.zeros(batch.num_envs) if given is None else np.asarray(given)
    if (
        steps.dtype.kind not in "iuf"
        or steps.shape != (batch.num_envs,)
        or not np.isfinite(steps).all()
        or not (steps == np.rint(steps)).all()
    ):
        raise ParameterError(
            f"state['steps_before']: expected a whole number for each environment, got {given!r:.60}"
        )
    return steps.astype(np.float64)


def _read_row_plans(batch: EpisodeBatch, given: Any) -> RowPlans:
    """Return the plans of the rows in a state; in a state without any all rows are under the newest one.

    Raises:
        ParameterError: not such plans.
    """
    n = batch.num_envs
    if given is None and len(batch.row_plans.plans) == 1:
        return batch.row_plans
    if given is None:
        row_plans = batch.row_plans.copy()
        row_plans.place(np.full(n, row_plans.present.max()), row_plans.pending)
        return row_plans
    try:
        plans = [batch.plan_of(Settings(**settings)) for settings in given["settings"]]
        present, pending = (np.asarray(given[name], np.int64) for name in ("which", "coming"))
        is_whole = present.shape == pending.shape == (n,) and bool(plans)
        # Kernels under other settings than these would read and write beyond the arrays.
        fixed = _fixed(batch.plan.asked)
        is_whole = is_whole and all(_fixed(plan.asked) == fixed for plan in plans)
    except (KeyError, TypeError, ValueError):
        is_whole = False
    if (
        not is_whole
        or not ((np.minimum(present, pending) >= 0) & (np.maximum(present, pending) < len(plans))).all()
    ):
        raise ParameterError(f"state['rows']: expected settings of each environment, got {given!r:.60}")
    row_plans = RowPlans(plans, n)
    row_plans.place(present, pending)
    return row_plans


def _fixed(settings: Settings) -> dict[str, Any]:
    """Return the settings that no row can have of its own, by name."""
    return {name: value for name, value in to_json(settings).items() if name not in CHANGEABLE}


def _read_pushes(batch: EpisodeBatch, given: Any) -> NDArray[Any]:
    """Return the pushes that are given in a state for each row, tuples as objects, shape (num_envs,).

    Raises:
        ParameterError: not such pushes.
    """
    found = np.empty(batch.num_envs, object)
    if given is None:
        found[:] = [()] * batch.num_envs
        return found
    try:
        pushes = [tuple((int(at), float(x), float(y)) for at, x, y in row) for row in given]
    except (TypeError, ValueError, OverflowError):
        pushes = []
    impulses = np.abs([push[1:] for row in pushes for push in row])
    if len(pushes) != batch.num_envs or not (impulses <= MAX_PUSH).all():
        raise ParameterError(
            f"state['pushes']: expected the pushes of each environment, up to {MAX_PUSH:g} N s, got"
            f" {given!r:.60}"
        )
    found[:] = pushes
    return found


def _read_costs(batch: EpisodeBatch, name: str, given: Any) -> Floats:
    """Return costs in a state.

    Raises:
        ParameterError: not numbers, below 0 except of a task's own costs, or another shape.
    """
    expected = batch.rows.get(name).shape
    try:
        values = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        values = np.array(np.nan)
    count = len(batch.plan.costs.limits) if name in ("costs", "cost_sums") else None
    if values.shape != expected or np.isnan(values).any() or not _are_costs(values[:count]):
        raise ParameterError(f"state[{name!r}]: expected numbers from 0, shape {expected}")
    return values


def _are_costs(values: Floats) -> bool:
    """Return whether numbers can be costs with limits."""
    return bool(((values >= 0.0) & np.isfinite(values)).all())


def _read_seen(batch: EpisodeBatch, name: str, given: Any) -> NDArray[np.float32]:
    """Return the stored observations or actions of a state.

    Raises:
        ParameterError: numbers out of range, or another shape.
    """
    expected = batch.rows.get(name).shape
    try:
        values = np.asarray(given, np.float32)
    except (TypeError, ValueError):
        values = np.array(np.nan, np.float32)
    if values.shape != expected or not (np.abs(values) <= 1.0).all():
        raise ParameterError(f"state[{name!r}]: expected numbers in [-1, 1], shape {expected}")
    return values
