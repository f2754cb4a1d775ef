"""Schemes of `TrunkEngine`, as data: explicit ones whose stages each take the derivatives of the one before.

Stage j + 1 is taken at fraction a_j of the step, from the step's start with the derivatives f_j of stage j,

    y_(j+1) = y_0 + a_j h f_j,    y(t + h) = y_0 + h sum of w_j f_j,

which needs one derivative in memory and one sum. Semi-implicit Euler has one stage and moves the
coordinates with the new rates. `integrators` has the schemes of `ConstrainedLeg`, as functions; the paper's
explicit Euler is there alone. Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Scheme:
    """One scheme.

    Attributes:
        order: of convergence [-].
        fractions: a_j, one less than stages [-].
        weights: w_j [-].
        new_rates: coordinates move with the rates of the step's end.
    """

    order: int
    fractions: tuple[float, ...]
    weights: tuple[float, ...]
    new_rates: bool = False


SCHEMES = MappingProxyType(
    {
        "semi_implicit_euler": Scheme(1, (), (1.0,), new_rates=True),
        "midpoint": Scheme(2, (1 / 2,), (0.0, 1.0)),
        "rk3": Scheme(3, (1 / 3, 2 / 3), (1 / 4, 0.0, 3 / 4)),  # Heun
        "rk4": Scheme(4, (1 / 2, 1 / 2, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    }
)
"""The schemes by name."""
