"""A leg in its place on a trunk."""

from __future__ import annotations

from dataclasses import dataclass, field

from hoof_env.dynamics.drive import Drive, Motor, Prescribed
from hoof_env.errors import ParameterError, check_number
from hoof_env.leg.geometry import Geometry

FARTHEST = 1e3
"""Of O from the trunk's centre of mass [m]."""


@dataclass(frozen=True)
class Limb:
    """One leg on a trunk.

    Attributes:
        geometry: the leg.
        hip: where the crank centre O sits on the trunk, from the trunk's centre of mass [m], forward and up.
        drive: what turns its crank.

    Raises:
        ParameterError: a part is of the wrong type, not finite, or the hip beyond `FARTHEST`.
    """

    geometry: Geometry
    hip: tuple[float, float] = (0.0, 0.0)
    drive: Drive = field(default_factory=Motor)

    def __post_init__(self) -> None:
        if not isinstance(self.geometry, Geometry):
            raise ParameterError(f"limb.geometry: expected a Geometry, got {self.geometry!r}")
        if not isinstance(self.drive, (Prescribed, Motor)):
            raise ParameterError(f"limb.drive: expected a Motor or Prescribed, got {self.drive!r}")
        try:
            x, y = self.hip
        except (TypeError, ValueError):
            raise ParameterError(
                f"limb.hip: expected two numbers (x, y) in metres, got {self.hip!r}"
            ) from None
        hip = tuple(
            check_number(f"limb.hip[{k}]", v, low=-FARTHEST, high=FARTHEST) for k, v in enumerate((x, y))
        )
        object.__setattr__(self, "hip", hip)
