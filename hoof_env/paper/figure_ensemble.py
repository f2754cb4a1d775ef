"""What the figures need of an ensemble of identified legs to show how far its members differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
        crank_torque: by (gait, condition), shape (members, n): torque of the crank's drive [N m]; may be
            left out.
        lengths: by name, shape (members,): the lengths of the legs [m]; may be left out.

    Raises:
        ParameterError: no members, or shapes that do not fit together.
    """

    time: Array
    normal: Mapping[tuple[str, str], Array]
    path: Mapping[str, NDArray[np.complex128]]
    hip_height: Array | None = None
    crank_torque: Mapping[tuple[str, str], Array] = field(default_factory=dict)
    lengths: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        curves = (self.members, len(self.time))
        expected: dict[str, tuple[tuple[int, ...], tuple[int, ...]]]
        expected = {f"normal[{key}]": (value.shape, curves) for key, value in self.normal.items()}
        expected |= {f"path[{key!r}]": (value.shape, curves) for key, value in self.path.items()}
        expected |= {f"crank_torque[{k}]": (value.shape, curves) for k, value in self.crank_torque.items()}
        expected |= {f"lengths[{k!r}]": (value.shape, curves[:1]) for k, value in self.lengths.items()}
        if self.hip_height is not None:
            expected["hip_height"] = (self.hip_height.shape, curves[:1])
        for name, (shape, wanted) in expected.items():
            if shape != wanted:
                text = "(members, n)" if len(wanted) == 2 else "(members,)"
                raise ParameterError(f"{name}: expected shape {text} = {wanted}, got {shape}")
        if not self.members:
            raise ParameterError("ensemble: expected at least one member, got none")

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
        return band(self.normal[gait, condition])

    def height_paths(self, gait: str, hip_height: float) -> tuple[Array, Array]:
        """Paths as (x forward of O, height above the ground), each (members, n) [m]; `hip_height` [m] is the
        height of O where the members bring none."""
        heights = np.full(self.members, hip_height) if self.hip_height is None else self.hip_height
        path = self.path[gait]
        return path.real, path.imag + heights[:, None]


def band(curves: Array) -> tuple[Array, Array]:
    """Lowest and highest of the members at each instant, from shape (members, n)."""
    return curves.min(axis=0), curves.max(axis=0)
