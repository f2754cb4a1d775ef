"""Where an episode starts: drawn at random, or what the reset options say."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from hoof_env.dynamics.trunk import Trunk
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait.parameters import GaitParameters, paper_gaits
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose

LOWEST, HIGHEST = 0.6, 2.0
"""Heights of the trunk at which an episode fails, as parts of its nominal height."""

START_SPEED = 1.0
"""Highest forward speed at reset [m/s]: a learner meets both a standing start and a rolling one."""

OPTIONS = {"crank_angle": (-1e6, 1e6), "speed": (-20.0, 20.0), "height": (0.0, np.inf)}
"""Numeric reset options and their ranges [rad, m/s, m]; "gait" is the other one."""


class Start(NamedTuple):
    """Gait, crank angle [rad], forward speed [m/s] and height of O [m] at the start of an episode."""

    gait: GaitParameters
    crank_angle: float
    speed: float
    height: float


def hoof_height(geometry: Geometry, gait: GaitParameters, theta: float) -> float:
    """Height of the lower hoof point relative to O [m], at crank angle `theta` of a steady gait."""
    phi = gait.swing_offset + gait.swing_sin * math.sin(theta) + gait.swing_cos * math.cos(theta)
    points = pose(geometry, theta, frame=FrameMotion(phi=phi))
    return min(float(points.point("I")[1]), float(points.point("J")[1]))


def draw_start(
    options: dict[str, Any],
    generator: np.random.Generator,
    geometry: Geometry,
    trunk: Trunk,
    gaits: Mapping[str, GaitParameters],
) -> Start:
    """A random start, but for what the options fix (see `check_options`).

    No contact begins with a hoof inside the ground: a suspended trunk hangs higher where it would, on any
    other the crank angle is drawn again.
    """
    mix, turn, rolling = generator.random(3)
    ends = [end.to_array() for end in paper_gaits(gaits).values()]
    one, two = ends[0], ends[-1]
    gait = options.get("gait") or GaitParameters.from_array(one + mix * (two - one))
    theta = options.get("crank_angle", 2 * np.pi * turn)
    speed = options.get("speed", START_SPEED * rolling if trunk.kind != "fixed" else 0.0)
    height = options.get("height", trunk.height)
    if trunk.kind == "suspended":
        if not LOWEST * trunk.height < height < HIGHEST * trunk.height:
            raise ParameterError(
                f"options['height']: expected {LOWEST:g} to {HIGHEST:g} times {trunk.height:g} m, "
                f"outside which an episode fails, got {height:g}"
            )
        if "height" not in options:
            height = max(height, -hoof_height(geometry, gait, theta))
    elif "crank_angle" not in options:
        for _ in range(100):
            if height + hoof_height(geometry, gait, theta) >= 0:
                break
            theta = 2 * np.pi * generator.random()
    return Start(gait, float(theta), float(speed), float(height))


def check_options(options: Any, gaits: Mapping[str, GaitParameters]) -> dict[str, Any]:
    """Reset options with their values checked and the gait as `GaitParameters`.

    Raises:
        ParameterError: an unknown option, or a value out of range.
    """
    known = ("gait", *OPTIONS)
    if options is None:
        return {}
    if isinstance(options, Mapping):  # Minari hands its own option on to the environment
        options = {key: value for key, value in options.items() if key != "minari_autoseed"}
    if not isinstance(options, Mapping) or not set(options) <= set(known):
        raise ParameterError(f"options: expected a mapping with some of {', '.join(known)}, got {options!r}")
    checked = dict(options)
    for name, (low, high) in OPTIONS.items():
        if name in checked:
            checked[name] = check_number(f"options[{name!r}]", checked[name], low=low, high=high)
    if checked.get("gait") is not None:
        checked["gait"] = _gait(checked["gait"], gaits)
    return checked


def _gait(value: Any, gaits: Mapping[str, GaitParameters]) -> GaitParameters:
    if isinstance(value, GaitParameters):
        return value
    if isinstance(value, str):
        return gaits[check_choice("options['gait']", value, gaits)]
    try:
        return GaitParameters(**value)
    except TypeError:
        raise ParameterError(
            f"options['gait']: expected a gait name ({', '.join(sorted(gaits))}) or a mapping of the four "
            f"gait parameters, got {value!r}"
        ) from None
