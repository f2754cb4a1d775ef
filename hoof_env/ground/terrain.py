"""Shape of the ground along x, and places where it is softer, harder or more slippery than `Ground`.

Height and the two factors are given at evenly spaced knots and are linear in between, so that only the slope
jumps; beyond the first and the last knot the ground is level with constant values.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.errors import ParameterError, brief, check_number
from hoof_env.simd import Lanes, Matrix, Number, floor, gather_eight, minimum, where

MAX_KNOTS = 1_000_000
"""Largest number of knots."""

LONG_WAY = 1000.0
"""Extent of `Terrain.slope` on either side of x = 0 [m]."""


@dataclass(frozen=True)
class Terrain:
    """Height and factors along x at the knots start + k spacing; `Terrain()` is flat.

    A point at (x, y) meets the straight piece at its x, with normal (nx, ny): penetration (height - y) ny,
    rate -(vx nx + vy ny), sliding velocity vx ny - vy nx. Where two pieces meet at an angle, penetration and
    normal jump, and so does the force on a point inside the ground: make a sharp corner of several small
    ones.

    >>> import hoof_env
    >>> ramp = hoof_env.Terrain(height=(0.0, 0.0, 0.1), friction=(1.0, 1.0, 0.5), spacing=2.0)
    >>> hill = hoof_env.Terrain.slope(0.05)  # [rad]

    Attributes:
        height: heights at the knots [m].
        stiffness: factors on `Ground.stiffness` at the knots [-]; a number is for all knots.
        friction: factors on `Ground.friction` at the knots [-]; a number is for all knots.
        start: x of the first knot [m].
        spacing: distance between knots [m].

    Raises:
        ParameterError: a value is not finite or out of range, or the lengths differ.
    """

    height: tuple[float, ...] = (0.0,)
    stiffness: tuple[float, ...] | float = 1.0
    friction: tuple[float, ...] | float = 1.0
    start: float = 0.0
    spacing: float = 1.0

    def __post_init__(self) -> None:
        # the dataclass is frozen: `__post_init__` cannot assign
        height = _row("terrain.height", self.height, -1e4, 1e4, None)
        object.__setattr__(self, "height", height)
        for name, low in (("stiffness", 1e-6), ("friction", 0.0)):
            row = _row(f"terrain.{name}", getattr(self, name), low, 1e6, len(height))
            object.__setattr__(self, name, row)
        for name, low in (("start", -1e6), ("spacing", 1e-4)):
            number = check_number(f"terrain.{name}", getattr(self, name), low=low, high=1e6)
            object.__setattr__(self, name, number)

    @classmethod
    def flat(cls) -> Terrain:
        """Return level ground at y = 0, with the settings of `Ground` everywhere."""
        return cls()

    @classmethod
    def slope(cls, angle: float) -> Terrain:
        """Return one slope through (0, 0), from x = -1 km to 1 km; `angle` [rad], positive uphill, within
        1.4."""
        rise = LONG_WAY * math.tan(check_number("angle", angle, low=-1.4, high=1.4))
        return cls(height=(-rise, rise), start=-LONG_WAY, spacing=2 * LONG_WAY)

    @classmethod
    def ramp(cls, angle: float, start: float = 0.0, length: float = 10.0) -> Terrain:
        """Return ground that is level at y = 0 up to `start` [m], a slope of `angle` [rad] over `length` [m]
        of x, then level."""
        length = check_number("length", length, low=1e-4, high=1e6)
        rise = length * math.tan(check_number("angle", angle, low=-1.4, high=1.4))
        return cls(height=(0.0, rise), start=start, spacing=length)

    @classmethod
    def through(
        cls,
        x: ArrayLike,
        height: ArrayLike,
        stiffness: ArrayLike = 1.0,
        friction: ArrayLike = 1.0,
        spacing: float = 0.01,
    ) -> Terrain:
        """Return straight lines through points at any increasing `x` [m], sampled every `spacing` [m].

        A corner that is not a whole number of spacings from the first point is cut off within one spacing.

        Args:
            x: places of the points [m], shape (n,), n >= 2.
            height, stiffness, friction: as in `Terrain`, at `x`.
            spacing: distance between knots [m].

        Raises:
            ParameterError: as in `Terrain`; x does not increase.
        """
        points = np.array(_row("x", x, -1e6, 1e6, None))
        if points.size < 2 or np.diff(points).min() <= 0:
            raise ParameterError(f"x: expected two or more increasing numbers, got {brief(x)}")
        knots = _knots(points[0], points[-1], spacing)
        rows: dict[str, Any] = {}
        for name, values in (("height", height), ("stiffness", stiffness), ("friction", friction)):
            row = _row(name, values, -np.inf, np.inf, points.size)
            rows[name] = tuple(np.interp(knots, points, row).tolist())
        return cls(**rows, start=points[0], spacing=spacing)

    @classmethod
    def patches(cls, patches: Iterable[Sequence[float]], spacing: float = 0.01) -> Terrain:
        """Return flat ground with patches of different stiffness and friction.

        Args:
            patches: (x0, x1, factor of stiffness, factor of friction) each; they may touch, not overlap.
                Edges are rounded to whole spacings from the first x0, and outside them the factors change
                back over one spacing.
            spacing: distance between knots [m].

        Raises:
            ParameterError: a patch is not of that form, or patches overlap.
        """
        spacing = check_number("terrain.spacing", spacing, low=1e-4, high=1e6)
        if not isinstance(patches, Iterable):
            raise ParameterError(f"patches: expected a row of patches, got {brief(patches)}")
        rows = []
        for number, patch in enumerate(patches):
            values = _row(f"patches[{number}]", patch, -1e6, 1e6, None)
            if len(values) != 4 or values[0] >= values[1]:
                wanted = "(x0, x1, stiffness, friction) with x0 < x1"
                raise ParameterError(f"patches[{number}]: expected {wanted}, got {brief(patch)}")
            rows.append(values)
        rows.sort()
        if not rows:
            return cls()
        for before, after in pairwise(rows):
            if before[1] > after[0]:
                wanted = "patches apart from each other"
                raise ParameterError(f"patches: expected {wanted}, got {before} and {after}")
        # a knot more at either end, where the factors are 1 again
        start = rows[0][0] - spacing
        factors = np.ones((2, _knots(start, rows[-1][1] + spacing, spacing).size))
        for x0, x1, *pair in rows:
            inside = slice(round((x0 - start) / spacing), round((x1 - start) / spacing) + 1)
            factors[:, inside] = np.array(pair)[:, None]
        stiffness, friction = (tuple(row.tolist()) for row in factors)
        return cls((0.0,) * len(stiffness), stiffness, friction, start, spacing)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Terrain:
        """Return the terrain that `to_dict` wrote; missing entries are the defaults.

        Raises:
            ParameterError: an unknown entry or a bad value.
        """
        names = [field.name for field in fields(cls)]
        if not isinstance(data, Mapping) or set(data) - set(names):
            wanted = f"an object with only the entries {', '.join(names)}"
            raise ParameterError(f"terrain: expected {wanted}, got {brief(data)}")
        return cls(**data)

    def to_dict(self) -> dict[str, Any]:
        """Return entries for JSON, which preserves the bits of numbers."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @cached_property
    def x(self) -> NDArray[np.float64]:
        """Places of the knots [m]; read-only."""
        knots = self.start + self.spacing * np.arange(len(self.height), dtype=np.float64)
        knots.flags.writeable = False
        return knots

    @cached_property
    def heights(self) -> NDArray[np.float64]:
        """Heights of the knots [m]; read-only."""
        knots = np.array(self.height)
        knots.flags.writeable = False
        return knots

    def height_at(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the height [m] at `x` [m], same shape."""
        return np.interp(x, self.x, self.heights)

    def to_grid(self) -> TerrainGrid:
        """Return the terrain for the kernel `surface`."""
        rows = np.array([self.height, self.stiffness, self.friction])
        # a level cell before the first knot and after the last; + 0.0 makes 0.0 of -0.0
        rows = np.pad(rows, ((0, 0), (1, 1)), mode="edge") + 0.0
        rises = np.diff(rows, axis=1)
        slope = rises[0] / self.spacing
        ny = 1 / np.sqrt(1 + slope**2)
        (height, stiffness, friction) = rows[:, :-1]
        (rise, harder, rougher) = rises
        cells = np.column_stack([height, rise, 0.0 - slope * ny, ny, stiffness, harder, friction, rougher])
        return TerrainGrid(np.ascontiguousarray(cells), self.start - self.spacing, 1 / self.spacing)

    @cached_property
    def grid(self) -> TerrainGrid:
        """The grid of `to_grid`, cached and read-only."""
        grid = self.to_grid()
        grid.cells.flags.writeable = False
        return grid


def _knots(start: float, end: float, spacing: float) -> NDArray[np.float64]:
    """Return the knots from `start` to `end` or just beyond it [m]."""
    check_number("terrain.spacing", spacing, low=1e-4, high=1e6)
    # 1e-6: a length that is a whole number of spacings except for rounding gets no extra knot
    count = math.ceil((end - start) / spacing - 1e-6) + 1
    if count > MAX_KNOTS:
        wanted = f"at most {MAX_KNOTS} knots from {start:g} to {end:g} m"
        raise ParameterError(f"terrain.spacing: expected {wanted}, got {brief(spacing)} m")
    return start + spacing * np.arange(count, dtype=np.float64)


def _row(name: str, values: Any, low: float, high: float, count: int | None) -> tuple[float, ...]:
    """Return `values` as `count` floats within [low, high]. They are one number, or `count` numbers; a
    `count` of None accepts any number."""
    if count is not None and np.ndim(values) == 0:
        return (check_number(name, values, low=low, high=high),) * count
    plain = _plain_row(values, low, high, count)
    if plain is not None:
        return plain
    try:
        row = tuple(check_number(f"{name}[{k}]", value, low=low, high=high) for k, value in enumerate(values))
    except TypeError:
        row = ()
    if isinstance(values, (str, bytes)) or not 0 < len(row) <= MAX_KNOTS or (count and len(row) != count):
        raise ParameterError(f"{name}: expected {count or 'a row of'} numbers, got {brief(values)}")
    return row


def _plain_row(values: Any, low: float, high: float, count: int | None) -> tuple[float, ...] | None:
    """Return a tuple or list of `float` as a tuple if all are within bounds, else None. Hills have thousands
    of knots, and a check one by one, which finds the wrong value, takes longer than the rest of making an
    environment."""
    if type(values) not in (tuple, list) or set(map(type, values)) != {float}:
        return None
    if len(values) > MAX_KNOTS or (count is not None and len(values) != count):
        return None
    row = np.array(values)
    # Bounds may be infinite, values must be finite.
    is_good = np.isfinite(row) & (low <= row) & (row <= high)
    return tuple(values) if is_good.all() else None


class TerrainGrid(NamedTuple):
    """Terrain for the kernels: the arguments of `surface` after x.

    `cells` has a row for each cell, from the level cell before the first knot to the level cell after the
    last, shape (knots + 1, 8): height, its rise over the cell, normal x and y, factor of stiffness and its
    rise, factor of friction and its rise.
    """

    cells: NDArray[np.float64]
    origin: float  # x at which the first cell starts [m]
    per_metre: float  # number of cells in a metre [1/m]


def surface(
    x: Lanes, cells: Matrix, origin: Number, per_metre: Number
) -> tuple[Lanes, Lanes, Lanes, Lanes, Lanes]:
    """Return the ground at `x` [m]: height [m], normal x and y [-], factors of stiffness
    and friction [-]. Heights and factors are NaN where x is not finite."""
    place = (x - origin) * per_metre
    # not `maximum`, since NaN must be in a cell, too
    cell = floor(minimum(where(place > 0.0, place, 0.0), cells.shape[0] - 1.0))
    # far beyond the ends `part` is large, but the level cells there have no rises
    part = place - cell
    height, rise, normal_x, normal_y, stiffness, firmer, friction, rougher = gather_eight(
        cells.first, 8.0 * cell
    )
    return height + part * rise, normal_x, normal_y, stiffness + part * firmer, friction + part * rougher
