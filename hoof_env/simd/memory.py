"""Memory for kernels without reference counts: the stack, addresses of a caller's arrays, and rows of lanes.

numba counts references to every array that a kernel slices, with atomic instructions; in a step of a hundred
nanoseconds that is most of the time. Arrays made by `numba.carray` from these pointers are not counted.
Memory on the stack cannot be aliased, so that loops over it become vector code, and where every index is a
constant it becomes registers.
"""

from __future__ import annotations

import math
import operator
from collections import namedtuple
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, from_dtype  # type: ignore[attr-defined]
from numba.core import cgutils, types
from numba.core.extending import lower_builtin, lower_cast
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numpy.typing import NDArray

from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.types import (
    DOUBLE,
    INDEX,
    SINGLE,
    Code,
    Columns,
    Lanes,
    Rows,
    gathered,
    instruction,
    is_real,
    pick,
    spread,
    wide,
)

LINE = 64
"""Size of a cache line, and of the widest vector [bytes]."""


LARGE = 2**21
"""Size of a large page of the system [bytes]."""

ENOUGH = 2**22
"""Size of the smallest array for which NumPy asks for large pages [bytes]."""


def aligned(*shape: int) -> NDArray[np.float64]:
    """Return a new array of doubles, not filled, that begins at a cache line: a vector across two lines takes
    two loads.

    An array of a large page or more begins at such a page, if the system has them: otherwise each row of many
    environments lies in a page of its own, and address translation takes time. This reserves up to 4 MiB
    more, which are not touched.
    """
    size = math.prod(shape)
    item_size = np.dtype(np.float64).itemsize
    is_large = size * item_size >= LARGE
    step, least = (LARGE, ENOUGH // item_size) if is_large else (LINE, 0)
    # more than needed, so that an aligned array fits wherever NumPy's memory begins
    room = np.empty(max(size, least) + step // item_size)
    first = -room.ctypes.data % step // item_size
    return room[first : first + size].reshape(shape)


# Pointers


@instruction(lambda count: types.CPointer(types.float64)(count))
def doubles(code: Code, count: Any) -> Any:
    """Return a pointer to `count` doubles on the stack of the calling function, an inlined one included; they
    are gone when it returns. Not for use in a loop, where each turn would take more of the stack."""
    place = code.builder.alloca(DOUBLE, size=count)
    place.align = LINE
    return place


@instruction(lambda array: types.CPointer(array.dtype)(array))
def address(code: Code, array: Any) -> Any:
    """Return a pointer to the first element of a C-contiguous array; the caller must keep the array alive."""
    return cgutils.create_struct_proxy(code.args[0])(code.context, code.builder, value=array).data


@instruction(lambda pointer, count: pointer(pointer, count))
def offset(code: Code, pointer: Any, count: Any) -> Any:
    """Return the pointer `count` elements further on."""
    return code.builder.gep(pointer, [count])


def _pointer_to(kind: Any) -> Any:
    """Return a function for kernels that makes a pointer to numba's type `kind` from an address, a whole
    number."""
    return instruction(lambda number: types.CPointer(kind)(types.int64))(
        lambda code, number: code.builder.inttoptr(number, code.context.get_value_type(code.result))
    )


doubles_at = _pointer_to(types.float64)
singles_at = _pointer_to(types.float32)
"""Functions for kernels that return a pointer to the doubles, or singles, at an address."""

COLUMNS = 2
"""Offset from the slot of a matrix in an array of `Addresses` to its number of columns."""


class Addresses:
    """Addresses of some arrays, in one array of whole numbers.

    A call from Python takes a tenth of a microsecond for each array; one array of addresses replaces many.
    The caller must keep the arrays alive, and make new addresses for a copy.

    Attributes:
        slots: for each array, by its name, the position of its address; its shape follows there.
        begin, end: positions of the range of columns that a call works on.
    """

    def __init__(self, *names: str) -> None:
        self.slots: Any = namedtuple("Slots", names)(*range(0, 4 * len(names), 4))
        self.begin = 4 * len(names)
        self.end = 4 * len(names) + 1

    def of(self, *arrays: NDArray[Any], columns: range) -> NDArray[np.int64]:
        """Return the array of addresses. The arrays are in the order of the names, each of at most three
        axes."""
        rows = [[a.ctypes.data, *a.shape, *[0] * (3 - a.ndim)] for a in arrays]
        assert len(rows) == len(self.slots)
        return np.array([*np.ravel(rows), columns.start, columns.stop], np.int64)


@inline_llvm
def matrix_at(addresses, slot):  # type: ignore[no-untyped-def]
    """Return the array of doubles, of two axes, at a slot of an array of `Addresses`."""
    return carray(doubles_at(addresses[slot]), (addresses[slot + 1], addresses[slot + 2]))


@inline_llvm
def cube_at(addresses, slot):  # type: ignore[no-untyped-def]
    """Return the array of doubles, of three axes, at a slot of an array of `Addresses`."""
    shape = (addresses[slot + 1], addresses[slot + 2], addresses[slot + 3])
    return carray(doubles_at(addresses[slot]), shape)


def record_at(kind: np.dtype[Any]) -> Any:
    """Return a function for kernels that makes an array of one record of a type from an address."""
    pointer = _pointer_to(from_dtype(kind))
    return inline_llvm(lambda number: carray(pointer(number), (1,)))


# Rows of lanes: on the stack, and in columns of an array


def _layout(constant: Any) -> Any:
    return getattr(constant, "layout", None)


@instruction(lambda *kinds: Rows(kinds[1].literal_value, _layout(kinds[2]))(*kinds), literal=True)
def rows(code: Code, pointer: Any, count: Any, layout: Any) -> Any:
    """Return the memory at a pointer to doubles, aligned to 64 bytes, as rows of `count` lanes, a constant,
    with the names of a layout, or None."""
    return pointer


@instruction(
    lambda pointer, count, layout, start, row, stride: Columns(count.literal_value, _layout(layout))(
        pointer, count, layout, types.intp, types.intp, types.intp
    ),
    literal=True,
)
def columns(code: Code, pointer: Any, count: Any, layout: Any, start: Any, row: Any, stride: Any) -> Any:
    """Return columns of an array of doubles, `stride` apart; its rows are `row` apart, and the first number
    of the first column is pointer[start]. They have the names of a layout, or None."""
    record = code.context.make_helper(code.builder, code.result)
    record.first = code.builder.gep(pointer, [start])
    record.row = row
    record.stride = stride
    return record._getvalue()


@instruction(lambda rows, number: rows(rows, types.intp))
def block_at(code: Code, rows: Any, number: Any) -> Any:
    """Return the rows of the `number`-th of several equal layouts one after the other, the first of which is
    `rows`."""
    return part_of(code, code.args[0], rows, code.builder.mul(number, INDEX(code.args[0].layout.size)))


def part_of(code: Code, memory: Any, value: Any, first: Any) -> Any:
    """Return the rows or columns from row `first` on."""
    builder = code.builder
    if isinstance(memory, Rows):
        return builder.gep(value, [builder.mul(first, INDEX(memory.count))], inbounds=True)
    record = code.context.make_helper(builder, memory, value=value)
    record.first = builder.gep(record.first, [builder.mul(first, record.row)])
    return record._getvalue()


def row_type(memory: Any) -> Any:
    """Return the type of a row."""
    return Lanes(memory.count) if memory.count else types.float64


def read_row(code: Code, memory: Any, value: Any, row: Any) -> Any:
    """Return the lanes of a row."""
    if isinstance(memory, Rows):
        return code.builder.load(_place(code.builder, value, row, memory.count), align=8 * memory.count)
    record = code.context.make_helper(code.builder, memory, value=value)
    at = code.builder.mul(row, record.row)
    return _read(code.builder, record.first, at, record.stride, max(memory.count, 1))


def write_row(code: Code, memory: Any, value: Any, row: Any, x: Any) -> None:
    """Store lanes in a row."""
    if isinstance(memory, Rows):
        code.builder.store(x, _place(code.builder, value, row, memory.count), align=8 * memory.count)
        return
    record = code.context.make_helper(code.builder, memory, value=value)
    at = code.builder.mul(row, record.row)
    _write(code.builder, x, record.first, at, record.stride, max(memory.count, 1))


def _place(builder: Any, rows: Any, row: Any, count: int) -> Any:
    first = builder.gep(rows, [builder.mul(row, INDEX(count))], inbounds=True)
    return builder.bitcast(first, wide(DOUBLE, count).as_pointer())


def _read(builder: Any, pointer: Any, at: Any, stride: Any, count: int) -> Any:
    """Read `count` doubles from pointer[at] on, `stride` apart: one load if they are neighbours."""
    first = builder.gep(pointer, [at])
    element = pointer.type.pointee
    if count == 1:
        loaded = builder.load(first)
    else:
        # a branch at run time, so that one kernel serves both orders of memory
        with builder.if_else(builder.icmp_signed("==", stride, INDEX(1))) as (near, far):
            with near:
                # singles may begin at any multiple of four bytes
                whole = builder.load(builder.bitcast(first, wide(element, count).as_pointer()), align=4)
                after_near = builder.block
            with far:
                places = [builder.add(at, builder.mul(stride, INDEX(lane))) for lane in range(count)]
                loads = [builder.load(builder.gep(pointer, [place])) for place in places]
                collected = gathered(builder, loads)
                after_far = builder.block
        loaded = builder.phi(whole.type)
        loaded.add_incoming(whole, after_near)
        loaded.add_incoming(collected, after_far)
    return builder.fpext(loaded, wide(DOUBLE, count)) if element == SINGLE else loaded


def _write(builder: Any, x: Any, pointer: Any, at: Any, stride: Any, count: int) -> None:
    first = builder.gep(pointer, [at])
    if pointer.type.pointee == SINGLE:
        x = builder.fptrunc(x, wide(SINGLE, count))
    if count == 1:
        builder.store(x, first)
        return
    with builder.if_else(builder.icmp_signed("==", stride, INDEX(1))) as (near, far):
        with near:
            builder.store(x, builder.bitcast(first, x.type.as_pointer()), align=4)
        with far:
            for lane in range(count):
                place = builder.add(at, builder.mul(stride, INDEX(lane)))
                builder.store(pick(builder, x, lane, count), builder.gep(pointer, [place]))


@instruction(lambda rows, pointer, start, stride: Lanes(rows.count)(rows, pointer, types.intp, types.intp))
def read(code: Code, rows: Any, pointer: Any, start: Any, stride: Any) -> Any:
    """Return pointer[start], pointer[start + stride], ... as the lanes of `rows`. Singles are widened."""
    return _read(code.builder, pointer, start, stride, code.result.count)


@instruction(lambda x, pointer, start, stride: types.void(x, pointer, types.intp, types.intp))
def write(code: Code, x: Any, pointer: Any, start: Any, stride: Any) -> None:
    """Store lanes at pointer[start], pointer[start + stride], ...; they are rounded if singles are there."""
    _write(code.builder, x, pointer, start, stride, code.args[0].count)


def _same_layout(rows: Any, columns: Any) -> Any:
    if rows.layout is not columns.layout:
        raise TypeError(f"fill: expected one layout, got {rows} and {columns}")
    return types.void(rows, columns)


@instruction(_same_layout)
def load_rows(code: Code, rows: Any, columns: Any) -> None:
    """Read columns into rows of the same layout."""
    to, start = code.args
    for k in range(to.layout.size):
        write_row(code, to, rows, INDEX(k), read_row(code, start, columns, INDEX(k)))


@instruction(lambda rows, value: Lanes(rows.count)(rows, value))
def full_like(code: Code, rows: Any, value: Any) -> Any:
    """Return the same value in every lane of `rows`."""
    return code.number(code.args[1], value, code.result.count)


@instruction(lambda x, lane: types.float64(x, types.intp))
def lane_of(code: Code, x: Any, lane: Any) -> Any:
    """Return one lane as an ordinary number."""
    return x if code.args[0].count == 1 else code.builder.extract_element(x, lane)


@instruction(lambda rows, row, lane, x: types.void(rows, types.intp, types.intp, types.float64))
def set_lane(code: Code, rows: Any, row: Any, lane: Any, x: Any) -> None:
    """Store an ordinary number in one lane of a row."""
    at = code.builder.add(code.builder.mul(row, INDEX(code.args[0].count)), lane)
    code.builder.store(x, code.builder.gep(rows, [at], inbounds=True))


@instruction(types.void)
def store_vectors(code: Code, rows: Any, vectors: Any) -> None:
    """Store a tuple of planar vectors in rows, two rows each."""
    memory, kind = code.args
    for k in range(kind.count):
        for part, x in enumerate(code.split(kind.dtype, code.builder.extract_value(vectors, k))):
            write_row(code, memory, rows, INDEX(2 * k + part), x)


@lower_cast(types.Number, Lanes)
def _to_lanes(context: Any, builder: Any, given: Any, kind: Any, value: Any) -> Any:
    return Code(context, builder).number(given, value, kind.count)


def _is_row(args: Any) -> bool:
    return isinstance(args[0], Rows | Columns) and isinstance(args[1], types.Integer)


@infer_global(operator.getitem)
class _GetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(row_type(args[0]), *args) if _is_row(args) else None


@infer_global(operator.setitem)
class _SetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(types.none, *args) if _is_row(args) and is_real(args[2]) else None


def absent_row(builder: Any, memory: Any) -> Any:
    """Return NaN as the row of a field that takes no memory, instead of what lies behind it."""
    return spread(builder, ir.Constant(DOUBLE, math.nan), max(memory.count, 1))


def _get_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    memory = signature.args[0]
    if memory.is_empty:
        return absent_row(builder, memory)
    row = context.cast(builder, values[1], signature.args[1], types.intp)
    return read_row(Code(context, builder), signature.args[0], values[0], row)


def _set_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    (memory, place, given) = signature.args
    if memory.is_empty:
        return context.get_dummy_value()
    code = Code(context, builder)
    row = context.cast(builder, values[1], place, types.intp)
    x = code.number(given, values[2], max(memory.count, 1))
    write_row(code, memory, values[0], row, x)
    return context.get_dummy_value()


for _memory in (Rows, Columns):
    lower_builtin(operator.getitem, _memory, types.Integer)(_get_row)
    for _kind in (Lanes, types.Number):
        lower_builtin(operator.setitem, _memory, types.Integer, _kind)(_set_row)
