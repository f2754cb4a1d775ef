"""Every setting with its default, what callers may give for it, and beside which others it has an effect."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from enum import Enum
from pathlib import PurePath
from types import MappingProxyType
from typing import Any, TypedDict

import numpy as np
from gymnasium.vector import AutoresetMode

from hoof_env.errors import ParameterError
from hoof_env.leg.geometry import DEFAULT_PRESET, Preset

PRINTED_BETA = math.sqrt(2 * 15.0)
"""Baumgarte's beta as the paper's Table 1 prints it, sqrt(2 alpha) [1/s]; sqrt(2) alpha = 21.2 is probably
meant."""

SOLVERS = ("exact", "paper")  # the closed form, and Eq. 8 as the paper solves it


@dataclass(frozen=True)
class Settings:
    """Everything that can be set, plain values that JSON can hold; `HorseLegEnv` says what they mean."""

    preset: Preset = DEFAULT_PRESET
    gait: str | None = None
    trunk: str = "suspended"
    hip_height: float | None = None
    trunk_mass: float = 50.0
    trunk_share: float = 0.8
    trunk_stiffness: float = 12000.0
    trunk_damping: float = 1590.0
    trunk_drag: float = 20.0
    stiffness: float | None = None
    exponent: float | None = None
    normal_law: str = "lankarani-nikravesh"
    restitution: float = 0.5
    approach_floor: float = 0.1
    friction_law: str = "ambrosio"
    friction: float = 0.4
    friction_slow: float = 1e-3
    friction_fast: float = 5e-2
    hoof_stiffness: float | None = None
    hoof_damping: float | None = None
    terrain: Mapping[str, Any] | None = None
    crank_rate: float = 18.0
    swing_rate: float = 1.2
    drive: str = "prescribed"
    motor_gain: float = 100.0
    motor_torque: float = 600.0
    motor_inertia: float = 0.5
    solver: str = "exact"
    baumgarte_alpha: float = 15.0
    baumgarte_beta: float = PRINTED_BETA
    integrator: str = "midpoint"
    sim_dt: float = 1e-3
    dt: float = 0.02
    episode_seconds: float = 10.0
    target_speed: tuple[float, float] | None = (2.5, 2.5)
    target_seconds: tuple[float, float] = (2.0, 4.0)
    size: float | None = None
    harmonics: int | None = None
    filters: str | None = None
    observation: tuple[str, ...] = ("crank", "gait", "trunk", "hoof")
    reward_weights: Mapping[str, float] | None = None
    randomize: Mapping[str, Any] | None = None

    def __deepcopy__(self, memo: Any) -> Settings:
        """Itself, for nothing in it changes."""
        return self


Range = float | Sequence[float]
"""Lowest and highest, or one number for both."""


class Keywords(TypedDict, total=False):
    """Keywords of `HorseLegEnv`, beside its own: `Settings` as callers may give them."""

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
    hoof_stiffness: float | None
    hoof_damping: float | None
    terrain: Mapping[str, Any] | None
    crank_rate: float
    swing_rate: float
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
    size: float | None
    harmonics: int | None
    filters: str | None
    observation: Sequence[str]
    reward_weights: Mapping[str, float] | None
    randomize: Mapping[str, Range] | None


class VectorKeywords(Keywords, total=False):
    """Of `Sb3VecEnv`, which hands them to `HorseLegVectorEnv`."""

    num_threads: int
    autoreset_mode: AutoresetMode | str
    max_episode_steps: int | None
    render_mode: str | None
    rendered: int | None
    width: int
    height: int


SETTINGS = tuple(item.name for item in fields(Settings))

PER_EPISODE = (
    "trunk_mass", "trunk_share", "trunk_stiffness", "trunk_damping", "trunk_drag",
    "stiffness", "restitution", "approach_floor", "friction", "friction_slow", "friction_fast",
    "motor_gain", "motor_torque",
)  # fmt: skip
"""Settings that `reset(options={"parameters": ...})` and `randomize` can change for an episode."""


NEEDED: Mapping[str, tuple[str, tuple[str, ...]]] = MappingProxyType(
    dict.fromkeys(("trunk_share", "trunk_stiffness", "trunk_damping"), ("trunk", ("suspended",)))
    | {"trunk_drag": ("trunk", ("suspended", "rail")), "friction_slow": ("friction_law", ("ambrosio",))}
    | dict.fromkeys(("crank_rate", "swing_rate"), ("trunk", ("suspended", "rail", "fixed")))
    | dict.fromkeys(("motor_gain", "motor_torque", "motor_inertia"), ("drive", ("motor",)))
    | dict.fromkeys(("baumgarte_alpha", "baumgarte_beta"), ("solver", ("paper",)))
    | dict.fromkeys(("size", "harmonics", "filters"), ("trunk", ("free",)))
    | {"target_seconds": ("target_speed", ())}
)
"""Settings that have an effect only beside certain values of another one; () stands for any range."""


def check_effect(name: str, settings: Settings, within: str = "") -> None:
    """Raise `ParameterError` where a setting that somebody names, perhaps `within` another argument or
    option, has no effect beside the others."""
    if name in ("friction_law", "friction_slow", "friction_fast") and settings.hoof_stiffness is not None:
        named = f"{within}: {name!r}" if within else name
        raise ParameterError(
            f"{named}: expected none with a hoof_stiffness, whose friction needs no sliding speed, got "
            f"hoof_stiffness={settings.hoof_stiffness!r}"
        )
    needed, values = NEEDED.get(name, ("", ()))
    given: Any = getattr(settings, needed, None)
    if needed and (given not in values if values else _is_one(given)):
        good = " or ".join(f"{needed}={value!r}" for value in values) or f"a range of {needed}"
        named = f"{within}: {name!r}" if within else name
        if needed == "trunk" and "free" in (given, *values):  # which no argument changes
            who = "a horse" if given == "free" else "one leg"
            raise ParameterError(f"{named}: expected none of {who}, where it has no effect")
        raise ParameterError(
            f"{named}: expected {good} beside it, without which it has no effect, got {needed}={given!r}"
        )


def _is_one(given: Any) -> bool:
    """Whether nothing can be drawn: no range, or one whose ends are the same."""
    ends = tuple(given) if isinstance(given, Iterable) else (given, given)
    return len(ends) == 2 and bool(ends[0] == ends[1])


def to_json(settings: Settings) -> dict[str, Any]:
    """The settings as values that JSON can hold."""
    return {key: json_value(value) for key, value in asdict(settings).items()}


def as_plain(name: str, value: Any) -> Any:
    """A value as Python and JSON know it: numbers of NumPy and pandas as numbers, arrays as lists, paths as
    text, enumerations by their value.

    Raises:
        ParameterError: another kind of number, such as a tensor.
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, (np.generic, np.ndarray)) and value.dtype != object:
        return as_plain(name, value.tolist())
    if isinstance(value, Enum):
        return as_plain(name, value.value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): as_plain(f"{name}[{key!r}]", inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        plain = (as_plain(f"{name}[{k}]", inner) for k, inner in enumerate(value))
        return tuple(plain) if isinstance(value, tuple) else list(plain)
    if isinstance(value, (int, float, str)):
        return next(kind(value) for kind in (int, float, str) if isinstance(value, kind))
    if hasattr(type(value), "__float__"):
        raise ParameterError(
            f"{name}: expected a number of Python or NumPy, which JSON can hold, got {value!r}"
        )
    return value  # what takes it says what is wrong


def json_value(value: Any) -> Any:
    """Lists for tuples, however deep, as JSON gives them back."""
    if isinstance(value, (list, tuple)):
        return [json_value(inner) for inner in value]
    if isinstance(value, Mapping):
        return {key: json_value(inner) for key, inner in value.items()}
    return value
