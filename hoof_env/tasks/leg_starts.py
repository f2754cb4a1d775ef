"""Starts of episodes of one leg: drawn at random, or set by the reset options."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics.parts import Trunk
from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.gait import GaitParameters, gait_array, paper_gaits
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.profile import LegProfile, by_name
from hoof_env.tasks.disturbances import MAX_STRENGTH
from hoof_env.tasks.parameters import check_parameters, check_range
from hoof_env.tasks.settings import Settings

Floats = NDArray[np.float64]

MIN_HEIGHT = 0.6
MAX_HEIGHT = 2.0
"""Heights of the trunk at which an episode fails, divided by its nominal height [-]."""

START_SPEED = 1.0
"""Highest forward speed at reset [m/s]: learners meet both standing and moving starts."""

OPTIONS = {
    "crank_angle": (-1e6, 1e6),
    "speed": (-20.0, 20.0),
    "height": (0.0, np.inf),
    "x": (-1e5, 1e5),
    "target_speed": (-20.0, 20.0),
    "strength": (0.0, MAX_STRENGTH),
}
"""Numeric reset options and their ranges [rad, m/s, m, m, m/s, -]; "gait", "parameters" and "pushes" are
not numeric."""

RANGES = ("crank_angle", "speed", "height", "x")
"""Options that may be a range, from which each start draws."""

# Minari passes its option on to the environment.
FOREIGN_OPTIONS = ("minari_autoseed",)
"""Options of other libraries, which are ignored."""

RISING = ("suspended", "boom", "floating")
"""Kinds of trunk that move up and down."""


class UsualRange(tuple[float, float]):
    """Range of a task's own starts, from which a height that puts a hoof into the ground is raised."""


FLAT = Terrain.flat()
MARGIN = 50.0
REACH = 1.0
"""Level ground; least distance of a start from the ends of a terrain [m], as an episode travels; largest
distance from O, forward and back, at which a hoof can touch down [m]."""

MAX_TRIES = 100  # draws of a crank angle until the hoof is above the ground
ANGLES = 72  # crank angles at which a start is looked at before it is drawn


@dataclass
class Start:
    """Starts of n episodes.

    Attributes:
        values: numbers by which infos describe a start, by name, shape (n,).
        gaits: numbers by which infos describe the gait, shape (n, numbers).
        commands: commands of the engine, shape (legs, gait parameters, n).
        theta: crank angles [rad], shape (legs, n).
        trunk: arguments of `TrunkEngine.reset` by name, shape (n,).
    """

    values: dict[str, Floats]
    gaits: Floats
    commands: Floats
    theta: Floats
    trunk: dict[str, Floats]


