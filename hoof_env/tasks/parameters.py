"""Conversion of settings to parts of the engine: ground, terrain, drives and springs, and the physical
parameters that are drawn for each episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from hoof_env.dynamics.parts import Drive, HoofSpring, Motor, Prescribed
from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.ground.terrain import Terrain
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


STRETCH = 10.0
DRIFT = 0.03
MAX_HILLS = 0.2
"""Limits of ground under a trunk that does not follow it: the mean height over `STRETCH` [m] stays within
`DRIFT` times the hip height of y = 0. At that height the suspension of `HorseLeg-v0` loads or unloads the leg
by 1.1 times the weight. Hills rise and fall about y = 0, so that they may be as high as `MAX_HILLS` times
the hip height."""

_KEEPS_HEIGHT = "which keeps its height in the world: the leg would climb into a wall or lose the ground"

_HEIGHT_IN_THE_WORLD = "whose height is observed and limited in the world: the episode would end on the way"

DRIFT_REASONS = {
    "suspended": _KEEPS_HEIGHT,
    "rail": _KEEPS_HEIGHT,
    "boom": _HEIGHT_IN_THE_WORLD,
    "floating": _HEIGHT_IN_THE_WORLD,
}
"""Reasons why ground must not drift from y = 0, by kinds of trunk that travel."""


def check_drift(terrain: Terrain, description: Any, trunk: str, hip_height: float) -> None:
    """Check that ground stays near the height at which a trunk expects it.

    Args:
        terrain: terrain.
        description: setting `terrain` that describes it.
        trunk: kind of trunk.
        hip_height: nominal height of the trunk [m].

    Raises:
        ParameterError: the ground drifts too far from y = 0.
    """
    if trunk not in DRIFT_REASONS or terrain == Terrain.flat():
        return
    remedy = (
        f"under a {trunk} trunk, {DRIFT_REASONS[trunk]}; slopes are for hoof_env/Horse-v0, whose trunk"
        " follows them"
    )
    if isinstance(description, Mapping) and description.get("kind") == "hills":
        hills = {**HILLS, **description}
        rise = float(hills["rise"] + hills["roughness"]) * max(float(hills["begin"]), 1.0)
        most = MAX_HILLS * hip_height
        if rise > most:
            raise ParameterError(f"terrain['rise']: expected at most {most:.3g} m {remedy}; got {rise:.3g} m")
        return
    where, mean = farthest_mean(terrain, STRETCH)
    if abs(mean) > (most := DRIFT * hip_height):
        raise ParameterError(
            f"terrain: expected ground whose mean height over {STRETCH:g} m stays within {most:.3g} m of 0"
            f" {remedy}; got a mean of {mean:.3g} m around x = {where:.4g} m"
        )


def farthest_mean(terrain: Terrain, stretch: float) -> tuple[float, float]:
    """Return the mean height over a stretch of ground that is farthest from 0 [m], and x of its middle [m].

    Args:
        terrain: terrain.
        stretch: length of the stretches [m], which begin, end or have their middle at a knot or halfway
            between two knots.
    """
    x = terrain.x
    height = np.array(terrain.height)
    areas = np.concatenate([[0.0], np.cumsum((height[1:] + height[:-1]) / 2 * terrain.spacing)])

    def area_to(to: Any) -> Any:
        """Return the integral of the height from the first knot to an x [m^2]."""
        # Beyond its ends the terrain is level.
        inside = np.clip(to, x[0], x[-1])
        k = np.minimum(((inside - x[0]) / terrain.spacing).astype(int), len(x) - 1)
        level = np.minimum(to - x[0], 0.0) * height[0] + np.maximum(to - x[-1], 0.0) * height[-1]
        return areas[k] + (height[k] + terrain.height_at(inside)) / 2 * (inside - x[k]) + level

    middles = np.concatenate([x, x[0] + terrain.spacing * np.arange(0.5, len(x) - 1)])
    middles = np.concatenate([middles, middles - stretch / 2, middles + stretch / 2])
    means = (area_to(middles + stretch / 2) - area_to(middles - stretch / 2)) / stretch
    farthest = int(np.argmax(np.abs(means)))
    return float(middles[farthest]), float(means[farthest])


KINDS = ("hills", "slope")
SPACING = 0.1  # between knots of hills [m]

HILLS: dict[str, Any] = {
    "seed": 0,
    "length": 400.0,
    "rise": 0.15,
    "slope": 0.15,
    "patch": 2.0,
    "stiffness": (0.25, 4.0),
    "friction": (0.5, 1.5),
    "roughness": 0.0,
    "begin": 1.0,
}
"""Defaults of `hills`: seed; length [m]; largest absolute height [m]; steepest slope [-]; mean length of a
patch [m]; ranges of the factors of stiffness and friction; largest height of bumps on the hills [m]; factor
of all heights at the start, which rises linearly to 1 at the end [-]."""

BUMPS = 0.5
"""Distance of the random heights of bumps, between which the ground is straight [m]."""


def make_terrain(description: Any) -> Terrain:
    """Make a terrain from the setting `terrain`.

    Hills are straight from one random height to the next, each with its own slope, over patches of random
    stiffness and friction. The same seed gives the same hills. They start at x = 0. Under a suspended trunk
    they must be low, because the rest of the animal does not follow them (`check_drift`).

    Args:
        description: None for level ground, {"kind": "hills", ...} with keys of `HILLS`, {"kind": "slope",
            "angle": rad}, or the mapping that `Terrain.to_dict` returns.

    Raises:
        ParameterError: a value of another form.
    """
    if description is None:
        return Terrain.flat()
    if not isinstance(description, Mapping):
        raise ParameterError(f"terrain: expected None, a Terrain or a mapping, got {brief(description)}")
    if "kind" not in description:
        return Terrain.from_dict(description)
    rest = dict(description)
    kind = check_choice("terrain['kind']", rest.pop("kind"), KINDS)
    known = {"angle": 0.0} if kind == "slope" else HILLS
    if unknown := set(rest) - set(known):
        raise ParameterError(
            f"terrain: {kind} has no {', '.join(sorted(unknown))}; expected some of {', '.join(known)}"
        )
    if kind == "slope":
        return Terrain.slope(rest.get("angle", 0.0))
    return _hills({**HILLS, **rest})


class _Hills(NamedTuple):
    """Numbers from which hills are drawn, the keys of `HILLS`."""

    seed: int
    length: float
    rise: float
    slope: float
    patch: float
    roughness: float
    begin: float
    stiffness: tuple[float, float]
    friction: tuple[float, float]


def _hills(values: dict[str, Any]) -> Terrain:
    """Make hills from values for all keys of `HILLS`."""
    bounds = {
        "length": (10.0, 1e5),
        "rise": (0.0, 10.0),
        "slope": (1e-3, 1.0),
        "patch": (0.2, 1e3),
        "roughness": (0.0, 10.0),
        "begin": (0.0, 100.0),
    }
    seed = int(check_number("terrain['seed']", values["seed"], low=0, high=2**32))
    numbers: dict[str, Any] = {
        name: check_number(f"terrain[{name!r}]", values[name], low=low, high=high)
        for name, (low, high) in bounds.items()
    }
    ranges: dict[str, Any] = {
        name: check_range(f"terrain[{name!r}]", values[name], 1e-3, 1e3, or_one=False)
        for name in ("stiffness", "friction")
    }
    return _draw(_Hills(seed, **numbers, **ranges))


# A few only: the longest hills take a hundred megabytes
@lru_cache(maxsize=2)
def _draw(hills: _Hills) -> Terrain:
    """Draw hills, once for all environments with the same."""
    generator = np.random.default_rng(hills.seed)
    knots = round(hills.length / SPACING) + 1
    height = 0.0
    row = np.zeros(knots)
    k = 1
    # Results of a seed depend on the order of the draws.
    while k < knots:
        target = generator.uniform(-hills.rise, hills.rise)
        slope = generator.uniform(0.2, 1.0) * hills.slope
        count = max(round(abs(target - height) / slope / SPACING), 1)
        row[k : k + count] = np.linspace(height, target, count + 1)[1:][: knots - k]
        height = target
        k = k + count
    factors = []
    for spread in (hills.stiffness, hills.friction):
        # Uniform in the logarithm: half as stiff is as likely as twice as stiff.
        low, high = np.log(spread)
        factor = np.empty(knots)
        k = 0
        while k < knots:
            count = max(round(generator.exponential(hills.patch) / SPACING), 5)
            factor[k : k + count] = np.exp(generator.uniform(low, high))
            k += count
        factors.append(tuple(factor.tolist()))
    if hills.roughness:
        each = round(BUMPS / SPACING)
        bumps = hills.roughness * generator.uniform(-1.0, 1.0, knots // each + 2)
        row += np.interp(np.arange(knots), each * np.arange(len(bumps)), bumps)
    row *= np.linspace(hills.begin, 1.0, knots)
    stiffness, friction = factors
    return Terrain(tuple(row.tolist()), stiffness, friction, 0.0, SPACING)
