"""Conversion of settings to parts of the engine: ground, drives and springs, and the physical
parameters that are drawn for each episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hoof_env.dynamics.parts import Drive, HoofSpring, Motor, Prescribed
from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.leg.presets import preset_error_type, preset_label, read_preset
from hoof_env.tasks.settings import PER_EPISODE, SOLVERS, ResolvedSettings, Settings, check_effect

BOUNDS = {
    "trunk_mass": (1e-6, 1e6),
    "trunk_stiffness": (0.0, 1e12),
    "trunk_damping": (0.0, 1e12),
    "trunk_drag": (0.0, 1e12),
    "hoof_stiffness": (1.0, 1e12),
    "hoof_damping": (1e-6, 1e12),
}
"""Lowest and highest value of what carries the leg, in its unit: far beyond any animal, and such that a step
that ground and springs allow exists and every number of an episode is finite."""

MAX_SUBSTEPS = 100_000  # largest number of substeps of a control step


def resolved(settings: Settings) -> ResolvedSettings:
    """Return the settings with defaults in place of None: the preset's ground, the solver's scheme and step.

    Raises:
        ParameterError: an unknown solver, or a value beyond `BOUNDS`.
        Exception: the preset has no ground and the settings lack one; of the type of the preset's errors.
    """
    is_paper = check_choice("solver", settings.solver, SOLVERS) == "paper"
    values = dict(vars(settings))
    for name, (low, high) in BOUNDS.items():
        if values[name] is not None:
            check_number(name, values[name], low=low, high=high)
    if settings.stiffness is None or settings.exponent is None:
        if "ground" not in read_preset(settings.preset):
            raise preset_error_type(settings.preset)(
                f"{preset_label(settings.preset)}: expected an entry 'ground' with the stiffness and the"
                " exponent that its gaits are for ({} for the defaults of hoof_env.Ground), or both as"
                f" arguments; got stiffness={settings.stiffness!r}, exponent={settings.exponent!r}"
            )
        ground = load_ground(settings.preset, stiffness=settings.stiffness, exponent=settings.exponent)
        values |= {"stiffness": ground.stiffness, "exponent": ground.exponent}
    if settings.integrator is None:
        values["integrator"] = "euler" if is_paper else "midpoint"
    if settings.sim_dt is None:
        values["sim_dt"] = 1e-3 if is_paper else 1e-4
    return ResolvedSettings(**values)


def check_range(
    name: str, value: Any, low: float, high: float = 1e6, *, or_one: bool = True
) -> tuple[float, float]:
    """Check a range of numbers.

    Args:
        name: name of the argument in messages.
        value: two numbers in ascending order, or one number for both if `or_one`.
        low, high: bounds of both numbers.
        or_one: True if one number is accepted.

    Raises:
        ParameterError: a value of another form.
    """
    if or_one and not isinstance(value, (list, tuple)):
        value = value, value
    try:
        first, last = value
    except (TypeError, ValueError):
        raise ParameterError(f"{name}: expected two numbers, got {brief(value)}") from None
    first = check_number(f"{name}[0]", first, low=low, high=high)
    return first, check_number(f"{name}[1]", last, low=first, high=high)


def substeps_of(dt: float, sim_dt: float) -> int:
    """Return the number of substeps of `sim_dt` [s] in a control step of `dt` [s].

    Raises:
        ParameterError: the ratio is not a whole number, or above `MAX_SUBSTEPS`.
    """
    check_number("sim_dt", sim_dt, low=0, exclusive_low=True)
    check_number("dt", dt, low=0, exclusive_low=True)
    # With a tolerance: 0.02 / 0.001 is not a whole number in binary.
    ratio = dt / sim_dt
    if not 0.5 < ratio <= MAX_SUBSTEPS or abs(ratio - round(ratio)) > 1e-6:
        raise ParameterError(
            f"dt: expected a whole multiple of sim_dt = {sim_dt:g} s, got {dt:g} s "
            f"(ratio {ratio:g}; at most {MAX_SUBSTEPS})"
        )
    return round(ratio)


def ground_of(s: ResolvedSettings, mass: float) -> Ground:
    """Make the ground from `resolved` settings, under a trunk of a mass [kg]."""
    return Ground(
        s.stiffness,
        s.exponent,
        s.normal_law,
        s.restitution,
        s.approach_floor,
        # The paper takes the approach speed at the first step inside the ground.
        "sampled" if s.solver == "paper" else "interpolated",
        s.friction_law,
        s.friction,
        s.friction_slow,
        s.friction_fast,
        mass,
    )


def drive_of(s: Settings) -> Drive:
    """Make the drive of the cranks from settings."""
    if s.drive == "prescribed":
        return Prescribed()
    # The settings describe the motor at the crank: a gear ratio of 1.
    return Motor(s.motor_gain, s.motor_torque, s.motor_inertia, 1.0)


MAX_HOOF_LENGTH = 1.0
"""Largest length of a hoof's spring [m]."""