def hoof_points(
    profile: LegProfile, gaits: Floats, theta: Floats, turn: ArrayLike = 0.0
) -> tuple[Floats, Floats]:
    """Return x and y of toe and heel relative to O [m], shape (2, n) each.

    Args:
        profile: functions of the crank angle of the leg.
        gaits: parameters of steady gaits, shape (n, 2 + 2 harmonics).
        theta: crank angles [rad], shape (n,).
        turn: further angle of the leg's frame, such as the trunk's pitch [rad].
    """
    phi: Floats = gaits[:, 1] + gaits[:, 2] * np.sin(theta) + gaits[:, 3] * np.cos(theta) + np.asarray(turn)
    for k in range(2, gaits.shape[1] // 2):
        phi = phi + gaits[:, 2 * k] * np.sin(k * theta) + gaits[:, 2 * k + 1] * np.cos(k * theta)
    # A leg that travels towards -x is mirrored; see `Geometry.travel`.
    sine = profile.geometry.travel * np.sin(phi)
    cosine = np.cos(phi)
    f = by_name(profile(theta)[0])
    places = [(f[f"{point}_x"], f[f"{point}_y"]) for point in ("toe", "heel")]
    return (
        np.array([cosine * x - sine * y for x, y in places]),
        np.array([sine * x + cosine * y for x, y in places]),
    )


def hoof_height(profile: LegProfile, gaits: Floats, theta: Floats) -> Floats:
    """Return the height of the lower hoof point relative to O [m], shape (n,); see `hoof_points`."""
    return hoof_points(profile, gaits, theta)[1].min(0)


def draw_starts(
    options: Mapping[str, Any],
    generators: Sequence[np.random.Generator],
    profile: LegProfile,
    trunk: Trunk,
    gaits: Mapping[str, GaitParameters],
    terrain: Terrain,
    own_gait: GaitParameters | None = None,
    hoof_length: float = 0.0,
) -> Start:
    """Draw random starts, one for each generator. Options set values, or ranges to draw from (see
    `check_options`).

    No episode starts with a hoof inside the ground: a trunk that moves up and down starts higher instead. The
    crank angle is drawn again under any other trunk, and where the trunk would start so high that the episode
    fails. Heights of reset options are taken as they are.

    Args:
        options: checked reset options.
        generators: generators of the episodes.
        profile: functions of the crank angle of the leg.
        trunk: trunk of the engine.
        gaits: gaits of the preset by name, walk and run among them.
        terrain: the episode starts anywhere on it except near its ends; at 0 if it is level, short, or a
            single slope, which would leave the height at which a trunk is suspended.
        own_gait: gait of all starts; None for one between walk and run.
        hoof_length: distance of the soles below the leg's hoof points [m].
    """
    n = len(generators)
    # Always three numbers, so that an option does not change the remaining draws.
    drawn = np.array([generator.random(3) for generator in generators])
    ends = [end.to_array() for end in paper_gaits(gaits).values()]
    mixed = ends[0] + drawn[:, :1] * (ends[-1] - ends[0])
    fixed = options.get("gait") or own_gait
    chosen = np.repeat(fixed.to_array()[None], n, 0) if fixed else mixed
    turn = options.get("crank_angle", (0.0, 2 * np.pi))
    theta = _between(turn, drawn[:, 1])
    rolling = (0.0, 0.0 if trunk.kind == "fixed" else START_SPEED)
    speed = _between(options.get("speed", rolling), drawn[:, 2])
    further = {
        name: np.array([generator.random() for generator in generators])
        for name in ("height", "x")
        if isinstance(options.get(name), tuple)
    }
    height = _between(options.get("height", trunk.height), further.get("height", np.zeros(n)))
    x = _between(options.get("x", 0.0), further.get("x", np.zeros(n)))
    ground = np.zeros(n)
    if terrain != FLAT:
        x = start_anywhere(terrain, x, options, generators)
        ground = highest(terrain, x, REACH)
    # Ground as high as this touches a hoof point's sole.
    ground = ground + hoof_length
    is_raised = trunk.kind in RISING and is_free_height(options)
    if is_raised or (trunk.kind not in RISING and isinstance(turn, tuple)):
        most = np.full(n, MAX_HEIGHT * trunk.height) if is_raised else height
        hoof = hoof_height(profile, chosen, theta)
        # Only rows with a hoof inside the ground draw again, so that neighbours do not change a row's bits.
        for _ in range(MAX_TRIES if isinstance(turn, tuple) else 0):
            below = np.flatnonzero(most + hoof < ground)
            if not below.size:
                break
            theta[below] = _between(turn, np.array([generators[int(k)].random() for k in below]))
            hoof = hoof_height(profile, chosen, theta)
        if is_raised:
            height = np.maximum(height, ground - hoof)
    values = {"crank_angle": theta, "speed": speed, "height": height, "x": x}
    trunk_at = {"x": x, "y": height, "vx": speed}
    return Start(values, chosen, chosen.T[None], theta[None], trunk_at)


def is_free_height(options: Mapping[str, Any]) -> bool:
    """Return True if a trunk may start higher than options say: they set no height, or it is a task's own."""
    return "height" not in options or isinstance(options["height"], UsualRange)


def startable_share(
    options: Mapping[str, Any],
    profile: LegProfile,
    trunk: Trunk,
    gaits: Sequence[GaitParameters],
    hoof_length: float,
) -> float:
    """Return at what share of the crank angles of reset options an episode can start, in that of some gaits
    in which it is least [-]; see `body.Body.startable_share`."""
    low, high = np.broadcast_to(options.get("crank_angle", (0.0, 2 * np.pi)), 2)
    theta = np.linspace(low, min(high, low + 2 * np.pi), ANGLES)
    most = MAX_HEIGHT * trunk.height - hoof_length
    shares = [
        np.mean(most + hoof_height(profile, np.tile(gait.to_array(), (ANGLES, 1)), theta) > 0.0)
        for gait in gaits
    ]
    return float(min(shares))


def _between(value: float | tuple[float, float], share: Floats) -> Floats:
    """Return a value for each share, or the number at that share of a range; shape as `share`."""
    if not isinstance(value, tuple):
        return np.full(len(share), value)
    low, high = value
    return low + (high - low) * share if low else high * share


def start_anywhere(
    terrain: Terrain, x: Floats, options: Mapping[str, Any], generators: Sequence[np.random.Generator]
) -> Floats:
    """Draw places on a terrain at which episodes start [m], shape (n,); return `x` if the terrain is short or
    a single slope, or if the options set the place."""
    low = terrain.x[0] + MARGIN
    high = terrain.x[-1] - MARGIN
    if "x" not in options and low < high and len(terrain.height) > 2:
        return np.array([generator.uniform(low, high) for generator in generators])
    return x


def check_options(
    options: Any, gaits: Mapping[str, GaitParameters], trunk: Trunk, settings: Settings
) -> dict[str, Any]:
    """Check reset options of one leg; return them with numbers and the gait converted.

    Raises:
        ParameterError: an unknown option, a bad value, or one that the trunk cannot have.
    """
    checked = checked_options(options, OPTIONS, RANGES)
    _check_trunk(checked, trunk)
    if "target_speed" in checked and settings.target_speed is None:
        raise ParameterError(
            "options['target_speed']: expected none where no speed is commanded, got"
            f" {checked['target_speed']:g}; pass target_speed=2.5 to gymnasium.make to command one"
        )
    if checked.get("gait") is not None:
        checked["gait"] = _gait(checked["gait"], gaits)
    return with_parameters(checked, settings)


def checked_options(
    options: Any, numbers: Mapping[str, tuple[float, float]], ranges: Collection[str] = ()
) -> dict[str, Any]:
    """Check the names of reset options and the values of the numeric ones.

    Args:
        options: options of `reset`, or None.
        numbers: lowest and highest values of the numeric options by name.
        ranges: names of the numeric options that may be a pair, from which starts draw.

    Raises:
        ParameterError: an unknown option, or a number out of range.
    """
    known = ("gait", "parameters", *numbers, "pushes")
    if options is None:
        return {}
    if isinstance(options, Mapping):
        options = {key: value for key, value in options.items() if key not in FOREIGN_OPTIONS}
    if not isinstance(options, Mapping) or not set(options) <= set(known):
        raise ParameterError(
            f"options: expected a mapping with some of {', '.join(known)}, got {brief(options)}"
        )
    checked = dict(options)
    for name, (low, high) in numbers.items():
        given = checked.get(name)
        if name in ranges and isinstance(given, (tuple, list)):
            checked[name] = check_range(f"options[{name!r}]", given, low, high, or_one=False)
        elif name in checked:
            checked[name] = check_number(f"options[{name!r}]", given, low=low, high=high)
    return checked


def with_parameters(options: dict[str, Any], settings: Settings) -> dict[str, Any]:
    """Check the option "parameters", in place; return the options.

    Raises:
        ParameterError: see `check_parameters`.
    """
    if "parameters" in options:
        options["parameters"] = check_parameters("options['parameters']", options["parameters"], settings)
    return options


def highest(terrain: Terrain, x: Floats, reach: float) -> Floats:
    """Return the height of the highest ground within `reach` of `x` [m], shape (n,)."""
    # The ground is piecewise linear: its maximum is at an end of the interval or at a knot.
    low = x[:, None] - reach
    high = x[:, None] + reach
    first = np.ceil((low - terrain.start) / terrain.spacing)
    knots = terrain.start + terrain.spacing * (first + np.arange(int(2 * reach / terrain.spacing) + 1))
    return terrain.height_at(np.hstack([low, np.clip(knots, low, high), high])).max(1)


def _check_trunk(options: Mapping[str, Any], trunk: Trunk) -> None:
    """Check that the trunk can have the height and the speed of the options.

    Raises:
        ParameterError: it cannot.
    """
    for height in np.atleast_1d(options.get("height", trunk.height)):
        if trunk.kind not in RISING and height != trunk.height:
            raise ParameterError(
                f"options['height']: a {trunk.kind} trunk is at {trunk.height:g} m, got {height:g} m"
            )
        if not MIN_HEIGHT * trunk.height < height < MAX_HEIGHT * trunk.height:
            raise ParameterError(
                f"options['height']: expected {MIN_HEIGHT:g} to {MAX_HEIGHT:g} times {trunk.height:g} m, "
                f"outside which an episode fails, got {height:g}"
            )
    for speed in np.atleast_1d(options.get("speed", 0.0)):
        if trunk.kind == "fixed" and speed != 0.0:
            raise ParameterError(f"options['speed']: expected 0 for a fixed trunk, got {speed:g}")


def _gait(value: Any, gaits: Mapping[str, GaitParameters]) -> GaitParameters:
    """Convert the option "gait": a name, `GaitParameters`, or a mapping of their values.

    Raises:
        ParameterError: a value of another form.
    """
    if isinstance(value, GaitParameters):
        gait_array(value, 1)  # refuses harmonics that no environment of one leg takes
        return value
    if isinstance(value, str):
        return gaits[check_choice("options['gait']", value, gaits)]
    try:
        return GaitParameters(**value)
    except TypeError:
        raise ParameterError(
            f"options['gait']: expected a gait name ({', '.join(sorted(gaits))}) or a mapping of the four "
            f"gait parameters, got {brief(value)}"
        ) from None


def extreme_posture(profile: LegProfile, rests: Floats, lowest: bool) -> tuple[Floats, float]:
    """Return the posture in which the lower hoof point is highest, or lowest.

    Args:
        profile: functions of the crank angle of the leg.
        rests: gaits in which the crank stands, shape (n, 4).
        lowest: True for the lowest posture.

    Returns:
        The gait, shape (4,), and the crank angle [rad].
    """
    # A grid of 5 degrees is fine enough for a policy.
    sign = -1.0 if lowest else 1.0
    theta = np.linspace(0, 2 * math.pi, 72, endpoint=False)
    heights = sign * np.array([hoof_height(profile, np.tile(rest, (len(theta), 1)), theta) for rest in rests])
    best = heights.max(1)
    # The last of equal postures: an arbitrary choice that must not change between versions.
    k = int(np.flatnonzero(best == best.max())[-1])
    return rests[k], float(theta[int(np.argmax(heights[k]))])
