"""Keyword arguments of the environments, for type checkers: names of `tasks.Settings`, and what each takes.

`tasks.Settings` has their defaults, the manual page their meanings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from gymnasium.vector import AutoresetMode

from hoof_env.leg.geometry import Preset

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
