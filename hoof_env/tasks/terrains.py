"""Terrains of the setting `terrain`: slopes, hills and ditches, and how far ground may drift from y = 0."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.ground.terrain import MAX_KNOTS, Terrain
from hoof_env.tasks.parameters import check_range

Floats = NDArray[np.float64]

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
        if isinstance(description, Mapping) and description.get("kind") == "ditches":
            raise ParameterError(
                "terrain: expected shallower or narrower ditches, or longer gaps, whose mean height over"
                f" {STRETCH:g} m stays within {most:.3g} m of 0 under a {trunk} trunk,"
                f" {DRIFT_REASONS[trunk]}; got {mean:.3g} m around x = {where:.4g} m"
            )
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


KINDS = ("ditches", "hills", "slope")
SHORTEST = 10.0  # hills and ditches [m]
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

DITCHES: dict[str, Any] = {
    "seed": 0,
    "length": 400.0,
    "depth": 0.08,
    "width": 0.3,
    "gap": (0.8, 2.5),
}
"""Defaults of `ditches`: seed; length [m]; depth [m]; width at the surface [m]; shortest and longest level
ground between two [m]."""

STEP = 0.05
"""Distance between knots of ditches, over which their sides go down [m]."""


def make_terrain(description: Any) -> Terrain:
    """Make a terrain from the setting `terrain`.

    Hills are straight from one random height to the next, each with its own slope, over patches of random
    stiffness and friction. Under a suspended trunk they must be low, because the rest of the animal does not
    follow them (`check_drift`). Ditches lie across level ground, at random distances. Both start at x = 0,
    and the same seed gives the same ones.

    Args:
        description: None for level ground, {"kind": "hills", ...} with keys of `HILLS`, {"kind": "ditches",
            ...} with keys of `DITCHES`, {"kind": "slope", "angle": rad}, or the mapping that
            `Terrain.to_dict` returns.

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
    known = {"hills": HILLS, "ditches": DITCHES, "slope": {"angle": 0.0}}[kind]
    if unknown := set(rest) - set(known):
        raise ParameterError(
            f"terrain: {kind} has no {', '.join(sorted(unknown))}; expected some of {', '.join(known)}"
        )
    if kind == "slope":
        return Terrain.slope(rest.get("angle", 0.0))
    return _hills({**HILLS, **rest}) if kind == "hills" else _ditches({**DITCHES, **rest})


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
        "length": (SHORTEST, (MAX_KNOTS - 1) * SPACING),
        "rise": (0.0, 10.0),
        "slope": (1e-3, 1.0),
        "patch": (0.2, 1e3),
        "roughness": (0.0, 10.0),
        "begin": (0.0, 100.0),
    }
    seed = _seed(values)
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


def _seed(values: Mapping[str, Any]) -> int:
    """Return the seed of a description."""
    return int(check_number("terrain['seed']", values["seed"], low=0, high=2**32))


def _ditches(values: Mapping[str, Any]) -> Terrain:
    """Make ditches from values for all keys of `DITCHES`."""
    bounds = {
        "length": (SHORTEST, (MAX_KNOTS - 1) * STEP),
        "depth": (0.0, 10.0),
        "width": (2 * STEP, 100.0),
    }
    length, depth, width = (
        check_number(f"terrain[{name!r}]", values[name], low=low, high=high)
        for name, (low, high) in bounds.items()
    )
    shortest, longest = check_range("terrain['gap']", values["gap"], STEP, 1e3, or_one=False)
    return _dig(_seed(values), length, depth, width, shortest, longest)


@lru_cache(maxsize=2)
def _dig(seed: int, length: float, depth: float, width: float, shortest: float, longest: float) -> Terrain:
    """Draw ditches, once for all environments with the same."""
    generator = np.random.default_rng(seed)
    knots = round(length / STEP) + 1
    across = round(width / STEP)
    row = np.zeros(knots)
    k = 0
    while True:
        k += max(round(generator.uniform(shortest, longest) / STEP), 1)
        # The last knot is level, and the ground beyond
        if k + across >= knots:
            break
        # The knots at which a ditch begins and ends are level
        row[k + 1 : k + across] = -depth
        k += across
    return Terrain(tuple(row.tolist()), start=0.0, spacing=STEP)
