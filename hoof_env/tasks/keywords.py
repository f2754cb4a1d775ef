"""Keyword arguments of the environments, for type checkers: `settings.Settings` in the types that callers may
pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from gymnasium.vector import AutoresetMode

from hoof_env.leg.geometry import Preset

Range = float | Sequence[float]
"""Lowest and highest value, or one number for both."""


class Keywords(TypedDict, total=False):
    """Keywords of `HorseLegEnv` that are settings, in the types that callers may pass."""

    # A copy by hand, because type checkers do not run code; `tests/test_typing.py` compares the two.
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
    """Keywords of `Sb3VecEnv`, which passes them to `HorseLegVectorEnv`."""

    # `task` and `num_envs` are missing here: the id and an argument of its own have them.
    num_threads: int
    autoreset_mode: AutoresetMode | str
    max_episode_steps: int | None
    render_mode: str | None
    rendered: int | None
    width: int
    height: int
