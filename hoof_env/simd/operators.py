"""Operators on lanes, planes and masks, taught to numba."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.core.extending import lower_builtin, make_attribute_wrapper
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from hoof_env.simd.types import DOUBLE, Code, Lanes, Mask, Plane, count_of, fused, is_real, spread


def _operation(function: Any, typed: Callable[..., Any], lowered: Callable[..., Any], arity: int = 2) -> None:
    """Teach numba an operator: `typed` returns the result's type or None, `lowered` writes the code."""

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == arity and count_of(*args) and not kws:
                result = typed(*args)
                return signature(result, *args) if result is not None else None
            return None

    infer_global(function)(Template)

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return lowered(Code(context, builder, signature.args, signature.return_type), *values)

    kinds = (Lanes, Plane, Mask)
    patterns: list[Any] = [(kind,) for kind in kinds]
    if arity == 2:
        patterns = [(left, right) for left in kinds for right in kinds]
        for kind in kinds[:2]:
            patterns += [(kind, types.Number), (types.Number, kind)]
    for pattern in patterns:
        lower_builtin(function, *pattern)(lower)


def _of_reals(kind: Any) -> Callable[..., Any]:
    return lambda one, two: kind(count_of(one, two)) if is_real(one) and is_real(two) else None


def _sum_type(one: Any, two: Any) -> Any:
    both_planes = isinstance(one, Plane) and isinstance(two, Plane)
    return one if both_planes else _of_reals(Lanes)(one, two)


def _product_type(one: Any, two: Any) -> Any:
    if isinstance(one, Plane) or isinstance(two, Plane):
        fits = all(isinstance(kind, Plane) or is_real(kind) for kind in (one, two))
        return Plane(count_of(one, two)) if fits else None
    return _of_reals(Lanes)(one, two)


def _both_masks(one: Any, two: Any) -> Any:
    return one if isinstance(one, Mask) and isinstance(two, Mask) else None


def _quotient_type(one: Any, two: Any) -> Any:
    return one if isinstance(one, Plane) and is_real(two) else _of_reals(Lanes)(one, two)


def _quotient(code: Code, one: Any, two: Any) -> Any:
    (left, right) = code.args
    if not isinstance(left, Plane):
        return code.builder.fdiv(*code.reals(one, two))
    # a planar vector is divided by one reciprocal, since a division takes as long as several products
    per = code.builder.fdiv(
        spread(code.builder, DOUBLE(1.0), left.count), code.number(right, two, left.count)
    )
    (x, y) = code.split(left, one)
    return code.join(code.builder.fmul(x, per), code.builder.fmul(y, per))


def _sum(sign: str) -> Callable[..., Any]:
    def lowered(code: Code, one: Any, two: Any) -> Any:
        if isinstance(code.result, Lanes):
            return fused(code.builder, sign, *code.reals(one, two))
        (a, b), (c, d) = code.planes(one, two)
        return code.join(fused(code.builder, sign, a, c), fused(code.builder, sign, b, d))

    return lowered


def _product(code: Code, one: Any, two: Any) -> Any:
    (left, right) = code.args
    builder = code.builder
    times = code.builder.fmul
    if isinstance(code.result, Lanes):
        return times(*code.reals(one, two))
    if isinstance(left, Plane) and isinstance(right, Plane):
        # two planar vectors multiply like complex numbers
        (a, b), (c, d) = code.planes(one, two)
        x = fused(builder, "-", times(a, c), times(b, d))
        y = fused(builder, "+", times(a, d), times(b, c))
        return code.join(x, y)
    if isinstance(left, Plane):
        left, one, right, two = right, two, left, one
    factor = code.number(left, one, code.result.count)
    (x, y) = code.split(right, two)
    return code.join(times(factor, x), times(factor, y))


def _negative(code: Code, z: Any) -> Any:
    if isinstance(code.result, Lanes):
        return code.builder.fneg(z)
    ((x, y),) = code.planes(z)
    return code.join(code.builder.fneg(x), code.builder.fneg(y))


def _comparison(symbol: str) -> Callable[..., Any]:
    def lowered(code: Code, one: Any, two: Any) -> Any:
        # NaN differs from everything, and no other comparison with it is true
        compare = code.builder.fcmp_unordered if symbol == "!=" else code.builder.fcmp_ordered
        return compare(symbol, *code.reals(one, two))

    return lowered


def _logic(instruction: str) -> Callable[..., Any]:
    return lambda code, one, two: getattr(code.builder, instruction)(one, two)


_operation(operator.add, _sum_type, _sum("+"))
_operation(operator.sub, _sum_type, _sum("-"))
_operation(operator.mul, _product_type, _product)
_operation(operator.truediv, _quotient_type, _quotient)
_operation(operator.neg, lambda z: None if isinstance(z, Mask) else z, _negative, arity=1)
_COMPARISONS = {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
    operator.ne: "!=",
}
for _function, _symbol in _COMPARISONS.items():
    _operation(_function, _of_reals(Mask), _comparison(_symbol))
_operation(operator.and_, _both_masks, _logic("and_"))
_operation(operator.or_, _both_masks, _logic("or_"))
for _part in ("real", "imag"):
    make_attribute_wrapper(Plane, _part, _part)
