"""Surroundings of the motion: leg, ground and hips, which records and pictures of an episode share."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry

Hips = Mapping[str, tuple[float, float]]
"""Crank centre of each leg from the trunk's place [m], by the prefix of the leg's names."""

ONE_HIP: Hips = MappingProxyType({"": (0.0, 0.0)})
"""Hips of a single leg, whose names have no prefix and whose O is the trunk's place."""


class Surroundings(NamedTuple):
    """Surroundings of the motion that pictures and files show.

    Attributes:
        geometry, terrain: the leg and the ground.
        trunk: its kind, one of `dynamics.parts.TRUNKS`.
        weight_n: weight of trunk and legs [N], 0 if unknown.
        lift_off_n: threshold of the normal force on a hoof between stance and swing [N].
        hips: crank centres by the prefixes of the legs.
        picture: kind of the body's picture, a key of `render.picture.PICTURES`.
        hoof_length: distance of the soles below the legs' hoof points at rest [m]; see
            `dynamics.parts.HoofSpring`.
    """

    geometry: Geometry
    terrain: Terrain = Terrain.flat()
    trunk: str = "suspended"
    weight_n: float = 0.0
    lift_off_n: float = 0.0
    hips: Hips = ONE_HIP
    picture: str = "leg"
    hoof_length: float = 0.0
