"""Memory for lanes: rows on the stack, columns of an array, and how one is filled from the other."""

from __future__ import annotations

import operator
from typing import Any

from numba.core import types
from numba.core.extending import lower_builtin, lower_cast
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from hoof_env.simd.memory import intrinsic
from hoof_env.simd.types import (
    DOUBLE,
    INDEX,
    SINGLE,
    Columns,
    Lanes,
    Rows,
    gathered,
    is_real,
    number,
    pick,
    split,
    wide,
)


@intrinsic(prefer_literal=True)
def rows(context: Any, pointer: Any, count: Any, layout: Any) -> Any:
    """The memory at a pointer to doubles, aligned to 64 bytes, as rows of `count` lanes, a constant, with the
    names of a layout, or None."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return values[0]

    return Rows(count.literal_value, getattr(layout, "layout", None))(pointer, count, layout), emit


@intrinsic(prefer_literal=True)
def columns(context: Any, pointer: Any, count: Any, layout: Any, start: Any, row: Any, stride: Any) -> Any:
    """Columns of an array of doubles, `stride` apart; its rows are `row` apart, and the first number of the
    first one is pointer[start]. They have the names of a layout, or None."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer, _, _, start, row, stride = values
        found = context.make_helper(builder, signature.return_type)
        found.first, found.row, found.stride = builder.gep(pointer, [start]), row, stride
        return found._getvalue()

    kind, whole = Columns(count.literal_value, getattr(layout, "layout", None)), types.intp
    return kind(pointer, count, layout, whole, whole, whole), emit


@intrinsic
def nth(context: Any, rows: Any, number: Any, layout: Any) -> Any:
    """The rows of the `number`-th layout of several one after the other."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        first = builder.mul(values[1], INDEX(layout.layout.size))
        return part_of(context, builder, signature.args[0], values[0], first)

    return type(rows)(rows.count, layout.layout)(rows, types.intp, layout), emit


def part_of(context: Any, builder: Any, memory: Any, value: Any, first: Any) -> Any:
    """Rows or columns from row `first` on."""
    if isinstance(memory, Rows):
        return builder.gep(value, [builder.mul(first, INDEX(memory.count))], inbounds=True)
    found = context.make_helper(builder, memory, value=value)
    found.first = builder.gep(found.first, [builder.mul(first, found.row)])
    return found._getvalue()


def row_type(memory: Any) -> Any:
    """The type of a row."""
    return Lanes(memory.count) if memory.count else types.float64


def read_row(context: Any, builder: Any, memory: Any, value: Any, row: Any) -> Any:
    """The lanes of a row."""
    if isinstance(memory, Rows):
        return builder.load(_place(builder, value, row, memory.count), align=8 * memory.count)
    found = context.make_helper(builder, memory, value=value)
    return _read(builder, found.first, builder.mul(row, found.row), found.stride, max(memory.count, 1))


def write_row(context: Any, builder: Any, memory: Any, value: Any, row: Any, x: Any) -> None:
    """Put lanes into a row."""
    if isinstance(memory, Rows):
        store_row(builder, x, value, row, memory.count)
        return
    found = context.make_helper(builder, memory, value=value)
    _write(builder, x, found.first, builder.mul(row, found.row), found.stride, max(memory.count, 1))


@lower_cast(types.Number, Lanes)
def _to_lanes(context: Any, builder: Any, given: Any, kind: Any, value: Any) -> Any:
    return number(context, builder, given, value, kind.count)


@intrinsic
def below(context: Any, rows: Any, row: Any) -> Any:
    """The rows from `row` on."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return part_of(context, builder, signature.args[0], *values)

    return type(rows)(rows.count)(rows, types.intp), emit


