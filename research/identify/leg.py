"""A leg and its two gaits as numbers: a `Choice` of what cannot vary continuously, the rest a vector x.

x holds log lengths [m], the pivot and the hip's height [m] and the swing of both gaits [rad]; see `NAMES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait.parameters import LIMITS, GaitParameters, load_gait
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import Geometry, Preset, load_geometry
from hoof_env.leg.linkage import DYADS, LENGTHS

Vector = NDArray[np.float64]

GAITS = ("walk", "run")
SIGNS = tuple(dyad.point for dyad in DYADS)
"""The points whose side of their dyad is a choice, in the order of `Choice.assembly`."""

SPEED = 2 * np.pi
"""The paper's crank speed in both gaits [rad/s]; not searched."""

_BODY = (*(f"log {name}" for name in LENGTHS), "pivot_x", "pivot_y")
_SWING = tuple(name for name in LIMITS if name != "crank_speed")

NAMES = (*_BODY, "hip_height", *(f"{gait}.{name}" for gait in GAITS for name in _SWING))
"""Names of the entries of x: log [m], m, and rad."""

BODY = len(_BODY)
"""So many first entries are the leg's own; the ground level is not among them."""

LEVEL, OFFSET = NAMES.index("hip_height"), NAMES.index("walk.swing_offset")

SCALES = np.array([1.0] * len(LENGTHS) + [0.6, 0.6, 0.5] + [0.6] * 6)
"""How far each entry of x ranges, beside one: the scales of a search."""


@dataclass(frozen=True)
class Choice:
    """What a search cannot change continuously.

    Attributes:
        assembly: +1 or -1 for each of `SIGNS`, as `Geometry.assembly`.
        toe: which hoof corner is the toe, "I" or "J"; the other is the heel.
        travel: +1 or -1, as `Geometry.travel`.
        exponent: n of Eq. 14, which the paper does not print [-].

    Raises:
        ParameterError: another value.
    """

    assembly: tuple[int, ...]
    toe: str
    travel: int
    exponent: float

    def __post_init__(self) -> None:
        if len(self.assembly) != len(SIGNS) or any(sign not in (1, -1) for sign in self.assembly):
            raise ParameterError(
                f"assembly: expected +1 or -1 for each of {', '.join(SIGNS)}, got {self.assembly!r}"
            )
        check_choice("toe", self.toe, ("I", "J"))
        if self.travel not in (1, -1):
            raise ParameterError(f"travel: expected +1 or -1, got {self.travel!r}")
        check_number("exponent", self.exponent, low=1, high=3)

    @property
    def heel(self) -> str:
        """The hoof corner that is the heel."""
        return "J" if self.toe == "I" else "I"

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Choice:
        """Inverse of `dataclasses.asdict`; KeyError or TypeError for anything else."""
        return cls(**{**data, "assembly": tuple(data["assembly"])})


def random_choice(rng: np.random.Generator, exponent: float) -> Choice:
    """A choice with every assembly, toe and travel equally likely."""
    signs = tuple(rng.choice([-1, 1], len(SIGNS)).tolist())
    return Choice(signs, str(rng.choice(["I", "J"])), int(rng.choice([-1, 1])), exponent)


def random_start(rng: np.random.Generator) -> Vector:
    """One x of a leg of a horse's size, seldom one that turns: take the best of many.

    Lengths are around 0.5 m within a factor of 1.6, the crank around 0.27 m; the swing's range covers the
    limits of the product's gaits.
    """
    crank = rng.normal(-1.3, 0.3, 1)
    links, pivot = rng.normal(-0.6, 0.5, len(LENGTHS) - 1), rng.normal(0.0, 0.7, 2)
    height, offsets = rng.uniform(1.2, 1.7, 1), rng.uniform(*LIMITS["swing_offset"], (2, 1))
    walk, run = rng.normal(0.0, 0.2, 2), rng.normal(-0.2, 0.4, 2)
    return np.concatenate([crank, links, pivot, height, offsets[0], walk, offsets[1], run])


def encode(preset: Preset, exponent: float | None = None) -> tuple[Choice, Vector]:
    """The leg and the two gaits of a preset as (choice, x), on its own ground or one with this exponent.

    Raises:
        HoofEnvError: there is no such preset, its leg does not turn, or a crank has another speed than the
            paper's.
    """
    geometry, ground = load_geometry(preset), load_ground(preset)
    gaits = {name: load_gait(name, preset) for name in GAITS}
    for name, gait in gaits.items():
        if abs(gait.crank_speed - SPEED) > 1e-9:
            raise ParameterError(
                f"{name}.crank_speed: expected the paper's {SPEED:.6f} rad/s, got {gait.crank_speed!r}"
            )
    signs = tuple(geometry.assembly[point] for point in SIGNS)
    choice = Choice(signs, geometry.toe, geometry.travel, ground.exponent if exponent is None else exponent)
    logs = [np.log(geometry.lengths[name]) for name in LENGTHS]
    swings = [value for gait in gaits.values() for value in gait.to_array()[1:]]
    return choice, np.array([*logs, *geometry.pivot, geometry.hip_height, *swings])


def check_vector(x: Any) -> Vector:
    """x as floats.

    Raises:
        ParameterError: another length than `NAMES`, or a number that is not finite.
    """
    try:
        array = np.asarray(x, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"x: expected {len(NAMES)} numbers, got {x!r}") from None
    if array.shape != (len(NAMES),) or not np.isfinite(array).all():
        raise ParameterError(f"x: expected {len(NAMES)} finite numbers, got {x!r}")
    return array


def to_preset(x: Any, choice: Choice, provenance: str) -> dict[str, Any]:
    """The content of a preset file, as those in `hoof_env/data`.

    Args:
        x, choice: the leg. provenance: where its numbers come from.

    Raises:
        ParameterError: x has another length, or a gait is outside its limits. GeometryError: the leg cannot
            turn.
    """
    values = dict(zip(NAMES, check_vector(x).tolist(), strict=True))
    geometry = Geometry(
        lengths={name: float(np.exp(values[f"log {name}"])) for name in LENGTHS},
        pivot=(values["pivot_x"], values["pivot_y"]),
        assembly=dict(zip(SIGNS, choice.assembly, strict=True)),
        toe=choice.toe,
        heel=choice.heel,
        travel=choice.travel,
        hip_height=values["hip_height"],
    ).to_dict()
    kept = ("lengths", "pivot", "assembly", "toe", "heel", "travel", "hip_height")
    gaits = {gait: GaitParameters(SPEED, *(values[f"{gait}.{name}"] for name in _SWING)) for gait in GAITS}
    return {
        "provenance": provenance,
        "units": "m, rad, rad/s",
        "geometry": {key: geometry[key] for key in kept},
        "ground": {"exponent": choice.exponent},
        "gaits": {gait: vars(parameters) for gait, parameters in gaits.items()},
    }
