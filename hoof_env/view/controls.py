"""Controls of a page as data: groups of sliders and buttons, with units, ranges and the paper's values."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from hoof_env.errors import HoofEnvError
from hoof_env.gait import PARAMETERS
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.paper.rows import load_published
from hoof_env.policies.find import names_of
from hoof_env.tasks.settings import ABOUT, check_effect
from hoof_env.view.simulation import Simulation, unit_of

GROUPS = {
    "Ground": {
        "stiffness": "stiffness K",
        "exponent": "exponent n",
        "restitution": "restitution",
        "friction": "friction",
    },
    "Trunk and speed": {
        "trunk_mass": "trunk mass",
        "trunk_share": "share of the weight",
        "target_speed": "commanded speed",
    },
    "Motor": {
        "motor_torque": "largest torque",
        "motor_gain": "motor gain",
        "motor_inertia": "rotor inertia",
    },
}
"""Names of the settings that have sliders, by group, with their names on the page."""

GAIT = dict(zip(PARAMETERS, ("crank speed", "swing offset", "swing sine", "swing cosine"), strict=True))
"""Names of the gait's parameters on the page."""

CONDITIONS = {
    f"{gait}, {condition}": {"gait": gait, "restitution": restitution}
    for gait in ("walk", "run")
    for condition, restitution in (("elastic", 1.0), ("inelastic", 0.0))
}
"""The paper's four conditions as arguments of `HorseLegFixed-v0`."""
PAPER_ID = "hoof_env/HorseLegFixed-v0"
TURNS_ON = 600.0  # `episode_seconds` of these conditions [s]

LOGARITHMIC = 50.0
"""Least ratio of the ends of a range with a logarithmic slider."""
NOTCHES = 200  # of a slider


class Slider(NamedTuple):
    """A slider.

    Attributes:
        ask: what the page asks when it moves, "touch" or "drive".
        name, label, unit: name of the quantity, and words for it.
        low, high, step, value: as the slider has them; logarithms to base ten where `is_log`.
        is_log: True for a logarithmic slider.
        marks: the paper's values, as positions and texts.
        scale: ratio of the number that the page writes to the slider's value, see `Body.scale_of`.
    """

    ask: str
    name: str
    label: str
    unit: str
    low: float
    high: float
    step: float
    value: float
    is_log: bool
    marks: tuple[tuple[float, str], ...] = ()
    scale: float = 1.0


class Shown(NamedTuple):
    """A setting that has an effect.

    Attributes:
        group, name, label: its group on the page, its name, and words for it.
        value: present value.
        scale: ratio of the animal's own value to it, see `Body.scale_of`.
    """

    group: str
    name: str
    label: str
    value: float
    scale: float

    @property
    def text(self) -> str:
        """The animal's own value with its unit."""
        number = np.format_float_positional(float(f"{self.value * self.scale:.4g}"), trim="-")
        return f"{number} {unit_of(self.name)}".rstrip()


def shown_settings(simulation: Simulation, parameters: Mapping[str, float] | None = None) -> list[Shown]:
    """Return the settings of `GROUPS` that have an effect, with finite values.

    Args:
        simulation: simulation.
        parameters: parameters that were touched, by default as in the simulation.
    """
    env: Any = simulation.env.unwrapped
    touched = simulation.parameters if parameters is None else parameters
    found = []
    for group, labels in GROUPS.items():
        for name, label in labels.items():
            with suppress(HoofEnvError):
                check_effect(name, env.settings)
                if name == "target_speed":
                    value = simulation.commanded_speed
                else:
                    value = touched.get(name, getattr(env.resolved_settings, name))
                if value is not None and math.isfinite(value):
                    found.append(Shown(group, name, label, float(value), env.body.scale_of(name)))
    return found


def has_paper_leg(simulation: Simulation) -> bool:
    """Return True for a single leg with the paper's mechanism, to which the paper's values belong."""
    return len(simulation.legs) == 1 and simulation.setting.geometry.mechanism == PAPER


def paper_values() -> dict[str, tuple[float, ...]]:
    """Return the values that the paper prints, by setting."""
    printed = load_published().parameters
    return {
        "stiffness": (printed["stiffness"],),
        "restitution": (printed["restitution_inelastic"], printed["restitution_elastic"]),
        "friction": (printed["friction_kinetic"],),
        "crank_speed": (printed["crank_speed_rad_s"],),
    }


def slider(
    ask: str,
    name: str,
    label: str,
    value: float,
    span: tuple[float, float],
    is_marked: bool,
    step: float | None = None,
    scale: float = 1.0,
) -> Slider:
    """Make a slider over a span, extended to the present value, with the paper's values if it is marked."""
    low = min(span[0], value)
    high = max(span[1], value)
    is_log = low > 0 and high / low >= LOGARITHMIC
    place = math.log10 if is_log else float
    low, high = place(low), place(high)
    step = step or 10.0 ** math.floor(math.log10((high - low) / NOTCHES))
    marks = tuple(
        ((place(number) - low) / (high - low), f"{round(number, 3):.6g}")
        for number in paper_values().get(name, ())
        if is_marked and span[0] <= number <= span[1]
    )
    return Slider(ask, name, label, unit_of(name), low, high, step, place(value), is_log, marks, scale)


def setting_sliders(simulation: Simulation) -> dict[str, list[Slider]]:
    """Return the sliders of the settings that have an effect, by group."""
    is_marked = has_paper_leg(simulation)
    found: dict[str, list[Slider]] = {}
    for group, name, label, value, scale in shown_settings(simulation):
        span = ABOUT[name].span
        if span is not None:
            step = 0.125 if name == "exponent" else None
            made = slider("touch", name, label, value, span, is_marked, step, scale)
            found.setdefault(group, []).append(made)
    return found


def gait_sliders(simulation: Simulation) -> list[Slider]:
    """Return the sliders that drive one leg by hand."""
    now = simulation.gait_now()
    is_marked = has_paper_leg(simulation)
    limits = simulation.gait_limits.items()
    return [slider("drive", name, GAIT[name], now[name], span, is_marked) for name, span in limits]


def known_ids() -> list[str]:
    """Return the registered ids that the page offers."""
    tasks = (id for id, spec in gym.registry.items() if "hoof_env" in str(spec.entry_point))
    return sorted(tasks)


def known_policies(simulation: Simulation) -> list[str]:
    """Return the policies that the page offers: scripted ones, and those that the package has for the id."""
    return names_of(simulation.env, simulation.env_id)


def as_text(arguments: Any) -> str:
    """Return arguments of an environment as key=value pairs."""
    return " ".join(f"{key}={json.dumps(value, separators=(',', ':'))}" for key, value in arguments.items())
