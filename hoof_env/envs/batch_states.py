"""States of a batch of episodes: reading, checks, and restoring, also into a batch of another size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.conditions import RowConditions, conditions_of, enter, under_each
from hoof_env.errors import ParameterError
from hoof_env.tasks.disturbances import MOST_PUSH, Push
from hoof_env.tasks.settings import Settings

Floats = NDArray[np.float64]


def state_of(batch: Any) -> dict[str, Any]:
    """Return everything that changes, except for the generators."""
    state = {"engine": batch.engine.get_state(), "episode": batch.episode[:, : batch.num_envs].copy()}
    state["start_values"] = batch.start_values.copy()
    if batch.is_push_unseen or batch.frames.size:
        # As they were seen: a push shows in the state of the engine alone, and frames are of the past
        state["observations"] = batch.observations[: batch.num_envs].copy()
    state |= {name: getattr(batch, name)[: batch.num_envs].copy() for name in kept_arrays(batch)}
    if any(batch.push_plans):
        state["pushes"] = [*batch.push_plans]
    if batch.conditions.are_mixed or batch.conditions.are_due(np.arange(batch.num_envs)):
        state["rows"] = batch.conditions.to_plain()
    # Without a schedule, too: one that `change_settings` adds counts all steps of a row.
    state["steps_before"] = batch.steps_before.copy()
    return state | ({"paper": batch.paper.get_state()} if batch.paper else {})


def check_single(state: Any) -> None:
    """Check that a state is not one of a vector environment.

    Raises:
        ParameterError: it is.
    """
    if isinstance(state, Mapping) and "ended" in state:
        many = np.size(state["ended"])
        raise ParameterError(f"state: expected one of a single environment, got one of {many} environments")


def spread_state(batch: Any, state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the state of a single environment as one of a vector environment with this state in every row.

    Raises:
        ParameterError: `state` is not one of a single environment.
    """
    n = batch.num_envs

    def repeated(values: Any) -> Any:
        """Repeat the last axis, which is that of the environments, n times."""
        return np.repeat(np.asarray(values, np.float64), n, -1)

    try:
        engine = state["engine"]
        layout = state["engine"]["layout"]
        if layout["num_envs"] != 1 or np.shape(state["episode"])[-1] != 1:
            raise ValueError
        parts = {name: repeated(values) for name, values in engine.items() if name != "layout"}
        spread = {**state, "engine": {**parts, "layout": {**layout, "num_envs": n}}}
        spread |= {name: repeated(state[name]) for name in ("episode", "start_values") if name in state}
        of_rows = ("pushes", "observations", "frames", "past_actions", "steps_before")
        spread |= {name: [*state[name]] * n for name in of_rows if name in state}
        if "rows" in state:
            each = {name: np.repeat(state["rows"][name], n) for name in ("which", "coming")}
            spread["rows"] = {**state["rows"], **each}
        if "paper" in state:
            paper = state["paper"]
            spread["paper"] = {"legs": [*paper["legs"]] * n} | {
                name: np.repeat(paper[name], n) for name in ("accounts", "last")
            }
    except (KeyError, TypeError, ValueError, IndexError):
        raise ParameterError(
            "state: expected what get_state gives of one environment, or of this vector environment"
        ) from None
    ended = spread["episode"][batch.ended_row] != 0.0
    return {**spread, "ended": ended, "generator": [state["generator"]] * n}


def is_possible(batch: Any, episode: Floats) -> bool:
    """True if all rows of the episodes' memory have positive weights, and finite gaits of horses."""
    weight = episode[batch.layout.rows("weight")]
    rows = [episode[batch.layout.rows(name)] for name in batch.body.finite_fields]
    return bool((weight > 0).all() and all(np.isfinite(values).all() for values in rows))


def set_state(batch: Any, state: Mapping[str, Any]) -> None:
    """Restore a state of `state_of`, and observe it. Everything is checked before anything changes.

    Raises:
        ParameterError: a part is missing or broken, or has a shape of another batch.
    """
    conditions = _read_conditions(batch, state.get("rows"))
    before = batch.conditions
    kept = conditions_of(batch), batch.drawn_names, batch.start_values
    batch.put_under(conditions)
    try:
        _set_state(batch, state)
    except BaseException:
        batch.conditions = before
        enter(batch, kept[0])
        batch.drawn_names = kept[1]
        batch.start_values = kept[2]
        raise


