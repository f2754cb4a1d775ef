"""States of `TrunkEngine`: where it starts, and whether a state that was kept fits it and can be gone on
from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics.layout import FARTHEST, LegSettings, LegState, Moving, TrunkState
from hoof_env.dynamics.memory import Memory
from hoof_env.dynamics.parts import FREE, RAIL, SUSPENDED, TRUNKS, Motor
from hoof_env.errors import Floats, ParameterError, all_of, finite, spread
from hoof_env.gait.gait import GaitParameters

if TYPE_CHECKING:
    from hoof_env.dynamics.engine import TrunkEngine


def which(envs: ArrayLike | None, num_envs: int) -> NDArray[np.int64]:
    """Environments of `num_envs` as indices; they are given as such, as a mask, or as None for all.

    Raises:
        ParameterError: neither, or there is no such environment.
    """
    if envs is None:
        return np.arange(num_envs)
    given = np.asarray(envs)
    if given.dtype == bool and given.shape == (num_envs,):
        return np.flatnonzero(given)
    if given.shape == (0,):
        return np.arange(0)
    if given.dtype.kind in "iu" and given.ndim == 1 and np.all((given >= 0) & (given < num_envs)):
        return given.astype(np.int64)
    raise ParameterError(
        f"envs: expected indices below {num_envs} or a mask of shape ({num_envs},), got {envs!r}"
    )


def gaits_of(gaits: Any, legs: int, n: int) -> Floats:
    """Gait parameters, given as numbers or as `GaitParameters` for all legs or each, as numbers of shape
    (legs, 4, n).

    Raises:
        ParameterError: not as many as legs, of another shape or type, or beyond `FARTHEST`.
    """
    if isinstance(gaits, np.ndarray):
        given = finite("gaits", gaits, FARTHEST)
        if given.shape != (legs, 4, n):
            raise ParameterError(f"gaits: expected shape {(legs, 4, n)}, got {given.shape}")
        return given
    each = all_of("gaits", [gaits] * legs if isinstance(gaits, GaitParameters) else gaits, GaitParameters)
    if len(each) != legs:
        raise ParameterError(f"gaits: expected one or {legs}, got {len(each)}")
    return np.repeat(np.array([gait.to_array() for gait in each])[:, :, None], n, 2)


def start(
    engine: TrunkEngine,
    gaits: Floats,
    theta: ArrayLike,
    theta_rate: ArrayLike | None,
    trunk: Mapping[str, ArrayLike],
    n: int,
) -> tuple[Floats, Floats]:
    """State of `n` environments with filters at rest: of the trunk, shape (7, n), and legs, (legs, 16, n).

    In the place of centre of mass, momentum and spin of all are the trunk's place, velocity and rate of
    pitch: the kernels make the one of the other (`mechanics.settle`).

    Args:
        engine: that is to start.
        gaits: gait parameters of each leg, shape (legs, 4, n).
        theta, theta_rate: as in `TrunkEngine.reset`.
        trunk: x, y, pitch, vx, vy, pitch_rate there.

    Raises:
        ParameterError: as there.
    """
    legs = len(engine.limbs)
    angle = spread("theta", theta, (legs, n), FARTHEST)
    spin = spread("theta_rate", gaits[:, 0] if theta_rate is None else theta_rate, (legs, n), FARTHEST)
    for i, limb in enumerate(engine.limbs):
        if not isinstance(limb.drive, Motor) and (spin[i] != gaits[i, 0]).any():
            raise ParameterError(
                f"theta_rate: leg {i} is prescribed to turn at {gaits[i, 0]} rad/s, got {spin[i]}"
            )
        turns = limb.geometry.full_turn  # then its links have a place everywhere
        if not turns and not np.isfinite(engine.profiles[i](angle[i])[0]).all():
            raise ParameterError(f"theta: the links of leg {i} have no place at some of {angle[i]} rad")
    at = {name: spread(name, value, (n,), FARTHEST) for name, value in trunk.items()}
    kind = TRUNKS.index(engine.trunk.kind)
    for name, kinds in (
        ("vx", (RAIL, SUSPENDED, FREE)), ("vy", (SUSPENDED, FREE)), ("pitch", (FREE,)),
        ("pitch_rate", (FREE,)),
    ):  # fmt: skip
        if kind not in kinds and at[name].any():
            raise ParameterError(f"{name}: expected 0 of a {engine.trunk.kind} trunk, got {at[name]}")
    if kind <= RAIL and (at["y"] != engine.trunk.height).any():
        raise ParameterError(f"y: a {engine.trunk.kind} trunk is at {engine.trunk.height:g} m, got {at['y']}")
    state = np.zeros((TrunkState.size, n))
    moving = state[TrunkState.rows("moving")]  # the kernels make of these what they integrate
    moving[Moving.rows("centre")], moving[Moving.rows("momentum")] = (at["x"], at["y"]), (at["vx"], at["vy"])
    moving[Moving.rows("pitch")], moving[Moving.rows("spin")] = at["pitch"], at["pitch_rate"]
    leg = np.zeros((legs, LegState.size, n))
    leg[:, LegState.rows("theta")], leg[:, LegState.rows("theta_rate")] = angle[:, None], spin[:, None]
    leg[:, LegState.rows("gait")] = gaits
    return state, leg


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
