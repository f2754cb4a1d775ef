"""Numbers side by side: types for kernels that work on many environments, or many legs, in one instruction.

A `Lanes(n)` is n doubles, one for each environment; arithmetic on it is one vector instruction, or for n = 1
an ordinary one. The mechanics is written once, for a single leg, and compiled for one lane, four or eight:
no loop to vectorise, and a number has the same bits in each. `Plane(n)` is a planar vector of lanes, which
multiplies like a complex number; `Mask(n)` is truths, for `choose`; `Rows(n)` is memory, a row of lanes for
each name. Floats mix with lanes and are the same in each.

Lanes live inside kernels only: they come from `rows` and go back into them.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.extending import (
    infer_getattr,
    intrinsic,
    lower_builtin,
    lower_getattr,
    register_model,
)
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature

INDEX, DOUBLE, TRUTH = ir.IntType(64), ir.DoubleType(), ir.IntType(1)
_POSITION = ir.IntType(32)


class _Counted(types.Type):
    def __init__(self, count: int) -> None:
        self.count = count
        super().__init__(f"{type(self).__name__}({count})")


class Lanes(_Counted):
    """`count` doubles."""


class Mask(_Counted):
    """`count` truths."""


class Plane(_Counted):
    """`count` planar vectors, x and y, that multiply like complex numbers."""


class Rows(_Counted):
    """Memory with `count` doubles a row, aligned to whole rows."""


def wide(element: Any, count: int) -> Any:
    """LLVM's type of `count` elements: one is a scalar."""
    return element if count == 1 else ir.VectorType(element, count)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, wide(DOUBLE, kind.count))


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Mask) -> None:
        super().__init__(manager, kind, wide(TRUTH, kind.count))


@register_model(Plane)
class _PlaneModel(models.StructModel):
    def __init__(self, manager: Any, kind: Plane) -> None:
        super().__init__(manager, kind, [("real", Lanes(kind.count)), ("imag", Lanes(kind.count))])


@register_model(Rows)
class _RowsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Rows) -> None:
        super().__init__(manager, kind, DOUBLE.as_pointer())


# -- LLVM values ---------------------------------------------------------------------------------


def spread(builder: Any, x: Any, count: int) -> Any:
    """A scalar in every lane."""
    if count == 1:
        return x
    if isinstance(x, ir.Constant):
        return ir.Constant(ir.VectorType(x.type, count), [x.constant] * count)
    nothing = ir.Constant(ir.VectorType(x.type, count), ir.Undefined)
    first = builder.insert_element(nothing, x, ir.Constant(_POSITION, 0))
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(_POSITION, count), [0] * count)
    )


def pick(builder: Any, x: Any, lane: int, count: int) -> Any:
    """One lane as a scalar."""
    return x if count == 1 else builder.extract_element(x, ir.Constant(_POSITION, lane))


def gathered(builder: Any, scalars: list[Any]) -> Any:
    """Scalars as lanes."""
    if len(scalars) == 1:
        return scalars[0]
    found = ir.Constant(ir.VectorType(scalars[0].type, len(scalars)), ir.Undefined)
    for lane, x in enumerate(scalars):
        found = builder.insert_element(found, x, ir.Constant(_POSITION, lane))
    return found


def _number(context: Any, builder: Any, kind: Any, value: Any, count: int) -> Any:
    """Lanes, or a Python number in every lane."""
    if isinstance(kind, Lanes):
        return value
    return spread(builder, context.cast(builder, value, kind, types.float64), count)


def _split(context: Any, builder: Any, kind: Plane, value: Any) -> tuple[Any, Any]:
    found = context.make_helper(builder, kind, value=value)
    return found.real, found.imag


def _join(context: Any, builder: Any, kind: Any, x: Any, y: Any) -> Any:
    found = context.make_helper(builder, kind)
    found.real, found.imag = x, y
    return found._getvalue()


# -- Operators -----------------------------------------------------------------------------------


def _count(*kinds: Any) -> int:
    """Of lanes in an operation, 0 if it is not one on lanes."""
    counts = {kind.count for kind in kinds if isinstance(kind, _Counted)}
    return counts.pop() if len(counts) == 1 else 0


