"""What callers give environments: the keywords and their types, and checks of what many take at once, which
name what was given and what was expected: all raise ParameterError."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from hoof_env.envs.episode import ACTIONS
from hoof_env.errors import ParameterError, count
from hoof_env.leg.geometry import Preset


def mode_of(value: Any) -> AutoresetMode:
    """An `AutoresetMode`, given as such, by its name or by its value."""
    if isinstance(value, AutoresetMode):
        return value
    known = {mode.value: mode for mode in AutoresetMode} | {mode.name: mode for mode in AutoresetMode}
    try:
        return known[value]
    except (KeyError, TypeError):
        names = ", ".join(mode.name for mode in AutoresetMode)
        raise ParameterError(f"autoreset_mode: expected one of {names}, got {value!r}") from None


def drawn_of(rendered: Any, n: int, most: int) -> int:
    """How many of `n` environments are drawn; None is all, if they are at most `most`."""
    if rendered is None and n > most:
        raise ParameterError(
            f"rendered: expected how many of the {n} environments to draw, as they are more than {most}; for"
            " Gymnasium's RecordVideo rendered=1 goes with record_first_only=True"
        )
    drawn = n if rendered is None else count("rendered", rendered)
    if drawn > n:
        raise ParameterError(f"rendered: expected at most num_envs={n}, got {drawn}")
    return drawn


def actions_of(actions: Any, n: int) -> NDArray[np.float32]:
    """Finite actions, shape (n, 4)."""
    try:
        given = np.asarray(actions)
    except ValueError:
        given = np.empty(0, object)
    if given.dtype.kind not in "fiu" or given.shape != (n, ACTIONS):
        raise ParameterError(
            f"actions: expected finite numbers in [-1, 1], shape {(n, ACTIONS)}, "
            f"got {given.dtype} of shape {given.shape}"
        )
    with np.errstate(over="ignore"):  # to infinity, which is refused
        given = given.astype(np.float32, copy=False)
    if not np.isfinite(given).all():
        rows = np.flatnonzero(~np.isfinite(given).all(1)).tolist()
        raise ParameterError(f"actions: expected finite numbers in [-1, 1], got others in rows {rows[:8]}")
    return given


def mask_of(given: Any, n: int) -> NDArray[np.bool_]:
    """The reset option "reset_mask", bool of shape (n,), not all False; None is all."""
    if given is None:
        return np.ones(n, bool)
    good = isinstance(given, np.ndarray) and given.dtype == bool and given.shape == (n,)
    if not (good and given.any()):
        raise ParameterError(
            f"options['reset_mask']: expected a bool array of shape ({n},) with at least one True, "
            f"got {given!r}"
        )
    mask: NDArray[np.bool_] = given
    return mask


def ended_of(given: Any, n: int) -> NDArray[np.bool_]:
    """A copy of which episodes of a state had ended, bool of shape (n,)."""
    try:
        ended = np.array(given)
    except ValueError:
        ended = np.empty(0, object)
    if ended.dtype != bool or ended.ndim != 1:
        raise ParameterError(f"state['ended']: expected a bool array of shape ({n},), got {given!r}")
    if ended.size != n:
        raise ParameterError(f"state: expected one of {n} environments, got one of {ended.size}")
    return ended


def seed_of(seed: Any) -> int | None:
    """A seed as Gymnasium takes it, a whole number from 0 or None."""
    return None if seed is None else count("seed", seed, low=0)


def seeds_of(seed: Any, n: int) -> list[int | None]:
    """A seed for each of `n` environments: `seed` + i, or as given; None goes on with its generator."""
    if isinstance(seed, (list, tuple, np.ndarray)):
        if len(seed) != n:
            raise ParameterError(f"seed: expected one number or {n}, got {len(seed)}")
        return [seed_of(value) for value in seed]
    if seed is None:
        return [None] * n
    return [count("seed", seed, low=0) + env for env in range(n)]


Range = float | Sequence[float]
"""Lowest and highest, or one number for both."""


class Keywords(TypedDict, total=False):
    """Of `HorseLegEnv`, beside its own."""

    preset: Preset
    gait: str | None
    trunk: str
    hip_height: float | None
    trunk_mass: float
    trunk_share: float
    trunk_stiffness: float
    trunk_damping: float
    trunk_drag: float
    stiffness: float | None
    exponent: float | None
    normal_law: str
    restitution: float
    approach_floor: float
    friction_law: str
    friction: float
    friction_slow: float
    friction_fast: float
    terrain: Mapping[str, Any] | None
    drive: str
    motor_gain: float
    motor_torque: float
    motor_inertia: float
    solver: str
    baumgarte_alpha: float
    baumgarte_beta: float
    integrator: str | None
    sim_dt: float | None
    dt: float
    episode_seconds: float
    target_speed: Range | None
    target_seconds: Range
    observation: Sequence[str]
    reward_weights: Mapping[str, float] | None
    randomize: Mapping[str, Range] | None


class VectorKeywords(Keywords, total=False):
    """Of `Sb3VecEnv`, which hands them to `HorseLegVectorEnv`."""

    autoreset_mode: AutoresetMode | str
    max_episode_steps: int | None
    render_mode: str | None
    rendered: int
