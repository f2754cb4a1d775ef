"""States of an engine: their parts, and whether they fit another engine."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics import layout
from hoof_env.dynamics.layout import (
    MAX_STATE,
    LegState,
    Moving,
    TrunkState,
)
from hoof_env.dynamics.memory import Memory
from hoof_env.dynamics.parts import Mechanics
from hoof_env.errors import Floats, ParameterError, finite
from hoof_env.gait import FilterSettings

STATE = ("trunk", "limbs", "strides", "command", "account", "trunk_settings", "limb_settings")
"""Names of the arrays of a state."""

_MOVING = TrunkState.rows("moving").start
_PLACES = [
    _MOVING + row for name in ("centre", "pitch") for row in range(*Moving.rows(name).indices(Moving.size))
]
_ANGLES = LegState.rows("crank_angle")
_FIRST_ROW = layout.LegSettings.rows("first_row")


def read_state(
    expected: dict[str, Any], memory: Memory, state: Any
) -> tuple[dict[str, Floats], NDArray[np.bool_]]:
    """Return the arrays of a state by the names of `STATE`, and a mask of the environments that were ever
    reset in it. `expected` is the layout of the engine; see `TrunkEngine.set_state` for
    errors."""
    parts = (*STATE, "layout")
    missing = sorted(set(parts) - set(state)) if isinstance(state, Mapping) else parts
    if missing or not isinstance(state["layout"], Mapping):
        lack = ", ".join(missing) or "a mapping as layout"
        raise ParameterError(f"state: expected what get_state returns, but {lack} is missing")
    if unlike := _differences(expected, dict(state["layout"])):
        raise ParameterError(f"state: made by another engine; {unlike}")
    arrays = {}
    for name in STATE:
        shape = getattr(memory, name).shape
        try:
            arrays[name] = np.asarray(state[name], np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"state[{name!r}]: expected numbers, got {state[name]!r}") from None
        if arrays[name].shape != shape:
            raise ParameterError(f"state[{name!r}]: expected shape {shape}, got {arrays[name].shape}")
    reset = _check_numbers("state", arrays)
    # `first_row` addresses the tables: never taken from outside; a copy, because the array is the caller's
    arrays["limb_settings"] = arrays["limb_settings"].copy()
    arrays["limb_settings"][:, _FIRST_ROW] = memory.limb_settings[:, _FIRST_ROW]
    return arrays, reset


def check_column(column: Memory, settings: Floats) -> None:
    """Check a column as `read_state` checks a state, and set the rows that address the legs' tables from an
    engine's `settings` of legs."""
    _check_numbers("column", {name: getattr(column, name) for name in STATE})
    column.limb_settings[:, _FIRST_ROW] = settings[:, _FIRST_ROW]


def _check_numbers(title: str, arrays: Mapping[str, Floats]) -> NDArray[np.bool_]:
    """Return a mask of the environments that were ever reset. Raise `ParameterError` if one of their numbers
    is not finite, or a place or an angle is too large for the tables."""
    trunk = arrays["trunk"]
    limbs = arrays["limbs"]
    reset: NDArray[np.bool_] = np.ones(trunk.shape[-1], bool)
    places = trunk[_PLACES], limbs[:, _ANGLES]
    squares = sum(float(np.vdot(part, part)) for part in arrays.values())
    farthest = max(float(np.vdot(part, part)) for part in places)
    # two sums of squares are a fast check; only if it fails each array is searched
    if not (math.isfinite(squares) and farthest <= MAX_STATE**2):
        reset = np.logical_not(np.isnan(trunk).all(0) & np.isnan(limbs).all((0, 1)))
        for name in STATE:
            finite(f"{title}[{name!r}]", arrays[name][..., reset])
        finite(f"{title}['trunk'], places and pitch", places[0][:, reset], MAX_STATE)
        finite(f"{title}['limbs'], crank angles", places[1][..., reset], MAX_STATE)
    return reset


def identity_of(scene: Mechanics, filters: FilterSettings, **numbers: float) -> dict[str, Any]:
    """Return all settings on which the bits of a run depend, by name, as values that JSON can hold."""
    identity: dict[str, Any] = {**numbers, "integrator": scene.integrator}
    for name, part in (("trunk", scene.trunk), ("ground", scene.ground), ("filters", filters)):
        identity |= {f"{name}.{key}": value for key, value in asdict(part).items()}
    identity["terrain"] = _digest(scene.terrain.to_dict())
    # settings at their default are left out, as in states from before the setting existed
    if scene.trunk.length is None:
        del identity["trunk.length"]
    if scene.features.harmonics > 1:
        identity["harmonics"] = scene.features.harmonics
    if scene.motion_limits:
        identity["limits"] = repr(scene.motion_limits)
    for i, limb in enumerate(scene.limbs):
        shape = limb.geometry.to_dict()
        identity |= {f"limbs[{i}].hip": list(limb.hip), f"limbs[{i}].drive": repr(limb.drive)}
        if limb.spring:
            identity[f"limbs[{i}].spring"] = repr(limb.spring)
        identity[f"limbs[{i}].geometry"] = _digest(
            {key: value for key, value in shape.items() if key not in ("name", "provenance")}
        )
    return identity


def _differences(expected: dict[str, Any], given: dict[str, Any]) -> str:
    """Return a list of the differences of two layouts, as text; empty if they are equal."""
    if expected == given:
        return ""
    names = [name for name in {**expected, **given} if expected.get(name) != given.get(name)]
    return "; ".join(f"{name}: expected {expected.get(name)!r}, got {given.get(name)!r}" for name in names)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