def _is_real(kind: Any) -> bool:
    return isinstance(kind, Lanes | types.Float | types.Integer)


def _operation(function: Any, typed: Callable[..., Any], lowered: Callable[..., Any], arity: int) -> None:
    """Teach numba an operator: `typed` gives the result's type or None, `lowered` the code."""

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == arity and _count(*args) and not kws:
                result = typed(*args)
                return signature(result, *args) if result is not None else None
            return None

    infer_global(function)(Template)

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return lowered(context, builder, signature, *values)

    kinds = (Lanes, Plane, Mask)
    patterns: list[Any] = [(kind,) for kind in kinds]
    if arity == 2:
        patterns = [(one, two) for one in kinds for two in kinds]
        patterns += [pair for kind in kinds[:2] for pair in ((kind, types.Number), (types.Number, kind))]
    for pattern in patterns:
        lower_builtin(function, *pattern)(lower)


def _alike(one: Any, two: Any) -> Any:
    if isinstance(one, Plane) and isinstance(two, Plane):
        return one
    return Lanes(_count(one, two)) if _is_real(one) and _is_real(two) else None


def _elementwise(instruction: str) -> Callable[..., Any]:
    def lowered(context: Any, builder: Any, signature: Any, one: Any, two: Any) -> Any:
        emit, (left, right), result = (
            getattr(builder, instruction),
            signature.args,
            signature.return_type,
        )
        if isinstance(result, Lanes):
            n = result.count
            return emit(
                _number(context, builder, left, one, n), _number(context, builder, right, two, n)
            )
        (a, b), (c, d) = _split(context, builder, left, one), _split(context, builder, right, two)
        return _join(context, builder, result, emit(a, c), emit(b, d))

    return lowered


def _product_type(one: Any, two: Any) -> Any:
    if isinstance(one, Plane) or isinstance(two, Plane):
        fits = all(isinstance(kind, Plane) or _is_real(kind) for kind in (one, two))
        return Plane(_count(one, two)) if fits else None
    return _alike(one, two)


def _product(context: Any, builder: Any, signature: Any, one: Any, two: Any) -> Any:
    (left, right), result = signature.args, signature.return_type
    n, times = result.count, builder.fmul
    if isinstance(result, Lanes):
        return times(_number(context, builder, left, one, n), _number(context, builder, right, two, n))
    if isinstance(left, Plane) and isinstance(right, Plane):
        (a, b), (c, d) = _split(context, builder, left, one), _split(context, builder, right, two)
        x, y = builder.fsub(times(a, c), times(b, d)), builder.fadd(times(a, d), times(b, c))
        return _join(context, builder, result, x, y)
    if isinstance(left, Plane):
        left, one, right, two = right, two, left, one
    factor, (x, y) = _number(context, builder, left, one, n), _split(context, builder, right, two)
    return _join(context, builder, result, times(factor, x), times(factor, y))


def _quotient_type(one: Any, two: Any) -> Any:
    return _alike(one, two) if _is_real(one) and _is_real(two) else None


def _negative(context: Any, builder: Any, signature: Any, z: Any) -> Any:
    kind = signature.return_type
    if isinstance(kind, Lanes):
        return builder.fneg(z)
    x, y = _split(context, builder, kind, z)
    return _join(context, builder, kind, builder.fneg(x), builder.fneg(y))


def _comparison(symbol: str) -> Callable[..., Any]:
    def lowered(context: Any, builder: Any, signature: Any, one: Any, two: Any) -> Any:
        n, (left, right) = signature.return_type.count, signature.args
        compare = builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered
        return compare(
            symbol, _number(context, builder, left, one, n), _number(context, builder, right, two, n)
        )

    return lowered


def _logic(instruction: str) -> Callable[..., Any]:
    return lambda context, builder, signature, one, two: getattr(builder, instruction)(one, two)


def _both_masks(one: Any, two: Any) -> Any:
    return one if isinstance(one, Mask) and isinstance(two, Mask) else None


def _mask_of(one: Any, two: Any) -> Any:
    return Mask(_count(one, two)) if _is_real(one) and _is_real(two) else None


for _function, _instruction in ((operator.add, "fadd"), (operator.sub, "fsub")):
    _operation(_function, _alike, _elementwise(_instruction), 2)
