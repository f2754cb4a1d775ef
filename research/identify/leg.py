"""A leg and its two gaits as numbers: a `Choice` of what cannot vary continuously, the rest a vector x.

x holds log lengths [m], the pivot and the hip's height [m] and the swing of both gaits [rad]; see `NAMES`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError
from hoof_env.gait import LIMITS, GaitParameters, load_gait
from hoof_env.ground.contact import load_ground
from hoof_env.leg.geometry import Geometry, Preset, load_geometry, tables
from hoof_env.leg.linkage import DYADS, LENGTHS, POINTS

Vector = NDArray[np.float64]

GAITS = ("walk", "run")
SIGNS = tuple(dyad.point for dyad in DYADS)  # their side is a choice, in the order of `Choice.assembly`
NUMBER = {name: i for i, name in enumerate(POINTS)}  # of a point, in arrays of all of them
FIRST_FIT = str(Path(__file__).with_name("first_fit.json"))  # what a search sets out from
STEPS = tables(load_geometry())[0]  # the construction of any leg
SPEED = 2 * np.pi  # the paper's crank speed in both gaits [rad/s]; not searched

_BODY = (*(f"log {name}" for name in LENGTHS), "pivot_x", "pivot_y")
_SWING = tuple(name for name in LIMITS if name != "crank_speed")

NAMES = (*_BODY, "hip_height", *(f"{gait}.{name}" for gait in GAITS for name in _SWING))
"""Names of the entries of x: log [m], m, and rad."""

BODY = len(_BODY)  # so many first entries are the leg's own; the ground level is not among them
LEVEL, OFFSET = NAMES.index("hip_height"), NAMES.index("walk.swing_offset")

SCALES = np.array([1.0] * len(LENGTHS) + [0.6, 0.6, 0.5] + [0.6] * 6)  # how far each entry of x ranges


@dataclass(frozen=True)
class Choice:
    """What a search cannot change continuously: +1 or -1 for each of `SIGNS`; toe, heel and travel, as in
    `Geometry`; and n of Eq. 14, which the paper does not print [-]."""

    assembly: tuple[int, ...]
    toe: str
    heel: str
    travel: int
    exponent: float


def encode(preset: Preset, exponent: float | None = None) -> tuple[Choice, Vector]:
    """The leg and the two gaits of a preset as (choice, x), on its own ground or one with this exponent."""
    geometry, ground = load_geometry(preset), load_ground(preset)
    gaits = {name: load_gait(name, preset) for name in GAITS}
    for name, gait in gaits.items():
        if abs(gait.crank_speed - SPEED) > 1e-9:
            raise ParameterError(
                f"{name}.crank_speed: expected the paper's {SPEED:.6f} rad/s, got {gait.crank_speed!r}"
            )
    signs = tuple(geometry.assembly[point] for point in SIGNS)
    exponent = ground.exponent if exponent is None else exponent
    choice = Choice(signs, geometry.toe, geometry.heel, geometry.travel, exponent)
    logs = [np.log(geometry.lengths[name]) for name in LENGTHS]
    swings = [value for gait in gaits.values() for value in gait.to_array()[1:]]
    return choice, np.array([*logs, *geometry.pivot, geometry.hip_height, *swings])


def to_preset(x: Vector, choice: Choice, provenance: str) -> dict[str, Any]:
    """The content of a preset file, as those in `hoof_env/data`; raises `ParameterError` where x is not
    finite numbers or a gait is outside its limits, `GeometryError` where the leg cannot turn."""
    if x.shape != (len(NAMES),) or not np.isfinite(x).all():
        raise ParameterError(f"x: expected {len(NAMES)} finite numbers, got {x!r}")
    values = dict(zip(NAMES, x.tolist(), strict=True))
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