def hoof_spring(settings: Settings) -> HoofSpring | None:
    """Make the spring at toe and heel, or None for a rigid hoof. The default damping is a tenth of critical
    damping under the trunk mass of the settings, even if a reset draws another mass.

    Raises:
        ParameterError: a value is out of range, or there is a damping without a stiffness.
    """
    stiffness = settings.hoof_stiffness
    damping = settings.hoof_damping
    if stiffness is None:
        if damping is not None:
            raise ParameterError(
                f"hoof_damping: expected a hoof_stiffness with it, got {brief(damping)}; a rigid hoof has"
                " hoof_stiffness=None, hoof_damping=None and hoof_length=0"
            )
        return None
    check_number("hoof_stiffness", stiffness, low=0, exclusive_low=True)
    length = check_number("hoof_length", settings.hoof_length, low=0, high=MAX_HOOF_LENGTH)
    if damping is None:
        return replace(HoofSpring.with_ratio(stiffness, settings.trunk_mass), length=length)
    check_number("hoof_damping", damping, low=0, exclusive_low=True)
    return HoofSpring(stiffness, damping, length=length)


def check_parameters(name: str, given: Any, settings: Settings) -> dict[str, float | tuple[float, float]]:
    """Check physical parameters of an episode, each a number or a range to draw from.

    Args:
        name: name of the argument in messages.
        given: parameters by name.
        settings: settings of the environment.

    Raises:
        ParameterError: a parameter is unknown, cannot change, has no effect with the settings, or is neither
            a finite number nor a range in ascending order.
    """
    if not isinstance(given, Mapping) or not set(given) <= set(PER_EPISODE):
        raise ParameterError(
            f"{name}: expected a mapping with some of {', '.join(PER_EPISODE)}, got {brief(given)}"
        )
    for key in given:
        check_effect(key, settings, name)
    checked: dict[str, float | tuple[float, float]] = {}
    for key, value in given.items():
        if isinstance(value, (list, tuple)):
            if len(value) != 2:
                raise ParameterError(f"{name}[{key!r}]: expected a number or two, got {brief(value)}")
            low, high = (check_number(f"{name}[{key!r}][{k}]", v) for k, v in enumerate(value))
            if low > high:
                raise ParameterError(f"{name}[{key!r}]: expected the lower one first, got {brief(value)}")
            checked[key] = low, high
        else:
            low = high = checked[key] = check_number(f"{name}[{key!r}]", value)
        for end in (low, high):
            least, most = BOUNDS.get(key, (-np.inf, np.inf))
            check_number(f"{name}: {key}", end, low=least, high=most)
    return checked


def extremes(given: Mapping[str, float | tuple[float, float]]) -> list[dict[str, float]]:
    """Return the corners of the ranges that can be invalid or need short steps: all lowest, all highest,
    closest friction thresholds, and the stiffest contact under a light and a heavy trunk."""
    # Not all 2^n corners: these few bound the limits of the step.
    pairs = {name: value if isinstance(value, tuple) else (value, value) for name, value in given.items()}
    low, high = ({name: ends[k] for name, ends in pairs.items()} for k in (0, 1))

    def mixed(base: dict[str, float], other: dict[str, float], *names: str) -> dict[str, float]:
        """Return a corner with some parameters of another corner."""
        return base | {name: other[name] for name in names if name in other}

    # The lower threshold at its highest, the upper one at its lowest: they may cross.
    close = mixed(low, high, "friction_slow")
    # A low restitution and a low approach floor give the strongest damping.
    hard = mixed(high, low, "restitution", "approach_floor", "trunk_mass")
    corners = (low, high, close, hard, mixed(hard, high, "trunk_mass"))
    return [corner for k, corner in enumerate(corners) if corner not in corners[:k]]


def draw_parameters(
    given: Mapping[str, float | tuple[float, float]], generator: np.random.Generator
) -> dict[str, float]:
    """Draw a value for each parameter that is a range; return all values by name."""
    return {
        name: float(generator.uniform(*value)) if isinstance(value, tuple) else value
        for name, value in given.items()
    }
