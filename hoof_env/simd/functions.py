"""Functions of lanes and planes. Where lanes are taken floats are too, so that one function serves both."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types

from hoof_env.simd.memory import intrinsic
from hoof_env.simd.types import (
    DOUBLE,
    INDEX,
    Lanes,
    Plane,
    count_of,
    join,
    number,
    pick,
    split,
    spread,
    wide,
)


def _result(*kinds: Any) -> Any:
    """The type of a real result: lanes, or float64 if none of the arguments has lanes."""
    count = count_of(*kinds)
    return Lanes(count) if count else types.float64


def _reals(context: Any, builder: Any, signature: Any, values: Any) -> list[Any]:
    count = getattr(signature.return_type, "count", 1)
    return [
        number(context, builder, kind, value, count)
        for kind, value in zip(signature.args, values, strict=True)
    ]


@intrinsic
def plane(context: Any, x: Any, y: Any) -> Any:
    """The planar vector (x, y)."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return join(context, builder, signature.return_type, *_reals(context, builder, signature, values))

    return Plane(count_of(x, y))(x, y), emit


@intrinsic
def across(context: Any, z: Any) -> Any:
    """A planar vector turned left by a right angle."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, y = split(context, builder, signature.args[0], values[0])
        return join(context, builder, signature.args[0], builder.fneg(y), x)

    return z(z), emit


@intrinsic
def dot(context: Any, z: Any, w: Any) -> Any:
    """Scalar product of planar vectors."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        (a, b), (c, d) = (split(context, builder, *pair) for pair in zip(signature.args, values, strict=True))
        return builder.fadd(builder.fmul(a, c), builder.fmul(b, d))

    return Lanes(z.count)(z, w), emit


@intrinsic
def cross(context: Any, z: Any, w: Any) -> Any:
    """z x w, positive if w is to the left of z."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        (a, b), (c, d) = (split(context, builder, *pair) for pair in zip(signature.args, values, strict=True))
        return builder.fsub(builder.fmul(a, d), builder.fmul(b, c))

    return Lanes(z.count)(z, w), emit


@intrinsic
def choose(context: Any, condition: Any, yes: Any, no: Any) -> Any:
    """`yes` where the condition holds, else `no`, lane by lane; both real, or both planar vectors."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        result, truth = signature.return_type, values[0]
        if isinstance(result, Plane):
            (a, b), (c, d) = (split(context, builder, result, value) for value in values[1:])
            x, y = builder.select(truth, a, c), builder.select(truth, b, d)
            return join(context, builder, result, x, y)
        yes, no = (
            number(context, builder, kind, value, getattr(result, "count", 1))
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
    """start + x_0 + x_1 + ..., added in this order, in every lane; `start` is the same in all. Of lanes or of
    planar vectors."""

    def total(builder: Any, start: Any, x: Any, count: Any) -> Any:
        found = pick(builder, start, 0, count)
        for lane in range(count):
            found = builder.fadd(found, pick(builder, x, lane, count))
        return spread(builder, found, count)

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = signature.return_type
        if isinstance(kind, Lanes):
            return total(builder, values[0], values[1], kind.count)
        (a, b), (c, d) = (split(context, builder, kind, value) for value in values)
        x, y = total(builder, a, c, kind.count), total(builder, b, d, kind.count)
        return join(context, builder, kind, x, y)

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


def _shuffle(builder: Any, one: Any, two: Any, mask: list[int]) -> Any:
    return builder.shuffle_vector(one, two, ir.Constant(ir.VectorType(ir.IntType(32), len(mask)), mask))


def transposed(builder: Any, rows: list[Any], width: int) -> list[Any]:
    """The columns of rows of so many numbers, one row a lane: squares are transposed in log2 steps of
    exchanging blocks between pairs of rows."""
    n = len(rows)
    if n == 1:
        return [pick(builder, rows[0], k, width) for k in range(width)]
    found = []
    for begin in range(0, width, n):
        square = [_shuffle(builder, row, row, list(range(begin, begin + n))) for row in rows]
        block = 1
        while block < n:
            swapped = list(square)
            low = [i + (n - block if i & block else 0) for i in range(n)]
            high = [i + block if not i & block else n + i for i in range(n)]
            for i in range(n):
                if not i & block:
                    one, two = square[i], square[i + block]
                    swapped[i] = _shuffle(builder, one, two, low)
                    swapped[i + block] = _shuffle(builder, one, two, high)
            square, block = swapped, 2 * block
        found += square
    return found


@intrinsic
def gather_eight(context: Any, pointer: Any, index: Any) -> Any:
    """pointer[index] to pointer[index + 7] in every lane, eight results; the index is a double that holds a
    whole number. One conversion and one load of a vector a lane."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        count, found = getattr(signature.args[1], "count", 1), []
        for lane in range(count):
            at = builder.fptosi(pick(builder, values[1], lane, count), INDEX)
            place = builder.bitcast(builder.gep(values[0], [at]), ir.VectorType(DOUBLE, 8).as_pointer())
            found.append(builder.load(place, align=8))
        return context.make_tuple(builder, signature.return_type, transposed(builder, found, 8))

    return types.UniTuple(index, 8)(pointer, index), emit