@intrinsic
def level(context: Any, rows: Any, value: Any) -> Any:
    """The same value in every lane of what these rows hold."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return number(context, builder, signature.args[1], values[1], signature.return_type.count)

    return Lanes(rows.count)(rows, value), emit


def _read(builder: Any, pointer: Any, at: Any, stride: Any, count: int) -> Any:
    """`count` doubles from pointer[at] on, `stride` apart: one load if they are neighbours."""
    first = builder.gep(pointer, [at])
    if count == 1:
        return as_double(builder, builder.load(first))
    with builder.if_else(builder.icmp_signed("==", stride, INDEX(1))) as (near, far):
        with near:
            one = builder.load(
                builder.bitcast(first, wide(pointer.type.pointee, count).as_pointer()), align=4
            )
            after_near = builder.block
        with far:
            places = [builder.add(at, builder.mul(stride, INDEX(lane))) for lane in range(count)]
            many = gathered(builder, [builder.load(builder.gep(pointer, [place])) for place in places])
            after_far = builder.block
    found = builder.phi(one.type)
    found.add_incoming(one, after_near)
    found.add_incoming(many, after_far)
    return as_double(builder, found)


def as_double(builder: Any, x: Any) -> Any:
    """Doubles of floats that may be single."""
    element = getattr(x.type, "element", x.type)
    return builder.fpext(x, wide(DOUBLE, getattr(x.type, "count", 1))) if element == SINGLE else x


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


@intrinsic
def read(context: Any, rows: Any, pointer: Any, start: Any, stride: Any) -> Any:
    """pointer[start], pointer[start + stride], ...: as many as the rows have lanes. Singles are widened."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        _, pointer, start, stride = values
        return _read(builder, pointer, start, stride, signature.return_type.count)

    return Lanes(rows.count)(rows, pointer, types.intp, types.intp), emit


@intrinsic
def write(context: Any, x: Any, pointer: Any, start: Any, stride: Any) -> Any:
    """Put lanes at pointer[start], pointer[start + stride], ...; rounded if singles are there."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, pointer, start, stride = values
        _write(builder, x, pointer, start, stride, signature.args[0].count)
        return context.get_dummy_value()

    return types.void(x, pointer, types.intp, types.intp), emit


@intrinsic
def fill(context: Any, rows: Any, columns: Any) -> Any:
    """Read columns into rows of the same layout."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        (to, start), (target, source) = signature.args, values
        for k in range(to.layout.size):
            x = read_row(context, builder, start, source, INDEX(k))
            write_row(context, builder, to, target, INDEX(k), x)
        return context.get_dummy_value()

    if rows.layout is not columns.layout:
        raise TypeError(f"fill: expected one layout, got {rows} and {columns}")
    return types.void(rows, columns), emit


def _place(builder: Any, rows: Any, row: Any, count: int) -> Any:
    offset = builder.mul(row, INDEX(count))
    return builder.bitcast(builder.gep(rows, [offset], inbounds=True), wide(DOUBLE, count).as_pointer())


def store_row(builder: Any, x: Any, rows: Any, row: Any, count: int) -> None:
    """Put lanes into a row."""
    builder.store(x, _place(builder, rows, row, count), align=8 * count)


_MEMORY = (Rows, Columns)


@intrinsic
def lane_of(context: Any, x: Any, lane: Any) -> Any:
    """One lane as an ordinary number."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, lane = values
        return x if signature.args[0].count == 1 else builder.extract_element(x, lane)

    return types.float64(x, types.intp), emit


@intrinsic
def set_lane(context: Any, rows: Any, row: Any, lane: Any, x: Any) -> Any:
    """Put an ordinary number into one lane of a row."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, row, lane, x = values
        at = builder.add(builder.mul(row, INDEX(signature.args[0].count)), lane)
        builder.store(x, builder.gep(rows, [at], inbounds=True))
        return context.get_dummy_value()

    return types.void(rows, types.intp, types.intp, types.float64), emit


@intrinsic
def store_vectors(context: Any, rows: Any, vectors: Any) -> Any:
    """Put a tuple of planar vectors into rows, two rows each."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = signature.args[1]
        for k in range(kind.count):
            x, y = split(context, builder, kind.dtype, builder.extract_value(values[1], k))
            write_row(context, builder, signature.args[0], values[0], INDEX(2 * k), x)
            write_row(context, builder, signature.args[0], values[0], INDEX(2 * k + 1), y)
        return context.get_dummy_value()

    return types.void(rows, vectors), emit


@infer_global(operator.getitem)
class _GetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], _MEMORY) and isinstance(args[1], types.Integer):
            return signature(row_type(args[0]), *args)
        return None


@infer_global(operator.setitem)
class _SetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], _MEMORY) and isinstance(args[1], types.Integer) and is_real(args[2]):
            return signature(types.none, *args)
        return None


def _get_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    row = context.cast(builder, values[1], signature.args[1], types.intp)
    return read_row(context, builder, signature.args[0], values[0], row)


def _set_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    memory, place, given = signature.args
    row = context.cast(builder, values[1], place, types.intp)
    x = number(context, builder, given, values[2], max(memory.count, 1))
    write_row(context, builder, memory, values[0], row, x)
    return context.get_dummy_value()


for _memory in _MEMORY:
    lower_builtin(operator.getitem, _memory, types.Integer)(_get_row)
    for _kind in (Lanes, types.Number):
        lower_builtin(operator.setitem, _memory, types.Integer, _kind)(_set_row)
