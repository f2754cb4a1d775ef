"""States of `TrunkEngine` that were kept: which engine they fit, and whether they can be gone on from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.arguments import Floats, finite
from hoof_env.dynamics.layout import FARTHEST, LegSettings, LegState, Moving, TrunkState
from hoof_env.dynamics.trunk_model import Memory
from hoof_env.errors import ParameterError

if TYPE_CHECKING:
    from hoof_env.dynamics.trunk_engine import TrunkEngine

STATE = ("trunk", "limbs", "strides", "command", "account", "trunk_settings", "limb_settings")
"""Arrays that hold what changes."""

_FIRST_ROW = LegSettings.rows("first_row")


def read_state(
    engine: TrunkEngine, memory: Memory, state: Any
) -> tuple[dict[str, Floats], NDArray[np.bool_]]:
    """The arrays of a state by the names of `STATE`, and which environments were ever reset in it.

    Raises:
        ParameterError: as `TrunkEngine.set_state`.
    """
    parts = (*STATE, "layout")
    missing = sorted(set(parts) - set(state)) if isinstance(state, Mapping) else parts
    if missing or not isinstance(state["layout"], Mapping):
        lack = ", ".join(missing) or "a layout by name"
        raise ParameterError(f"state: expected what get_state gives, but {lack} is missing")
    if unlike := _differences(layout(engine), dict(state["layout"])):
        raise ParameterError(f"state: of another engine; {unlike}")
    arrays = {}
    for name in STATE:
        shape = getattr(memory, name).shape
        try:
            arrays[name] = np.array(state[name], dtype=np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"state[{name!r}]: expected numbers, got {state[name]!r}") from None
        if arrays[name].shape != shape:
            raise ParameterError(f"state[{name!r}]: expected shape {shape}, got {arrays[name].shape}")
    trunk, limbs = arrays["trunk"], arrays["limbs"]
    reset: NDArray[np.bool_] = np.logical_not(np.isnan(trunk).all(0) & np.isnan(limbs).all((0, 1)))
    for name in STATE:
        finite(f"state[{name!r}]", arrays[name][..., reset])
    moving = trunk[TrunkState.rows("moving")]
    for name in ("centre", "pitch"):
        finite("state['trunk'], places and pitch", moving[Moving.rows(name)][:, reset], FARTHEST)
    finite("state['limbs'], crank angles", limbs[:, LegState.rows("theta")][..., reset], FARTHEST)
    arrays["limb_settings"][:, _FIRST_ROW] = memory.limb_settings[:, _FIRST_ROW]  # an address
    return arrays, reset


def layout(engine: TrunkEngine) -> dict[str, Any]:
    """Everything on which the bits of a run depend, by name, as values that JSON can hold."""
    found: dict[str, Any] = {
        name: getattr(engine, name) for name in ("num_envs", "sim_dt", "substeps", "integrator")
    }
    for name in ("trunk", "ground", "filters"):
        found |= {f"{name}.{key}": value for key, value in asdict(getattr(engine, name)).items()}
    found["terrain"] = _digest(engine.terrain.to_dict())
    for i, limb in enumerate(engine.limbs):
        shape = {
            key: value for key, value in limb.geometry.to_dict().items() if key not in ("name", "provenance")
        }
        found |= {f"limbs[{i}].hip": list(limb.hip), f"limbs[{i}].drive": repr(limb.drive)}
        found[f"limbs[{i}].geometry"] = _digest(shape)
    return found


def _differences(expected: dict[str, Any], given: dict[str, Any]) -> str:
    """Where two layouts differ, for people; empty if nowhere."""
    names = [name for name in {**expected, **given} if expected.get(name) != given.get(name)]
    return "; ".join(f"{name}: expected {expected.get(name)!r}, got {given.get(name)!r}" for name in names)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
