"""What figures 3 and 5 need of an ensemble of identified legs to show how far its members differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import ParameterError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EnsembleCurves:
    """One cycle of every member of an ensemble, all sampled at the same instants.

    Attributes:
        time: shape (n,), from the start of the cycle, increasing [s].
        normal: by (gait, condition), shape (members, n): normal force summed over toe and heel [N].
        path: by gait, complex, shape (members, n): middle of the sole relative to O, x forward and y up,
            in the world's axes [m].
        hip_height: shape (members,), height of O above each member's ground [m], so that figure 3 can show
            the paths above the ground; None draws them from the O of the leg in the figure.

    Raises:
        ParameterError: no members, or shapes that do not fit together.
    """

    time: Array
    normal: Mapping[tuple[str, str], Array]
    path: Mapping[str, NDArray[np.complex128]]
    hip_height: Array | None = None

    def __post_init__(self) -> None:
        expected = (self.members, len(self.time))
        shapes = {f"normal[{key}]": value.shape for key, value in self.normal.items()}
        shapes |= {f"path[{key!r}]": value.shape for key, value in self.path.items()}
        for name, shape in shapes.items():
            if shape != expected:
                raise ParameterError(f"{name}: expected shape (members, n) = {expected}, got {shape}")
        if not self.members:
            raise ParameterError("ensemble: expected at least one member, got none")
        if self.hip_height is not None and self.hip_height.shape != expected[:1]:
            raise ParameterError(
                f"hip_height: expected shape (members,) = {expected[:1]}, got {self.hip_height.shape}"
            )

    @property
    def members(self) -> int:
        """How many legs there are."""
        return next((len(curve) for curve in (*self.path.values(), *self.normal.values())), 0)

    @property
    def label(self) -> str:
        """What the legends call it."""
        return f"ensemble of {self.members} identified legs"

    def range(self, gait: str, condition: str) -> tuple[Array, Array]:
        """Lowest and highest normal force of the members at each instant [N]."""
        forces = self.normal[gait, condition]
        return forces.min(axis=0), forces.max(axis=0)

    def height_paths(self, gait: str, hip_height: float) -> tuple[Array, Array]:
        """Paths as (x forward of O, height above the ground), each (members, n) [m]; `hip_height` [m] is the
        height of O where the members bring none."""
        heights = np.full(self.members, hip_height) if self.hip_height is None else self.hip_height
        path = self.path[gait]
        return path.real, path.imag + heights[:, None]