def _set_state(batch: Any, state: Mapping[str, Any]) -> None:
    """Restore a state whose conditions the batch is under."""
    expected = (len(batch.episode), batch.num_envs)
    try:
        episode = np.asarray(state["episode"], np.float64)
    except (TypeError, ValueError):
        episode = np.array(np.nan)
    if np.isnan(episode).any() or (episode.shape == expected and not is_possible(batch, episode)):
        raise ParameterError(f"state['episode']: expected numbers, got {state['episode']!r:.60}")
    if episode.shape != expected:
        raise ParameterError(
            f"state['episode']: expected shape {expected} for {batch.num_envs} environments, "
            f"got {episode.shape}"
        )
    start_values = np.asarray(state.get("start_values", np.nan))
    if start_values.dtype.kind != "f" or start_values.shape not in ((), batch.start_values.shape):
        raise ParameterError(
            f"state['start_values']: expected numbers, shape {batch.start_values.shape}, got"
            f" {state['start_values']!r:.60}"
        )
    plans = _read_plans(batch, state.get("pushes"))
    seen = {name: _read_seen(batch, name, state.get(name)) for name in ("observations", *kept_arrays(batch))}
    of_paper = batch.paper.read_state(state.get("paper")) if batch.paper else None
    steps_before = _read_steps(batch, state.get("steps_before"))
    batch.engine.set_state(state["engine"])
    if batch.paper and of_paper:
        batch.paper.set_state(*of_paper)
    batch.episode[:, : batch.num_envs] = episode
    batch.start_values[:] = start_values
    batch.push_plans = plans
    batch.steps_before[:] = steps_before
    batch.is_push_unseen = "observations" in state
    batch.unpushed = {}
    # The state's engine may have drawn parameters, which the next reset must replace.
    batch.has_overrides[:] = True
    if batch.conditions.differ:
        under_each(batch, np.arange(batch.num_envs), lambda rows: _observe(batch), for_kernels=True)
    else:
        batch.observe()
    for name, values in seen.items():
        if values is not None:
            getattr(batch, name)[: batch.num_envs] = values


def kept_arrays(batch: Any) -> list[str]:
    """Return the names of the arrays in which a batch keeps frames and actions, if it does."""
    return [name for name in ("frames", "past_actions") if getattr(batch, name).size]


def _observe(batch: Any) -> None:
    """Observe the present, forces on the present ground included."""
    batch.engine.observe()
    batch.observe()


def _read_steps(batch: Any, given: Any) -> Floats:
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


def _read_conditions(batch: Any, given: Any) -> RowConditions:
    """Return the conditions of the rows in a state, without any those of all rows at present.

    Raises:
        ParameterError: not such conditions.
    """
    n = batch.num_envs
    conditions = batch.conditions.copied()
    if given is None:
        if conditions.all:
            conditions.place(np.full(n, conditions.which.max()), conditions.coming)
        return conditions
    try:
        each = [batch.conditions_under(Settings(**settings)) for settings in given["settings"]]
        which, coming = (np.asarray(given[name], np.int64) for name in ("which", "coming"))
        is_whole = which.shape == coming.shape == (n,) and bool(each)
    except (KeyError, TypeError, ValueError):
        is_whole = False
    if not is_whole or not ((np.minimum(which, coming) >= 0) & (np.maximum(which, coming) < len(each))).all():
        raise ParameterError(f"state['rows']: expected settings of each environment, got {given!r:.60}")
    made = RowConditions(n)
    made.all = each
    made.place(which, coming)
    return made


def _read_plans(batch: Any, given: Any) -> list[tuple[Push, ...]]:
    """Return the pushes that are given in a state for each row.

    Raises:
        ParameterError: not such pushes.
    """
    if given is None:
        return [()] * batch.num_envs
    try:
        plans = [tuple((int(at), float(x), float(y)) for at, x, y in plan) for plan in given]
    except (TypeError, ValueError, OverflowError):
        plans = []
    impulses = np.abs([push[1:] for plan in plans for push in plan])
    if len(plans) != batch.num_envs or not (impulses <= MOST_PUSH).all():
        raise ParameterError(
            f"state['pushes']: expected the pushes of each environment, up to {MOST_PUSH:g} N s, got"
            f" {given!r:.60}"
        )
    return plans


def _read_seen(batch: Any, name: str, given: Any) -> NDArray[np.float32] | None:
    """Return what was observed or asked for in a state; None for observations that a state has not.

    Raises:
        ParameterError: numbers out of range, or another shape.
    """
    if given is None and name == "observations":
        return None
    expected = (batch.num_envs, *getattr(batch, name).shape[1:])
    try:
        values = np.asarray(given, np.float32)
    except (TypeError, ValueError):
        values = np.array(np.nan, np.float32)
    if values.shape != expected or not (np.abs(values) <= 1.0).all():
        raise ParameterError(f"state[{name!r}]: expected numbers in [-1, 1], shape {expected}")
    return values
