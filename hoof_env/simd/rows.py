"""Memory for lanes: rows, and how they are filled from arrays and written back."""

from __future__ import annotations

import operator
from typing import Any

from numba.core import types
from numba.core.extending import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from hoof_env.simd.memory import intrinsic
from hoof_env.simd.types import DOUBLE, INDEX, SINGLE, Lanes, Rows, gathered, is_real, number, pick, wide


@intrinsic(prefer_literal=True)
def rows(context: Any, pointer: Any, count: Any) -> Any:
    """The memory at a pointer to doubles, aligned to 64 bytes, as rows of `count` lanes, a constant."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return values[0]

    return Rows(count.literal_value)(pointer, count), emit


@intrinsic
def below(context: Any, rows: Any, row: Any) -> Any:
    """The rows from `row` on."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        offset = builder.mul(values[1], values[1].type(signature.args[0].count))
        return builder.gep(values[0], [offset], inbounds=True)

    return rows(rows, row), emit


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


@intrinsic(prefer_literal=True)
def fill(
    context: Any, rows: Any, to: Any, count: Any, pointer: Any, start: Any, row: Any, stride: Any
) -> Any:
    """`read` `count` rows, a constant, into those from `to` on; in memory they are `row` apart."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, to, _, pointer, at, row, stride = values
        for _ in range(count.literal_value):
            x = _read(builder, pointer, at, stride, signature.args[0].count)
            store_row(builder, x, rows, to, signature.args[0].count)
            to, at = builder.add(to, INDEX(1)), builder.add(at, row)
        return context.get_dummy_value()

    whole = types.intp
    return types.void(rows, whole, count, pointer, whole, whole, whole), emit


def _place(builder: Any, rows: Any, row: Any, count: int) -> Any:
    offset = builder.mul(row, INDEX(count))
    return builder.bitcast(builder.gep(rows, [offset], inbounds=True), wide(DOUBLE, count).as_pointer())


def store_row(builder: Any, x: Any, rows: Any, row: Any, count: int) -> None:
    """Put lanes into a row."""
    builder.store(x, _place(builder, rows, row, count), align=8 * count)


@infer_global(operator.getitem)
class _GetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], Rows) and isinstance(args[1], types.Integer):
            return signature(Lanes(args[0].count), *args)
        return None


@lower_builtin(operator.getitem, Rows, types.Integer)
def _get_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    count = signature.args[0].count
    row = context.cast(builder, values[1], signature.args[1], types.intp)
    return builder.load(_place(builder, values[0], row, count), align=8 * count)


@infer_global(operator.setitem)
class _SetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], Rows) and isinstance(args[1], types.Integer) and is_real(args[2]):
            return signature(types.none, *args)
        return None


@lower_builtin(operator.setitem, Rows, types.Integer, Lanes)
@lower_builtin(operator.setitem, Rows, types.Integer, types.Number)
def _set_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    count = signature.args[0].count
    row = context.cast(builder, values[1], signature.args[1], types.intp)
    x = number(context, builder, signature.args[2], values[2], count)
    store_row(builder, x, values[0], row, count)
    return context.get_dummy_value()
