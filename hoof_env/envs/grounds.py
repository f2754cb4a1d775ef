"""Terrains by description: plain values that an environment's arguments can hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.ground.terrain import Terrain

KINDS = ("hills", "slope")
SPACING = 0.1
"""Between knots of hills [m]."""

HILLS: dict[str, Any] = {
    "seed": 0, "length": 400.0, "rise": 0.15, "slope": 0.15, "patch": 2.0,
    "stiffness": (0.25, 4.0), "friction": (0.5, 1.5),
}  # fmt: skip
"""What `hills` takes: seed; length [m]; heights are within +-rise [m]; steepest slope [-]; mean length of a
patch [m]; ranges of the factors of stiffness and friction."""


def make_terrain(description: Any) -> Terrain:
    """A terrain from None (level), {"kind": "hills", ...}, {"kind": "slope", "angle": rad} or what
    `Terrain.to_dict` gives.

    Hills go straight from one random height to the next, each at a slope of its own, over patches of random
    stiffness and friction; the same for the same seed. They begin at x = 0. The rest of the animal, which a
    suspended trunk hangs from, does not follow them: they are low.

    Raises:
        ParameterError: an unknown kind or entry, or a bad value.
    """
    if description is None:
        return Terrain.flat()
    if not isinstance(description, Mapping):
        raise ParameterError(f"terrain: expected None or a mapping, got {description!r}")
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


def _hills(given: dict[str, Any]) -> Terrain:
    seed = int(check_number("terrain['seed']", given["seed"], low=0, high=2**32))
    length = check_number("terrain['length']", given["length"], low=10.0, high=1e5)
    rise = check_number("terrain['rise']", given["rise"], low=0.0, high=10.0)
    steepest = check_number("terrain['slope']", given["slope"], low=1e-3, high=1.0)
    patch = check_number("terrain['patch']", given["patch"], low=0.2, high=1e3)
    generator, knots = np.random.default_rng(seed), round(length / SPACING) + 1

    height, row, k = 0.0, np.zeros(knots), 1
    while k < knots:
        there, slope = generator.uniform(-rise, rise), generator.uniform(0.2, 1.0) * steepest
        many = max(round(abs(there - height) / slope / SPACING), 1)
        row[k : k + many] = np.linspace(height, there, many + 1)[1:][: knots - k]
        height, k = there, k + many
    factors = {}
    for name in ("stiffness", "friction"):
        low, high = np.log(_range(name, given[name]))
        factor, k = np.empty(knots), 0
        while k < knots:
            many = max(round(generator.exponential(patch) / SPACING), 5)
            factor[k : k + many] = np.exp(generator.uniform(low, high))
            k += many
        factors[name] = tuple(factor.tolist())
    return Terrain(tuple(row.tolist()), factors["stiffness"], factors["friction"], 0.0, SPACING)


def _range(name: str, value: Any) -> tuple[float, float]:
    try:
        low, high = value
    except (TypeError, ValueError):
        raise ParameterError(f"terrain[{name!r}]: expected two numbers, got {value!r}") from None
    low = check_number(f"terrain[{name!r}][0]", low, low=1e-3, high=1e3)
    return low, check_number(f"terrain[{name!r}][1]", high, low=low, high=1e3)
