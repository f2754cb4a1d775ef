"""Functions of lanes and planes. Each also takes floats, so that one function serves scalar code, too."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types

from hoof_env.simd.types import (
    DOUBLE,
    INDEX,
    Code,
    Lanes,
    Plane,
    call,
    count_of,
    fused,
    instruction,
    pick,
    spread,
    wide,
)


def _real(*kinds: Any) -> Any:
    """Return the signature of a real result: lanes, or float64 if none of the arguments has lanes."""
    count = count_of(*kinds)
    return (Lanes(count) if count else types.float64)(*kinds)


def _real_of_planes(*kinds: Any) -> Any:
    return Lanes(kinds[0].count)(*kinds)


def _like_the_first(*kinds: Any) -> Any:
    return kinds[0](*kinds)


@instruction(lambda x, y: Plane(count_of(x, y))(x, y))
def vector(code: Code, x: Any, y: Any) -> Any:
    """Return the planar vector (x, y)."""
    return code.join(*code.reals(x, y))


@instruction(_like_the_first)
def perpendicular(code: Code, z: Any) -> Any:
    """Return a planar vector turned left by a right angle."""
    ((x, y),) = code.planes(z)
    return code.join(code.builder.fneg(y), x)


@instruction(_real_of_planes)
def dot(code: Code, z: Any, w: Any) -> Any:
    """Return the scalar product of planar vectors."""
    (a, b), (c, d) = code.planes(z, w)
    return fused(code.builder, "+", code.builder.fmul(a, c), code.builder.fmul(b, d))


@instruction(_real_of_planes)
def cross(code: Code, z: Any, w: Any) -> Any:
    """Return z x w, positive if w is to the left of z."""
    (a, b), (c, d) = code.planes(z, w)
    return fused(code.builder, "-", code.builder.fmul(a, d), code.builder.fmul(b, c))


@instruction(lambda *kinds: kinds[1](*kinds) if isinstance(kinds[1], Plane) else _real(*kinds))
def where(code: Code, condition: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the condition holds, else `no`, lane by lane; both are real, or both planar
    vectors."""
    select = code.builder.select
    both = code._replace(args=code.args[1:])
    if isinstance(code.result, Plane):
        (a, b), (c, d) = both.planes(yes, no)
        return code.join(select(condition, a, c), select(condition, b, d))
    return select(condition, *both.reals(yes, no))


@instruction(_real)
def maximum(code: Code, x: Any, y: Any) -> Any:
    """Return y if it is larger, else x: NaN stays NaN if it is x."""
    x, y = code.reals(x, y)
    return code.builder.select(code.builder.fcmp_ordered(">", y, x), y, x)


@instruction(_real)
def minimum(code: Code, x: Any, y: Any) -> Any:
    """Return y if it is smaller, else x: NaN stays NaN if it is x."""
    x, y = code.reals(x, y)
    return code.builder.select(code.builder.fcmp_ordered("<", y, x), y, x)


@instruction(_real)
def sqrt(code: Code, x: Any) -> Any:
    """Return the square root, correctly rounded."""
    return call(code.builder, "sqrt", code.reals(x))


@instruction(_real)
def absolute(code: Code, x: Any) -> Any:
    """Return the absolute value."""
    return call(code.builder, "fabs", code.reals(x))


@instruction(_real)
def floor(code: Code, x: Any) -> Any:
    """Return the largest whole number that is not above x."""
    return call(code.builder, "floor", code.reals(x))


