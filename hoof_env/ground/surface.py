"""A terrain as the kernels see it: what the ground is like at x."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.simd import floor, gather, larger, smaller
from hoof_env.simd.compile import inlined
from hoof_env.simd.memory import address


class TerrainGrid(NamedTuple):
    """A terrain for the kernels: the arguments of `surface` after x.

    Attributes:
        cells: one row for each cell, from the level one before the first knot to that behind the last, shape
            (knots + 1, 8): height, its rise over the cell, normal x and y, factor of stiffness and its rise,
            factor of friction and its rise.
        origin: where the first cell begins [m].
        per_metre: cells in a metre [1/m].
    """

    cells: NDArray[np.float64]
    origin: float
    per_metre: float


@inlined
def surface(x, cells, origin, per_metre):  # type: ignore[no-untyped-def]
    """The ground at `x` [m]: height [m], normal x and y [-], factors of stiffness and friction [-].

    Args:
        x: any number, or lanes; what is not finite gives heights and factors that are none.
        cells, origin, per_metre: a `TerrainGrid`.
    """
    place = (x - origin) * per_metre
    cell = floor(
        smaller(larger(0.0, place), cells.shape[0] - 1.0)
    )  # this order of arguments sends NaN to cell 0
    at, part, first = (
        address(cells),
        place - cell,
        8.0 * cell,
    )  # the level cells at the ends have no rises: any part will do
    return (
        gather(at, first) + part * gather(at, first + 1.0),
        gather(at, first + 2.0),
        gather(at, first + 3.0),
        gather(at, first + 4.0) + part * gather(at, first + 5.0),
        gather(at, first + 6.0) + part * gather(at, first + 7.0),
    )
