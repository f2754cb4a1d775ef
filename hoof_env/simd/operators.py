"""Operators on lanes, planes and masks."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.core.extending import infer_getattr, lower_builtin, lower_getattr
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature

from hoof_env.simd.types import Lanes, Mask, Plane, count_of, is_real, join, number, split


def _operation(function: Any, typed: Callable[..., Any], lowered: Callable[..., Any], arity: int) -> None:
    """Teach numba an operator: `typed` gives the result's type or None, `lowered` the code."""

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == arity and count_of(*args) and not kws:
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
    return Lanes(count_of(one, two)) if is_real(one) and is_real(two) else None


def _elementwise(instruction: str) -> Callable[..., Any]:
    def lowered(context: Any, builder: Any, signature: Any, one: Any, two: Any) -> Any:
        emit, (left, right), result = (
            getattr(builder, instruction),
            signature.args,
            signature.return_type,
        )
        if isinstance(result, Lanes):
            n = result.count
            return emit(number(context, builder, left, one, n), number(context, builder, right, two, n))
        (a, b), (c, d) = split(context, builder, left, one), split(context, builder, right, two)
        return join(context, builder, result, emit(a, c), emit(b, d))

    return lowered


def _product_type(one: Any, two: Any) -> Any:
    if isinstance(one, Plane) or isinstance(two, Plane):
        fits = all(isinstance(kind, Plane) or is_real(kind) for kind in (one, two))
        return Plane(count_of(one, two)) if fits else None
    return _alike(one, two)


def _product(context: Any, builder: Any, signature: Any, one: Any, two: Any) -> Any:
    (left, right), result = signature.args, signature.return_type
    n, times = result.count, builder.fmul
    if isinstance(result, Lanes):
        return times(number(context, builder, left, one, n), number(context, builder, right, two, n))
    if isinstance(left, Plane) and isinstance(right, Plane):
        (a, b), (c, d) = split(context, builder, left, one), split(context, builder, right, two)
        x, y = builder.fsub(times(a, c), times(b, d)), builder.fadd(times(a, d), times(b, c))
        return join(context, builder, result, x, y)
    if isinstance(left, Plane):
        left, one, right, two = right, two, left, one
    factor, (x, y) = number(context, builder, left, one, n), split(context, builder, right, two)
    return join(context, builder, result, times(factor, x), times(factor, y))


def _quotient_type(one: Any, two: Any) -> Any:
    return _alike(one, two) if is_real(one) and is_real(two) else None


def _negative(context: Any, builder: Any, signature: Any, z: Any) -> Any:
    kind = signature.return_type
    if isinstance(kind, Lanes):
        return builder.fneg(z)
    x, y = split(context, builder, kind, z)
    return join(context, builder, kind, builder.fneg(x), builder.fneg(y))


def _comparison(symbol: str) -> Callable[..., Any]:
    def lowered(context: Any, builder: Any, signature: Any, one: Any, two: Any) -> Any:
        n, (left, right) = signature.return_type.count, signature.args
        compare = builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered
        return compare(
            symbol, number(context, builder, left, one, n), number(context, builder, right, two, n)
        )

    return lowered


def _logic(instruction: str) -> Callable[..., Any]:
    return lambda context, builder, signature, one, two: getattr(builder, instruction)(one, two)


def _both_masks(one: Any, two: Any) -> Any:
    return one if isinstance(one, Mask) and isinstance(two, Mask) else None


def _mask_of(one: Any, two: Any) -> Any:
    return Mask(count_of(one, two)) if is_real(one) and is_real(two) else None


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
    return split(context, builder, kind, value)[0]


@lower_getattr(Plane, "imag")
def _imag(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return split(context, builder, kind, value)[1]