@instruction(lambda *kinds: types.UniTuple(kinds[0], 2)(*kinds))
def quarter_turns(code: Code, cosine: Any, sine: Any, shifted: Any) -> Any:
    """Return (cosine, sine) of an angle plus some quarter turns: as many as the last two bits of `shifted`
    say, a whole number to which 3 2^51 was added. Bits are moved, nothing is rounded or compared."""
    builder = code.builder
    count = getattr(code.args[0], "count", 1)
    double = cosine.type
    cosine, sine, quarters = (builder.bitcast(value, wide(INDEX, count)) for value in (cosine, sine, shifted))

    def constant(number: int) -> Any:
        return spread(builder, INDEX(number), count)

    # masks of all bits or none; x ^ ((x ^ y) & mask) exchanges x and y where the mask is set
    odd = builder.sub(constant(0), builder.and_(quarters, constant(1)))
    swap = builder.and_(builder.xor(cosine, sine), odd)
    # the sine changes its sign with the second of the two bits, the cosine with that of the next quarter
    top = constant(-(2**63))
    sine_sign = builder.and_(builder.shl(quarters, constant(62)), top)
    cosine_sign = builder.and_(builder.shl(builder.add(quarters, constant(1)), constant(62)), top)
    x = builder.xor(builder.xor(cosine, swap), cosine_sign)
    y = builder.xor(builder.xor(sine, swap), sine_sign)
    return code.context.make_tuple(builder, code.result, [builder.bitcast(bits, double) for bits in (x, y)])


@instruction(_like_the_first)
def lane_sum(code: Code, start: Any, x: Any) -> Any:
    """Return start + x_0 + x_1 + ..., added in this order, in every lane; `start` is the same in all lanes.
    Takes lanes or planar vectors."""
    builder = code.builder
    count = code.result.count

    # one lane after the other: the order of a loop over scalars, and so its bits
    def total(start: Any, x: Any) -> Any:
        total = pick(builder, start, 0, count)
        for lane in range(count):
            total = builder.fadd(total, pick(builder, x, lane, count))
        return spread(builder, total, count)

    if isinstance(code.result, Lanes):
        return total(start, x)
    (a, b), (c, d) = code.planes(start, x)
    return code.join(total(a, c), total(b, d))


@instruction(types.boolean)
def any_lane(code: Code, condition: Any) -> Any:
    """Return True if a condition holds in any lane."""
    count = code.args[0].count
    if count == 1:
        return condition
    bits = ir.IntType(count)
    return code.builder.icmp_unsigned("!=", code.builder.bitcast(condition, bits), bits(0))


def _shuffle(builder: Any, left: Any, right: Any, mask: list[int]) -> Any:
    return builder.shuffle_vector(left, right, ir.Constant(ir.VectorType(ir.IntType(32), len(mask)), mask))


def transposed(builder: Any, rows: list[Any], width: int) -> list[Any]:
    """Return the columns of rows of `width` numbers, one row a lane; both counts are powers of two.

    Squares are transposed in log2 steps that exchange blocks between pairs of rows; where rows are shorter
    than columns, squares lie side by side.
    """
    n = len(rows)
    if n == 1:
        return [pick(builder, rows[0], k, width) for k in range(width)]
    side = min(n, width)
    columns = []
    for begin in range(0, width, side):
        square = [_shuffle(builder, row, row, list(range(begin, begin + side))) for row in rows]
        size = side
        while size < n:  # rows i, i + side, i + 2 side, ... become one vector
            firsts = [k for k in range(len(square)) if not k & side]
            square = [_shuffle(builder, square[k], square[k + side], list(range(2 * size))) for k in firsts]
            size *= 2
        block = 1
        while block < side:
            swapped = list(square)
            low = [i + (n - block if i & block else 0) for i in range(n)]
            high = [i + block if not i & block else n + i for i in range(n)]
            for i in range(side):
                if not i & block:
                    upper = square[i]
                    lower = square[i + block]
                    swapped[i] = _shuffle(builder, upper, lower, low)
                    swapped[i + block] = _shuffle(builder, upper, lower, high)
            square = swapped
            block = 2 * block
        columns += square
    return columns


@instruction(lambda pointer, index: types.UniTuple(index, 8)(pointer, index))
def gather_eight(code: Code, pointer: Any, index: Any) -> Any:
    """Return pointer[index] to pointer[index + 7] in every lane, eight results; the index is a double that
    holds a whole number. It takes one conversion and one load of a vector for each lane."""
    builder = code.builder
    count = getattr(code.args[1], "count", 1)
    loaded = []
    for lane in range(count):
        at = builder.fptosi(pick(builder, index, lane, count), INDEX)
        place = builder.bitcast(builder.gep(pointer, [at]), ir.VectorType(DOUBLE, 8).as_pointer())
        loaded.append(builder.load(place, align=8))
    return code.context.make_tuple(builder, code.result, transposed(builder, loaded, 8))
