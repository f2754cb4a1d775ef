"""What a leg's motion depends on, as functions of its crank angle, in polynomials for the fast engine.

Nothing about the linkage enters the equations of motion but a few functions of the crank angle: where toe and
heel are, the first moment of the links about O, and three inertias. `LegProfile` computes them from the
closed form of `leg.kinematics` and keeps each as one polynomial of degree 7 a cell of crank angle. A
polynomial costs neither square root nor division, and all functions share one look-up. Values are good to
some 1e-13, derivatives to `derivative_error` (some 1e-10) of their largest value.

Everything is in the frame of the leg with O at the origin, after the mirror into the world's sense
(`kinematics.mirror`), so that the world's x points forward and angles are counter-clockwise.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from hoof_env._jit import inlined, kernel
from hoof_env._memory import address, doubles
from hoof_env.errors import GeometryError
from hoof_env.leg.geometry import Geometry, tables
from hoof_env.leg.kinematics import solve_points
from hoof_env.leg.linkage import BODIES, POINTS

FUNCTIONS = (
    "toe_x", "toe_y", "heel_x", "heel_y",  # [m]
    "s_x", "s_y",  # first moment: sum of m z over the links [kg m]
    "a",  # inertia of the crank's turning alone: sum of m |z'|^2 + J alpha'^2 [kg m^2]
    "b",  # coupling of crank and frame: sum of m z x z' + J alpha' [kg m^2]
    "c",  # inertia of the frame's turning: sum of m |z|^2 + J [kg m^2]
    "ds_x", "ds_y",  # derivative of s: a function of its own, for its derivative must be good too [kg m]
    "sin", "cos",  # of the crank angle [-]
)  # fmt: skip
"""The functions in the order of the table; z are the links' centres, alpha their angles, ' is d/dtheta."""

(TOE_X, TOE_Y, HEEL_X, HEEL_Y, S_X, S_Y, A, B, C, DS_X, DS_Y, SIN, COS) = range(len(FUNCTIONS))

WIDTH = 16
"""Functions of a table row, padded to whole vectors."""

DEGREE = 7
CELLS = (256, 512, 1024, 2048)
"""Numbers of cells that are tried: powers of two, so that an angle's cell needs no division."""

DERIVATIVE_ERROR = 1e-9
"""The number of cells is the smallest that keeps derivatives this good, relative to their largest value."""

_NUMBER = {name: i for i, name in enumerate(POINTS)}
_TAIL = np.array([_NUMBER[body.tail] for body in BODIES])
_HEAD = np.array([_NUMBER[body.head] for body in BODIES])
_MAGIC = 6755399441055744.0  # 1.5 * 2^52: adding it rounds a double to the nearest integer


@kernel
def _solve_all(theta, crank, pivot, steps, values, z, dz, ddz):  # type: ignore[no-untyped-def]
    for k in range(theta.shape[0]):
        solve_points(theta[k], crank, pivot, steps, values, z[k], dz[k], ddz[k])


