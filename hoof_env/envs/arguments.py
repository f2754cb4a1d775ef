"""What callers give environments, alone or many at once: the keywords and their types, checks that name what
was given and what was expected, states, and specs that say how long an episode lasts."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypedDict

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from hoof_env.envs.batch import EpisodeBatch
from hoof_env.envs.episode import ACTIONS
from hoof_env.envs.start import check_seed
from hoof_env.envs.tasks import PER_EPISODE, Settings
from hoof_env.errors import FixedSettingError, ParameterError, count
from hoof_env.leg.geometry import Preset


def mode_of(value: Any) -> AutoresetMode:
    """An `AutoresetMode`, given as such, by its name or by its value.

    Raises:
        ParameterError: none of these.
    """
    if isinstance(value, AutoresetMode):
        return value
    known = {mode.value: mode for mode in AutoresetMode} | {mode.name: mode for mode in AutoresetMode}
    try:
        return known[value]
    except (KeyError, TypeError):
        names = ", ".join(mode.name for mode in AutoresetMode)
        raise ParameterError(f"autoreset_mode: expected one of {names}, got {value!r}") from None


def drawn_of(rendered: Any, n: int, most: int) -> int:
    """How many of `n` environments are drawn; None is all, if they are at most `most`.

    Raises:
        ParameterError: more than there are, or more than `most` and `rendered` is None.
    """
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
    """Finite actions, shape (n, 4).

    Raises:
        ParameterError: of a wrong shape or type, or not finite.
    """
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
    """The reset option "reset_mask", shape (n,); None is all.

    Raises:
        ParameterError: another shape or type, or all False.
    """
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
    """A copy of which episodes of a state had ended, shape (n,).

    Raises:
        ParameterError: another shape or type.
    """
    try:
        ended = np.array(given)
    except ValueError:
        ended = np.empty(0, object)
    if ended.dtype != bool or ended.ndim != 1:
        raise ParameterError(f"state['ended']: expected a bool array of shape ({n},), got {given!r}")
    if ended.size != n:
        raise ParameterError(f"state: expected one of {n} environments, got one of {ended.size}")
    return ended


def seeds_of(seed: Any, n: int) -> list[int | None]:
    """A seed for each of `n` environments: `seed` + i, or as given; None goes on with the generator there is.

    Raises:
        ParameterError: not whole numbers from 0, or too few.
    """
    if isinstance(seed, (list, tuple, np.ndarray)):
        if len(seed) != n:
            raise ParameterError(f"seed: expected one number or {n}, got {len(seed)}")
        return [check_seed(value) for value in seed]
    if seed is None:
        return [None] * n
    first = count("seed", seed, low=0)
    return [first + env for env in range(n)]


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


SETTINGS = frozenset(item.name for item in fields(Settings))


def fixed_setting(name: str) -> FixedSettingError:
    """The error of an assignment to a setting, or to what follows from the settings."""
    how = "gymnasium.make(id, ...)" if name in SETTINGS else "the arguments of gymnasium.make"
    if name in PER_EPISODE:
        how += f", or reset(options={{'parameters': {{{name!r}: ...}}}}) for an episode"
    return FixedSettingError(f"{name}: expected no assignment, which would change nothing; set it by {how}")


class Made:
    """Refuses assignments that would look like a setting and change nothing; completes the spec.

    Attributes:
        batch: the episodes.
        spec: what Gymnasium made it from. `max_episode_steps` is the environment's own limit, which
            `episode_seconds` and `dt` give, unless it has one already.
    """

    batch: EpisodeBatch
    _spec: EnvSpec | None = None

    def __setattr__(self, name: str, value: Any) -> None:
        """As of any object, but for settings and what follows from them.

        Raises:
            FixedSettingError: a setting, or a property that cannot be set.
        """
        fixed = getattr(type(self), name, None)
        if name in SETTINGS or (isinstance(fixed, property) and fixed.fset is None):
            raise fixed_setting(name)
        super().__setattr__(name, value)

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """As Gymnasium's, which would otherwise set a setting that the environment lacks on a wrapper."""
        if force or name in SETTINGS or hasattr(self, name):
            setattr(self, name, value)
            return True
        return False

    @property
    def spec(self) -> EnvSpec | None:
        """The specification, None for an environment that Gymnasium did not make."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None and spec.max_episode_steps is None:
            spec = copy.copy(spec)  # it may be the registered one
            spec.max_episode_steps = self.batch.steps_per_episode
        self._spec = spec


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
