"""Whether a state is one that `get_state` of such an environment gave, before anything is put back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError


def check_state(state: Any, env_id: str, settings: Mapping[str, Any], parts: Sequence[str] = ()) -> None:
    """Raise unless `state` is one that `get_state` of such an environment gave.

    Raises:
        ParameterError: it lacks a part, or is of another id or of other settings.
    """
    names = ("id", "settings", "engine", "episode", "generator", *parts)
    missing = [name for name in names if not isinstance(state, Mapping) or name not in state]
    if missing:
        raise ParameterError(f"state: expected what get_state gives, but {', '.join(missing)} is missing")
    if state["id"] != env_id:
        raise ParameterError(f"state: expected one of {env_id}, got one of {state['id']}")
    there = state["settings"] if isinstance(state["settings"], Mapping) else {}
    unlike = [f"{k}: {v!r} here, {there.get(k)!r} there" for k, v in settings.items() if there.get(k) != v]
    if unlike:
        raise ParameterError(f"state: of other settings; {'; '.join(unlike)}")


def generator_of(state: Any) -> np.random.Generator:
    """A generator in the state that a `PCG64` had.

    Raises:
        ParameterError: no such state.
    """
    generator = np.random.Generator(np.random.PCG64())
    try:
        generator.bit_generator.state = state
    except (TypeError, ValueError, KeyError):
        raise ParameterError(f"state['generator']: expected the state of a PCG64, got {state!r}") from None
    return generator
