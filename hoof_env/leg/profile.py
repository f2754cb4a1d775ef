"""Functions of the crank angle that determine a leg's motion, as polynomials for the fast engine.

The linkage enters the equations of motion only by a few functions of the crank angle: places of toe and heel,
the first moment of the links about O, and three inertias. `LegProfile` computes them from the closed form of
`leg.kinematics` and stores each as one polynomial of degree 5 per cell of crank angle. A polynomial costs
neither square root nor division, and all functions share one look-up. Values are good to some 1e-12,
derivatives to `derivative_error` (below 1e-9) of their largest value; both are worse where links come near a
dead point, which the legs of this package do not.

Everything is in the frame of the leg with O at the origin, after the mirror into the world's sense
(`kinematics.mirror`), so that the world's x points forward and angles are counter-clockwise.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import GeometryError, count, one_of
from hoof_env.leg.assembly import centres, solve
from hoof_env.leg.geometry import Geometry
from hoof_env.simd import floor, minimum, steady, where
from hoof_env.simd.layout import Layout, Row, Vector
from hoof_env.simd.machines import CURRENT
from hoof_env.simd.math import ROUNDER
from hoof_env.simd.memory import Pointer, read
from hoof_env.simd.values import Index, Lanes, full, transposed


class Functions(Layout):
    """The functions, in the order of a table row; z: centres of the links, alpha: their angles, ' is
    d/dtheta."""

    toe: Vector  # [m]
    heel: Vector  # [m]
    moment_slope: Vector  # s', stored separately for an accurate derivative [kg m]
    crank_inertia: Row  # a, of the crank's turning alone: sum of m |z'|^2 + J alpha'^2 [kg m^2]
    coupling: Row  # b, of crank and frame: sum of m z x z' + J alpha' [kg m^2]
    first_moment: Vector  # s: sum of m z over the links [kg m]
    frame_inertia: Row  # c, of the frame's turning: sum of m |z|^2 + J [kg m^2]
    frame_inertia_slope: Row  # c'


class Slopes(Layout):
    """Derivatives of the first functions by the crank angle."""

    toe: Vector
    heel: Vector
    moment_slope: Vector
    crank_inertia: Row
    coupling: Row


FUNCTIONS, SLOPED = Functions.size, Slopes.size
"""Number of functions, and number of functions with derivatives."""

TURN = 2 * np.pi
WHOLE = 2.0**52  # added to a whole number it leaves it in the last bits


def by_name(values: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Name the columns of `functions`, or of its derivatives: `Functions`, shape (len(theta),) each."""
    return dict(zip(Functions.names, values.T, strict=False))


DEGREE = 5
CELLS = (1024, 1280, 1536, 2048, 3072, 4096, 6144)
"""Candidate numbers of cells."""

MAX_CELLS = 2**16
"""Largest number of cells."""

SAMPLED = 16
"""Interval of the cells that are fitted first: if their derivatives are not good enough, the remaining cells
are not fitted."""

BETWEEN = np.array([-0.4999, -0.23, 0.06, 0.31, 0.4999])
"""Angles between the nodes at which derivatives are compared, from the middle of a cell in cells."""

ROW = float(FUNCTIONS * (DEGREE + 1))  # numbers in a row of the table

PIECE = 2048
"""Number of angles whose functions are computed at once: many more take twice as long per angle."""

ROWS = 256
"""Number of rows that BLAS multiplies at once."""

DERIVATIVE_ERROR = 1e-9
"""Error of derivatives relative to their largest value that determines the number of cells: the smallest
candidate that satisfies it, else the largest."""


def places(geometry: Geometry, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], ...]:
    """Return the points from O in the world's sense, and two derivatives by the crank angle.

    Each has shape (len(theta), points), as in `Mechanism.points`; NaN where the linkage cannot be closed.
    """
    z, dz, ddz = solve(geometry, theta)
    return (z, dz, ddz) if geometry.travel > 0 else (-z.conj(), -dz.conj(), -ddz.conj())  # the mirror