def functions(
    geometry: Geometry, theta: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """All `FUNCTIONS` and their derivatives by theta in closed form, each of shape (len(theta), 13)."""
    theta = np.asarray(theta, dtype=np.float64)
    z, dz, ddz = (np.empty((theta.size, len(POINTS)), np.complex128) for _ in range(3))
    crank, pivot = geometry.lengths["OP"], complex(*geometry.pivot)
    with np.errstate(invalid="ignore", divide="ignore"):
        _solve_all(theta, crank, pivot, *tables(geometry), z, dz, ddz)
    if geometry.travel < 0:
        z, dz, ddz = (-w.conj() for w in (z, dz, ddz))  # the mirror
    m, inertia = geometry.body_masses, geometry.body_inertias
    r, v, acc = ((w[:, _TAIL] + w[:, _HEAD]) / 2 for w in (z, dz, ddz))
    link, dlink, ddlink = (w[:, _HEAD] - w[:, _TAIL] for w in (z, dz, ddz))
    length2 = geometry.body_lengths**2
    turn, dturn = _cross(link, dlink) / length2, _cross(link, ddlink) / length2
    toe, heel = _NUMBER[geometry.toe], _NUMBER[geometry.heel]
    s, ds, dds = r @ m, v @ m, acc @ m
    value = [
        z[:, toe].real, z[:, toe].imag, z[:, heel].real, z[:, heel].imag, s.real, s.imag,
        np.abs(v) ** 2 @ m + turn**2 @ inertia, _cross(r, v) @ m + turn @ inertia,
        np.abs(r) ** 2 @ m + inertia.sum(), ds.real, ds.imag, np.sin(theta), np.cos(theta),
    ]  # fmt: skip
    slope = [
        dz[:, toe].real, dz[:, toe].imag, dz[:, heel].real, dz[:, heel].imag, ds.real, ds.imag,
        2 * (_dot(v, acc) @ m + (turn * dturn) @ inertia), _cross(r, acc) @ m + dturn @ inertia,
        2 * _dot(r, v) @ m, dds.real, dds.imag, np.cos(theta), -np.sin(theta),
    ]  # fmt: skip
    return np.stack(value, 1), np.stack(slope, 1)


def _dot(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> NDArray[np.float64]:
    return (a.conj() * b).real


def _cross(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> NDArray[np.float64]:
    return (a.conj() * b).imag


class LegProfile:
    """The functions of one leg as piecewise polynomials.

    Attributes:
        geometry: the leg.
        cells: number of cells of a revolution.
        table: shape (cells, (DEGREE + 1) * WIDTH): row j belongs to the crank angles within half a cell of
            2 pi j / cells and holds, highest power of the angle from there first, `WIDTH` coefficients a
            power. Of a crank that rocks, rows are NaN where its links have no place, and in some 7 cells
            beside each end, for derivatives grow there without bound.
        derivative_error: largest error of a derivative over its largest value, between the nodes [-].

    Raises:
        GeometryError: the links have no place at some crank angle, or at any if the leg need not turn fully.
    """

    def __init__(self, geometry: Geometry, cells: int | None = None) -> None:
        self.geometry = geometry
        finest = CELLS if geometry.full_turn else CELLS[-1:]  # a rocking crank: as near to its ends as can be
        for tried in (cells,) if cells else finest:
            self.cells, self.table = tried, _fit(geometry, tried)
            error = self._errors()
            while not geometry.full_turn and np.nanmax(error, initial=0.0) > DERIVATIVE_ERROR:
                self.table[~(error <= DERIVATIVE_ERROR)] = np.nan
                error = self._errors()
            self.derivative_error = float(np.nanmax(error, initial=0.0))
            if self.derivative_error < DERIVATIVE_ERROR:
                break
        if not np.isfinite(self.table).any():
            raise GeometryError(
                f"geometry {geometry.name!r}: expected a leg whose links have a place at some crank angle"
            )

    def with_cells(self, cells: int) -> LegProfile:
        """The same leg with so many cells, a power of two."""
        return self if cells == self.cells else leg_profile(self.geometry, cells)

    def __call__(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """All `FUNCTIONS` and their derivatives by theta from the table, each of shape (len(theta), 13)."""
        theta = np.asarray(theta, dtype=np.float64)
        value, slope = np.empty((theta.size, WIDTH)), np.empty((theta.size, WIDTH))
        _look_up_all(theta, self.table, value, slope)
        return value[:, : len(FUNCTIONS)], slope[:, : len(FUNCTIONS)]

    def _errors(self) -> NDArray[np.float64]:
        """Largest error of a derivative in each cell over its largest value [-], NaN without a place."""
        between = np.array([-0.49, -0.23, 0.06, 0.31, 0.48])
        theta = (np.arange(self.cells)[:, None] + between).ravel() * (2 * np.pi / self.cells)
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


def _fit(geometry: Geometry, cells: int) -> NDArray[np.float64]:
    """Interpolate at the Chebyshev points of every cell."""
    half = np.pi / cells
    nodes = np.cos(np.pi * (2 * np.arange(DEGREE + 1) + 1) / (2 * DEGREE + 2))
    theta = 2 * half * np.arange(cells)[:, None] + half * nodes
    value, _ = functions(geometry, theta.ravel())
    if geometry.full_turn and not np.isfinite(value).all():
        where = theta.ravel()[~np.isfinite(value).all(1)][0]
        raise GeometryError(
            f"geometry {geometry.name!r}: expected a leg whose links have a place at every crank angle, "
            f"but at {np.degrees(where) % 360:.2f} deg it has none"
        )
    value = value.reshape(cells, DEGREE + 1, -1).transpose(1, 0, 2).reshape(DEGREE + 1, -1)
    powers = np.linalg.solve(np.vander(nodes), value).reshape(DEGREE + 1, cells, -1)
    powers /= (half ** np.arange(DEGREE, -1, -1))[:, None, None]
    table = np.zeros((cells, DEGREE + 1, WIDTH))
    table[:, :, : powers.shape[2]] = powers.transpose(1, 0, 2)
    table[~np.isfinite(table).all((1, 2))] = np.nan
    return np.ascontiguousarray(table.reshape(cells, -1))


@inlined
def find_cell(theta, cells):  # type: ignore[no-untyped-def]
    """Number of the cell, as a float that counts turns too, and the angle from its middle [rad]."""
    cell = (theta * (cells * 0.15915494309189535) + _MAGIC) - _MAGIC
    return cell, theta - cell * (6.283185307179586 / cells)


# The look-up is written as vector instructions, which the compiler cuts to the processor's size: whether it
# finds them by itself in a plain loop hangs on the code around. Horner's scheme runs through many functions
# at once:
#
#     for p in 1 ... DEGREE:  slope = slope x + value;  value = value x + coefficient[p]

_INDEX, _DOUBLE = ir.IntType(64), ir.DoubleType()


def _place(builder: Any, start: Any, offset: Any, width: int) -> Any:
    """Pointer to `width` doubles, `offset` doubles after `start`."""
    offset = ir.Constant(_INDEX, offset) if isinstance(offset, int) else offset
    return builder.bitcast(builder.gep(start, [offset]), ir.VectorType(_DOUBLE, width).as_pointer())


def _horner(builder: Any, table: Any, row: Any, x: Any, begin: int, width: int) -> tuple[Any, Any]:
    """Values and derivatives of functions `begin` to `begin` + `width` in a row of the table."""
    vector = ir.VectorType(_DOUBLE, width)
    nothing, zeros = (
        ir.Constant(vector, ir.Undefined),
        ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width),
    )
    x = builder.insert_element(nothing, x, ir.Constant(ir.IntType(32), 0))
    x = builder.shuffle_vector(x, nothing, zeros)
    first = builder.gep(table, [builder.mul(row, ir.Constant(_INDEX, WIDTH * (DEGREE + 1)))])
    coefficients = [
        builder.load(_place(builder, first, p * WIDTH + begin, width), align=8) for p in range(DEGREE + 1)
    ]
    slope = coefficients[0]
    value = builder.fadd(builder.fmul(slope, x), coefficients[1])
    for coefficient in coefficients[2:]:
        slope = builder.fadd(builder.fmul(slope, x), value)
        value = builder.fadd(builder.fmul(value, x), coefficient)
    return value, slope


@intrinsic
def look_up(context: Any, table: Any, row: Any, x: Any, out: Any) -> Any:
    """Fill `out`, 2 WIDTH doubles, with all functions and then their derivatives, `x` [rad] from the middle
    of the cell in `row` of a table. `table` and `out` are pointers."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        table, row, x, out = values
        value, slope = _horner(builder, table, row, x, 0, WIDTH)
        builder.store(value, _place(builder, out, 0, WIDTH), align=8)
        builder.store(slope, _place(builder, out, WIDTH, WIDTH), align=8)
        return context.get_dummy_value()

    return types.void(table, row, x, out), emit


def _transpose(builder: Any, rows: list[Any]) -> list[Any]:
    """Swap rows and columns of a square of vectors, in log2 steps of exchanging blocks between pairs of
    rows."""
    size = len(rows)
    block = 1
    while block < size:
        swapped = list(rows)
        low = [i + (size - block if i & block else 0) for i in range(size)]
        high = [i + block if not i & block else size + i for i in range(size)]
        for i in range(size):
            if not i & block:
                for target, mask in ((i, low), (i + block, high)):
                    indices = ir.Constant(ir.VectorType(ir.IntType(32), size), mask)
                    swapped[target] = builder.shuffle_vector(rows[i], rows[i + block], indices)
        rows, block = swapped, 2 * block
    return rows


def _group_look_up(size: int) -> Any:
    """`look_up` for `size` lanes: row numbers (as doubles) and angles at the pointers `rows` and `xs`;
    function k of lane j goes to out[k stride + j], its derivative to out[(WIDTH + k) stride + j]."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        table, rows, xs, out, stride = values
        for begin in range(0, WIDTH, size):
            lanes = []
            for lane in range(size):
                row, x = (builder.load(builder.gep(p, [ir.Constant(_INDEX, lane)])) for p in (rows, xs))
                lanes.append(_horner(builder, table, builder.fptosi(row, _INDEX), x, begin, size))
            for part, columns in enumerate(zip(*lanes, strict=True)):
                for k, column in enumerate(_transpose(builder, list(columns))):
                    number = ir.Constant(_INDEX, part * WIDTH + begin + k)
                    builder.store(column, _place(builder, out, builder.mul(number, stride), size), align=8)
        return context.get_dummy_value()

    def look_up_group(context: Any, table: Any, rows: Any, xs: Any, out: Any, stride: Any) -> Any:
        return types.void(table, rows, xs, out, stride), emit

    return intrinsic(look_up_group)


look_up_four, look_up_eight = _group_look_up(4), _group_look_up(8)


@kernel
def _look_up_all(theta, table, value, slope):  # type: ignore[no-untyped-def]
    out = doubles(2 * WIDTH)
    row = carray(out, 2 * WIDTH)
    cells = table.shape[0]
    for n in range(theta.shape[0]):
        cell, x = find_cell(theta[n], cells)
        look_up(address(table), int(cell) & (cells - 1), x, out)
        value[n], slope[n] = row[:WIDTH], row[WIDTH:]
