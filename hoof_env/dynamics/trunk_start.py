"""Where `TrunkEngine` starts: checks of environments, gaits, crank angles and the place and speed of the
trunk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics.arguments import Floats, all_of, finite, spread
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.layout import FARTHEST, LegState, Moving, TrunkState
from hoof_env.dynamics.trunk import FREE, RAIL, SUSPENDED, TRUNKS
from hoof_env.errors import ParameterError
from hoof_env.gait.parameters import GaitParameters

if TYPE_CHECKING:
    from hoof_env.dynamics.trunk_engine import TrunkEngine


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
    pitch: the kernels make the one of the other (`lanes.settle`).

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