def functions(
    geometry: Geometry, theta: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`Functions` in closed form, shape (len(theta), FUNCTIONS), and derivatives of the first `SLOPED`."""
    pieces = [_piece(geometry, theta[begin : begin + PIECE]) for begin in range(0, max(len(theta), 1), PIECE)]
    value, slope = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    return value, slope


def _piece(geometry: Geometry, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return `functions` at angles that are few enough for the processor's cache."""
    z, dz, ddz = places(geometry, theta)
    m, inertia = geometry.body_masses, geometry.body_inertias
    mechanism = geometry.mechanism
    r, v, acc = (centres(geometry, w, mirrored=True) for w in (z, dz, ddz))
    link, dlink, ddlink = (w[:, mechanism.heads] - w[:, mechanism.tails] for w in (z, dz, ddz))
    length2 = geometry.body_lengths**2
    turn, dturn = cross(link, dlink) / length2, cross(link, ddlink) / length2
    toe, heel = (mechanism.number[point] for point in geometry.corners)
    s, ds, dds = (_weighted(w, m) for w in (r, v, acc))
    value = [
        z[:, toe].real, z[:, toe].imag, z[:, heel].real, z[:, heel].imag, ds.real, ds.imag,
        _weighted(np.abs(v) ** 2, m) + _weighted(turn**2, inertia),
        _weighted(cross(r, v), m) + _weighted(turn, inertia),
        s.real, s.imag, _weighted(np.abs(r) ** 2, m) + inertia.sum(), _weighted(2 * _dot(r, v), m),
    ]  # fmt: skip
    slope = [
        dz[:, toe].real, dz[:, toe].imag, dz[:, heel].real, dz[:, heel].imag, dds.real, dds.imag,
        2 * (_weighted(_dot(v, acc), m) + _weighted(turn * dturn, inertia)),
        _weighted(cross(r, acc), m) + _weighted(dturn, inertia),
    ]  # fmt: skip
    return np.stack(value, 1), np.stack(slope, 1)


def _weighted(rows: NDArray[Any], weights: NDArray[np.float64]) -> NDArray[Any]:
    """Return the weighted sum of each row. So many rows at once are too few for BLAS to start its threads,
    which would wait for longer than they work."""
    begins = range(0, max(len(rows), 1), ROWS)
    return np.concatenate([rows[begin : begin + ROWS] @ weights for begin in begins])


def _dot(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> NDArray[np.float64]:
    return (a.conj() * b).real


def cross(a: Any, b: Any) -> Any:
    """a x b of planar vectors, positive if b is to the left of a."""
    return (a.conj() * b).imag


class LegProfile:
    """The functions of one leg as piecewise polynomials.

    Attributes:
        geometry: the leg.
        cells: number of cells of a revolution.
        table: shape (cells, (DEGREE + 1) * FUNCTIONS): row j belongs to the crank angles within half a cell
            of 2 pi j / cells and holds the coefficients, highest power of the angle from there first, of the
            functions with derivatives and then of the remaining ones. Of a crank that rocks, rows are NaN
            where its links have no place, and within about a degree of each end, because derivatives are
            unbounded there.
        derivative_error: largest error of a derivative, relative to its largest value, between the nodes [-].

    Raises:
        ParameterError: not a leg, or not a number of cells.
        GeometryError: the links have no place at some crank angle, or at any if the leg need not turn fully.
    """

    def __init__(self, geometry: Geometry, cells: int | None = None) -> None:
        self.geometry = one_of("geometry", geometry, Geometry)
        finest = CELLS if geometry.full_turn else CELLS[-1:]  # a rocking crank: as near to its ends as can be
        for tried in finest if cells is None else (count("cells", cells, most=MAX_CELLS),):
            self.cells = tried
            is_last = cells is not None or tried == finest[-1]
            if not is_last and self._is_too_coarse():
                continue
            self.table = _fit(geometry, np.arange(tried), tried)
            error = self._errors()
            while not geometry.full_turn and np.nanmax(error, initial=0.0) > DERIVATIVE_ERROR:
                self.table[~(error <= DERIVATIVE_ERROR)] = np.nan
                error = self._errors()
            self.derivative_error = float(np.nanmax(error, initial=0.0))
            if self.derivative_error < DERIVATIVE_ERROR:
                break
        if not np.isfinite(self.table).any():
            raise GeometryError(
                f"geometry {geometry.name!r}: expected a leg that can be assembled at some crank angle"
            )

    def with_cells(self, cells: int) -> LegProfile:
        """The same leg with so many cells."""
        return self if cells == self.cells else leg_profile(self.geometry, cells)

    def __call__(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As `functions`, from the table."""
        theta = np.asarray(theta, dtype=np.float64)
        cell = np.rint(theta * (self.cells / (2 * np.pi)))
        x = (theta - cell * (2 * np.pi / self.cells))[:, None]
        return _evaluate(self.table[cell.astype(np.int64) % self.cells], x)

    def _is_too_coarse(self) -> bool:
        """Return whether derivatives in one of every `SAMPLED` cells are twice as bad as is allowed.

        Twice, because the sample may miss the largest derivatives, to which errors are relative.
        """
        chosen = np.arange(0, self.cells, SAMPLED)
        x = BETWEEN * (2 * np.pi / self.cells)
        theta = (chosen[:, None] + BETWEEN).ravel() * (2 * np.pi / self.cells)
        _, exact = functions(self.geometry, theta)
        if not np.isfinite(exact).all():
            return False  # the fit of all cells finds where the links have no place
        rows = _fit(self.geometry, chosen, self.cells).repeat(len(x), axis=0)
        _, slope = _evaluate(rows, np.tile(x, len(chosen))[:, None])
        return bool((np.abs(slope - exact) / np.abs(exact).max(0)).max() >= 2 * DERIVATIVE_ERROR)

    def _errors(self) -> NDArray[np.float64]:
        """Return the largest error of a derivative in each cell, relative to its largest value [-]; NaN
        without a place."""
        theta = (np.arange(self.cells)[:, None] + BETWEEN).ravel() * (2 * np.pi / self.cells)
        slope = self(theta)[1]
        known = np.isfinite(slope[:, 0])
        error = np.full(len(theta), np.nan)
        if known.any():
            _, exact = functions(self.geometry, theta[known])
            error[known] = (np.abs(slope[known] - exact) / np.nanmax(np.abs(exact), 0)).max(1)
        return error.reshape(self.cells, -1).max(1)


@lru_cache(maxsize=16)
def leg_profile(geometry: Geometry, cells: int | None = None) -> LegProfile:
    """`LegProfile`, fitted once for legs that are equal."""
    return LegProfile(geometry, cells)


def _evaluate(
    rows: NDArray[np.float64], x: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the values and derivatives of the polynomials in rows of a table, at angles from the middles of
    the cells [rad], shape (len(rows), 1)."""
    first = (DEGREE + 1) * SLOPED
    sloped = rows[:, :first].reshape(-1, DEGREE + 1, SLOPED)
    others = rows[:, first:].reshape(-1, DEGREE + 1, FUNCTIONS - SLOPED)
    rows = np.concatenate([sloped, others], axis=2)
    slope, value = np.zeros((2, len(rows), FUNCTIONS))
    for p in range(DEGREE + 1):
        slope = slope * x + value
        value = value * x + rows[:, p]
    return value, slope[:, :SLOPED]


def _fit(geometry: Geometry, chosen: NDArray[np.int64], cells: int) -> NDArray[np.float64]:
    """Fit values and derivatives at the Chebyshev points of chosen cells, by least squares; return their rows
    of a table of so many cells."""
    half, count = np.pi / cells, 2 * (DEGREE + 1)
    nodes = np.cos(np.pi * (2 * np.arange(count) + 1) / (2 * count))
    theta = 2 * half * chosen[:, None] + half * nodes
    value, slope = functions(geometry, theta.ravel())
    if geometry.full_turn and not np.isfinite(value).all():
        where = theta.ravel()[~np.isfinite(value).all(1)][0]
        raise GeometryError(
            f"geometry {geometry.name!r}: expected a leg that can be assembled at every crank angle, "
            f"but at {np.degrees(where) % 360:.2f} deg it cannot"
        )
    powers, rates = np.vander(nodes, DEGREE + 1), np.zeros((count, DEGREE + 1))
    rates[:, :-1] = np.vander(nodes, DEGREE) * np.arange(DEGREE, 0, -1)
    scale = half ** np.arange(DEGREE, -1, -1)
    parts = []
    for fitted, sample in (
        (np.concatenate([powers, rates]), (value[:, :SLOPED], half * slope)), (powers, (value[:, SLOPED:],)),
    ):  # fmt: skip
        known = np.concatenate([part.reshape(len(chosen), count, -1) for part in sample], axis=1)
        found = np.einsum("pk,ckf->cpf", np.linalg.pinv(fitted), known) / scale[:, None]
        parts.append(found.reshape(len(chosen), -1))
    table = np.concatenate(parts, axis=1)
    table[~np.isfinite(table).all(1)] = np.nan
    return table


# The look-up: functions side by side, lane by lane, since each lane has its own row; then rows and columns
# are swapped. Horner's scheme with fused operations takes one instruction a power for the value and one
# for the derivative. Each waits for the one before, so the lanes go through the powers together.


def _polynomials(rows: list[Any], angles: list[Any], first: int, last: int) -> tuple[Any, Any]:
    """Return the values and derivatives of functions `first` to `last` in each lane, a vector a lane.

    A lane's row of the table holds their coefficients together.
    """
    count = last - first

    def coefficients(power: int) -> list[Any]:
        at = first * (DEGREE + 1) + power * count
        return [read(row, at, 1, count) for row in rows]

    def next_power(sums: list[Any], added: list[Any]) -> list[Any]:
        return [s * x + y for s, x, y in zip(sums, xs, added, strict=True)]

    xs = [full(angle, count) for angle in angles]
    values = slopes = coefficients(0)
    for power in range(1, DEGREE + 1):
        slopes = next_power(slopes, values) if power > 1 else values
        values = next_power(values, coefficients(power))
    return values, slopes


# `leg` is rows of a `dynamics.layout.LegRows`, which this room below the mechanics does not import


def locate(leg: Any, cells: Lanes | float) -> None:
    """Find in which of `cells` of its table the crank angle of a leg is, and how far from its middle.

    Called some time before `look_up`, which waits for the result. NaN is in some cell, at a distance of NaN
    from its middle."""
    angle = leg.theta
    cell = steady(angle * (cells / TURN) + ROUNDER) - ROUNDER
    # Cell 0 starts before its turn: its row is repeated at the end of the table.
    row = cell - cells * floor(angle * (1 / TURN))
    row = minimum(cells, where(row > 0.0, row, 0.0))  # not `maximum`: NaN is in cell 0
    leg.row_begin = (row + leg.settings.first_row) * ROW + WHOLE
    leg.cell_angle = angle - cell * (TURN / cells)


def look_up(leg: Any, table: Pointer) -> None:
    """Fill a leg's functions and slopes (see `Functions`) in the cell that `locate` found; NaN
    for an angle of NaN."""
    machine, fields, lanes = CURRENT.machine, leg._layout.fields, max(leg._n, 1)
    values, slopes = fields["functions"].start, fields["slopes"].start
    if machine.runs_now:
        _look_up_now(leg, table, values, slopes)
        return

    def loaded(name: str, kind: str, per_lane: int) -> list[str]:  # one by one: each is needed in all lanes
        first = leg._at(fields[name].start)
        return [machine.load(machine.at(first, per_lane * lane, kind), kind) for lane in range(lanes)]

    # The constant added to the number of a row's first element is in the upper half of its bits.
    begins = [machine.widened(begin) for begin in loaded("row_begin", "i32", 2)]
    places = [table + Index(begin) for begin in begins]
    angles = [Lanes(x, 0) for x in loaded("cell_angle", "double", 1)]
    sloped, derivatives = _polynomials(places, angles, 0, SLOPED)
    others, _ = _polynomials(places, angles, SLOPED, FUNCTIONS)
    for first, found in ((values, sloped), (values + SLOPED, others), (slopes, derivatives)):
        for k, column in enumerate(transposed(found)):
            leg[first + k] = Lanes(column.x, leg._n)


def _look_up_now(leg: Any, table: Pointer, values: int, slopes: int) -> None:
    """`look_up` on a machine that computes at once: all lanes together, function by function."""
    machine = CURRENT.machine
    begin = machine.whole_of((leg.row_begin - WHOLE).x)
    numbers = [Lanes(x, leg._n) for x in machine.table_rows(table.x, begin, FUNCTIONS * (DEGREE + 1))]
    x = leg.cell_angle
    for first, last in ((0, SLOPED), (SLOPED, FUNCTIONS)):
        count = last - first
        for k in range(count):
            c = [numbers[first * (DEGREE + 1) + power * count + k] for power in range(DEGREE + 1)]
            value, slope = c[0], c[0]
            for power in range(1, DEGREE + 1):
                slope = slope * x + value if power > 1 else value
                value = value * x + c[power]
            leg[values + first + k] = value
            if last == SLOPED:
                leg[slopes + k] = slope