_operation(operator.mul, _product_type, _product, 2)
_operation(operator.truediv, _quotient_type, _elementwise("fdiv"), 2)
_operation(operator.neg, lambda z: None if isinstance(z, Mask) else z, _negative, 1)
for _function, _symbol in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="), (operator.ne, "!="),
):  # fmt: skip
    _operation(_function, _mask_of, _comparison(_symbol), 2)
_operation(operator.and_, _both_masks, _logic("and_"), 2)
_operation(operator.or_, _both_masks, _logic("or_"), 2)


@infer_getattr
class _PlaneParts(AttributeTemplate):
    key = Plane

    def resolve_real(self, kind: Plane) -> Lanes:
        return Lanes(kind.count)

    def resolve_imag(self, kind: Plane) -> Lanes:
        return Lanes(kind.count)


@lower_getattr(Plane, "real")
def _real(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return _split(context, builder, kind, value)[0]


@lower_getattr(Plane, "imag")
def _imag(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return _split(context, builder, kind, value)[1]


# -- Functions; where lanes are taken, floats are too, so that one function serves both -----------


def _result(*kinds: Any) -> Any:
    """The type of a real result: lanes, or float64 if none of the arguments has lanes."""
    count = _count(*kinds)
    return Lanes(count) if count else types.float64


def _reals(context: Any, builder: Any, signature: Any, values: Any) -> list[Any]:
    count = getattr(signature.return_type, "count", 1)
    return [
        _number(context, builder, kind, value, count)
        for kind, value in zip(signature.args, values, strict=True)
    ]


@intrinsic
def plane(context: Any, x: Any, y: Any) -> Any:
    """The planar vector (x, y)."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _join(
            context, builder, signature.return_type, *_reals(context, builder, signature, values)
        )

    return Plane(_count(x, y))(x, y), emit


@intrinsic
def across(context: Any, z: Any) -> Any:
    """A planar vector turned left by a right angle."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, y = _split(context, builder, signature.args[0], values[0])
        return _join(context, builder, signature.args[0], builder.fneg(y), x)

    return z(z), emit


@intrinsic
def dot(context: Any, z: Any, w: Any) -> Any:
    """Scalar product of planar vectors."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        (a, b), (c, d) = (
            _split(context, builder, *pair) for pair in zip(signature.args, values, strict=True)
        )
        return builder.fadd(builder.fmul(a, c), builder.fmul(b, d))

    return Lanes(z.count)(z, w), emit


@intrinsic
def cross(context: Any, z: Any, w: Any) -> Any:
    """z x w, positive if w is to the left of z."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        (a, b), (c, d) = (
            _split(context, builder, *pair) for pair in zip(signature.args, values, strict=True)
        )
        return builder.fsub(builder.fmul(a, d), builder.fmul(b, c))

    return Lanes(z.count)(z, w), emit


@intrinsic
def choose(context: Any, condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where the condition holds, else `no`, lane by lane; both real, or both planar vectors."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        result, truth = signature.return_type, values[0]
        if isinstance(result, Plane):
            (a, b), (c, d) = (_split(context, builder, result, value) for value in values[1:])
            x, y = builder.select(truth, a, c), builder.select(truth, b, d)
            return _join(context, builder, result, x, y)
        yes, no = (
            _number(context, builder, kind, value, getattr(result, "count", 1))
            for kind, value in zip(signature.args[1:], values[1:], strict=True)
        )
        return builder.select(truth, yes, no)

    result = yes if isinstance(yes, Plane) else _result(condition, yes, no)
    return result(condition, yes, no), emit


@intrinsic
def larger(context: Any, x: Any, y: Any) -> Any:
    """y if it is larger, else x: what is not a number stays so if it comes first."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, y = _reals(context, builder, signature, values)
        return builder.select(builder.fcmp_ordered(">", y, x), y, x)

    return _result(x, y)(x, y), emit


@intrinsic
def smaller(context: Any, x: Any, y: Any) -> Any:
    """y if it is smaller, else x: what is not a number stays so if it comes first."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, y = _reals(context, builder, signature, values)
        return builder.select(builder.fcmp_ordered("<", y, x), y, x)

    return _result(x, y)(x, y), emit


def _of_llvm(name: str, text: str) -> Any:
    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        (x,) = _reals(context, builder, signature, values)
        count = getattr(signature.return_type, "count", 1)
        full = f"{name}.{'f64' if count == 1 else f'v{count}f64'}"
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(x.type, [x.type]), full)
        return builder.call(function, [x])

    def function(context: Any, x: Any) -> Any:
        return _result(x)(x), emit

    function.__doc__ = text
    return intrinsic(function)


root = _of_llvm("llvm.sqrt", "The square root, rounded correctly.")
size = _of_llvm("llvm.fabs", "The absolute value.")
floor = _of_llvm("llvm.floor", "The largest whole number that is not above it.")


@intrinsic
def quarter_turns(context: Any, cosine: Any, sine: Any, shifted: Any) -> Any:
    """(cosine, sine) of an angle plus as many quarter turns as the last two bits of `shifted` say, a whole
    number to which 3 2^51 was added. Bits are moved, nothing is rounded or compared."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        count = getattr(signature.args[0], "count", 1)
        whole = wide(INDEX, count)
        cosine, sine, quarters = (builder.bitcast(value, whole) for value in values)

        def constant(number: int) -> Any:
            return spread(builder, INDEX(number), count)

        odd = builder.sub(constant(0), builder.and_(quarters, constant(1)))  # all bits or none
        swap = builder.and_(builder.xor(cosine, sine), odd)
        top = constant(-(2**63))
        sine_sign = builder.and_(builder.shl(quarters, constant(62)), top)
        cosine_sign = builder.and_(builder.shl(builder.add(quarters, constant(1)), constant(62)), top)
        x = builder.xor(builder.xor(cosine, swap), cosine_sign)
        y = builder.xor(builder.xor(sine, swap), sine_sign)
        both = [builder.bitcast(bits, values[0].type) for bits in (x, y)]
        return context.make_tuple(builder, signature.return_type, both)

    return types.UniTuple(cosine, 2)(cosine, sine, shifted), emit


@intrinsic
def lane_sum(context: Any, start: Any, x: Any) -> Any:
    """start + x_0 + x_1 + ..., added in this order, in every lane; `start` is the same in all."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        count = signature.return_type.count
        total = pick(builder, values[0], 0, count)
        for lane in range(count):
            total = builder.fadd(total, pick(builder, values[1], lane, count))
        return spread(builder, total, count)

    return start(start, x), emit


@intrinsic
def anywhere(context: Any, condition: Any) -> Any:
    """Whether a condition holds in any lane."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        count = signature.args[0].count
        if count == 1:
            return values[0]
        bits = ir.IntType(count)
        return builder.icmp_unsigned("!=", builder.bitcast(values[0], bits), bits(0))

    return types.boolean(condition), emit


@intrinsic
def gather(context: Any, pointer: Any, index: Any) -> Any:
    """pointer[index] in every lane; the index is a double that holds a whole number."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        count, found = getattr(signature.return_type, "count", 1), []
        for lane in range(count):
            at = builder.fptosi(pick(builder, values[1], lane, count), INDEX)
            found.append(builder.load(builder.gep(values[0], [at])))
        return gathered(builder, found)

    return index(pointer, index), emit


# -- Memory --------------------------------------------------------------------------------------


@intrinsic(prefer_literal=True)
def rows(context: Any, pointer: Any, count: Any) -> Any:
    """The memory at a pointer to doubles, aligned to 64 bytes, as rows of `count` lanes, a constant."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return values[0]

    return Rows(count.literal_value)(pointer, count), emit


@intrinsic
def below(context: Any, rows: Any, number: Any) -> Any:
    """The rows from `number` on."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        offset = builder.mul(values[1], ir.Constant(values[1].type, signature.args[0].count))
        return builder.gep(values[0], [offset], inbounds=True)

    return rows(rows, number), emit


@intrinsic
def level(context: Any, rows: Any, value: Any) -> Any:
    """The same value in every lane of what these rows hold."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _number(context, builder, signature.args[1], values[1], signature.return_type.count)

    return Lanes(rows.count)(rows, value), emit


def _read(builder: Any, pointer: Any, at: Any, stride: Any, count: int) -> Any:
    """`count` doubles from pointer[at] on, `stride` apart: one load if they are neighbours."""
    first = builder.gep(pointer, [at])
    if count == 1:
        return builder.load(first)
    with builder.if_else(builder.icmp_signed("==", stride, INDEX(1))) as (near, far):
        with near:
            one = builder.load(builder.bitcast(first, wide(DOUBLE, count).as_pointer()), align=8)
            after_near = builder.block
        with far:
            places = [builder.add(at, builder.mul(stride, INDEX(lane))) for lane in range(count)]
            many = gathered(builder, [builder.load(builder.gep(pointer, [place])) for place in places])
            after_far = builder.block
    found = builder.phi(one.type)
    found.add_incoming(one, after_near)
    found.add_incoming(many, after_far)
    return found


def _write(builder: Any, x: Any, pointer: Any, at: Any, stride: Any, count: int) -> None:
    first = builder.gep(pointer, [at])
    if count == 1:
        builder.store(x, first)
        return
    with builder.if_else(builder.icmp_signed("==", stride, INDEX(1))) as (near, far):
        with near:
            builder.store(x, builder.bitcast(first, x.type.as_pointer()), align=8)
        with far:
            for lane in range(count):
                place = builder.add(at, builder.mul(stride, INDEX(lane)))
                builder.store(pick(builder, x, lane, count), builder.gep(pointer, [place]))


@intrinsic
def read(context: Any, rows: Any, pointer: Any, start: Any, stride: Any) -> Any:
    """pointer[start], pointer[start + stride], ...: as many as the rows have lanes."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _read(builder, *values[1:], signature.return_type.count)

    return Lanes(rows.count)(rows, pointer, types.intp, types.intp), emit


@intrinsic
def write(context: Any, x: Any, pointer: Any, start: Any, stride: Any) -> Any:
    """Put lanes at pointer[start], pointer[start + stride], ..."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        _write(builder, *values, signature.args[0].count)
        return context.get_dummy_value()

    return types.void(x, pointer, types.intp, types.intp), emit


@intrinsic(prefer_literal=True)
def fill(
    context: Any, rows: Any, number: Any, count: Any, pointer: Any, start: Any, row: Any, stride: Any
) -> Any:
    """`read` `count` rows, a constant, into those from `number` on; in memory they are `row` apart."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        rows, number, _, pointer, at, row, stride = values
        for _ in range(count.literal_value):
            x = _read(builder, pointer, at, stride, signature.args[0].count)
            store_row(builder, x, rows, number, signature.args[0].count)
            number, at = builder.add(number, INDEX(1)), builder.add(at, row)
        return context.get_dummy_value()

    whole = types.intp
    return types.void(rows, whole, count, pointer, whole, whole, whole), emit


def _place(builder: Any, rows: Any, number: Any, count: int) -> Any:
    offset = builder.mul(number, ir.Constant(INDEX, count))
    return builder.bitcast(builder.gep(rows, [offset], inbounds=True), wide(DOUBLE, count).as_pointer())


def store_row(builder: Any, x: Any, rows: Any, number: Any, count: int) -> None:
    """Put lanes into a row."""
    builder.store(x, _place(builder, rows, number, count), align=8 * count)


@infer_global(operator.getitem)
class _GetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], Rows) and isinstance(args[1], types.Integer):
            return signature(Lanes(args[0].count), *args)
        return None


@lower_builtin(operator.getitem, Rows, types.Integer)
def _get_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    count = signature.args[0].count
    number = context.cast(builder, values[1], signature.args[1], types.intp)
    return builder.load(_place(builder, values[0], number, count), align=8 * count)


@infer_global(operator.setitem)
class _SetRow(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], Rows) and isinstance(args[1], types.Integer) and _is_real(args[2]):
            return signature(types.none, *args)
        return None


@lower_builtin(operator.setitem, Rows, types.Integer, Lanes)
@lower_builtin(operator.setitem, Rows, types.Integer, types.Number)
def _set_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    count = signature.args[0].count
    number = context.cast(builder, values[1], signature.args[1], types.intp)
    x = _number(context, builder, signature.args[2], values[2], count)
    store_row(builder, x, values[0], number, count)
    return context.get_dummy_value()
