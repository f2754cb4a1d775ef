"""States of a batch of episodes, which can be put back, also as those of many."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError

Floats = NDArray[np.float64]


def state_of(batch: Any) -> dict[str, Any]:
    """Everything that changes, but for the generators.

    Raises:
        ParameterError: some episodes are under older settings than others.
    """
    if batch.conditions.are_mixed:
        raise ParameterError(
            "get_state: expected one set of settings for all, but some episodes began before they were"
            " changed; reset() starts all anew"
        )
    state = {"engine": batch.engine.get_state(), "episode": batch.episode[:, : batch.num_envs].copy()}
    state["start_values"] = batch.start_values.copy()
    return state | ({"paper": batch.paper.get_state()} if batch.paper else {})


def spread_state(batch: Any, state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the state of a single environment as one of a vector environment, all of whose rows are there.

    Raises:
        ParameterError: it is no state of one.
    """
    n = batch.num_envs

    def repeated(values: Any) -> Any:
        return np.repeat(np.asarray(values, np.float64), n, -1)

    try:
        engine = state["engine"]
        layout = state["engine"]["layout"]
        if layout["num_envs"] != 1 or np.shape(state["episode"])[-1] != 1:
            raise ValueError
        parts = {name: repeated(values) for name, values in engine.items() if name != "layout"}
        found = {**state, "engine": {**parts, "layout": {**layout, "num_envs": n}}}
        found |= {name: repeated(state[name]) for name in ("episode", "start_values") if name in state}
        if "paper" in state:
            paper = state["paper"]
            found["paper"] = {"legs": [*paper["legs"]] * n} | {
                name: np.repeat(paper[name], n) for name in ("accounts", "last")
            }
    except (KeyError, TypeError, ValueError, IndexError):
        raise ParameterError(
            "state: expected what get_state gives of one environment, or of this vector environment"
        ) from None
    ended = found["episode"][batch.ended_row] != 0.0
    return {**found, "ended": ended, "generator": [state["generator"]] * n}


def is_possible(batch: Any, episode: Floats) -> bool:
    """Whether weights, and the gaits of horses, are numbers that can be."""
    weight = episode[batch.layout.rows("weight")]
    if not batch.body.finite_fields and (weight > 0).all():
        return True
    begun = ~np.isnan(batch.start_values[0])
    rows = [episode[batch.layout.rows(name)][:, begun] for name in batch.body.finite_fields]
    return bool((weight[:, begun] > 0).all() and all(np.isfinite(values).all() for values in rows))


def set_state(batch: Any, state: Mapping[str, Any]) -> None:
    """Put back what `get_state` gave; `ParameterError` for one of another task, geometry or setting."""
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
    begun = np.asarray(state.get("start_values", np.nan))  # older states do not say
    if begun.dtype.kind != "f" or begun.shape not in ((), batch.start_values.shape):
        raise ParameterError(
            f"state['start_values']: expected numbers, shape {batch.start_values.shape}, got"
            f" {state['start_values']!r:.60}"
        )
    of_paper = batch.paper.read_state(state.get("paper")) if batch.paper else None
    batch.engine.set_state(state["engine"])
    if batch.paper and of_paper:
        batch.paper.set_state(*of_paper)
    batch.episode[:, : batch.num_envs] = episode
    batch.start_values[:] = begun
    batch.has_overrides[:] = True
    if batch.conditions.all:
        batch.conditions.start(np.arange(batch.num_envs))
    batch.observe_kernel(batch.addresses)
