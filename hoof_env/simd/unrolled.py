"""Kernels that are written call by call when they are compiled, from a list that is known by then.

A function that `unrolled` decorates runs once, while a kernel is compiled. Its arguments are `Traced`: they
stand for values of the running kernel. What it calls with them, and the operators that it uses, become code
in that order, so that a loop of Python over a list becomes straight code without loops and branches.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import cgutils, types

from hoof_env.simd.memory import write_row
from hoof_env.simd.types import INDEX, Code, Plane, instruction


class Traced:
    """A value of a kernel that is being compiled: its type of numba's, and LLVM's value."""

    def __init__(self, code: Code, kind: Any, value: Any) -> None:
        self.code = code
        self.kind = kind
        self.value = value

    def __add__(self, other: Any) -> Traced:
        return call(operator.add, self, other)

    def __sub__(self, other: Any) -> Traced:
        return call(operator.sub, self, other)

    def __mul__(self, other: Any) -> Traced:
        return call(operator.mul, self, other)

    def __neg__(self) -> Traced:
        return call(operator.neg, self)

    def __getitem__(self, k: int) -> Traced:
        return call(operator.getitem, self, k)

    def __setitem__(self, k: int, value: Traced) -> None:
        call(operator.setitem, self, k, value)

    def part(self, name: str) -> Traced:
        """Return a field of rows of memory, or of a named tuple."""
        context = self.code.context
        kind = context.typing_context.resolve_getattr(self.kind, name)
        get = context.get_getattr(self.kind, name)
        return Traced(self.code, kind, get(context, self.code.builder, self.kind, self.value, name))

    def items(self) -> list[Traced]:
        """Return the parts of a tuple."""
        values = cgutils.unpack_tuple(self.code.builder, self.value, len(self.kind))
        return [Traced(self.code, kind, value) for kind, value in zip(self.kind, values, strict=True)]


def call(function: Any, *arguments: Any) -> Traced:
    """Write a call of a function for kernels; at least one argument is `Traced`, others are numbers, of which
    whole ones are indices."""
    code = next(each.code for each in arguments if isinstance(each, Traced))
    context = code.context
    traced = [each if isinstance(each, Traced) else _constant(code, each) for each in arguments]
    typing = context.typing_context
    kind = typing.resolve_value_type(function)
    signature = typing.resolve_function_type(kind, tuple(each.kind for each in traced), {})
    written = context.get_function(kind, signature)
    values = [
        context.cast(code.builder, each.value, each.kind, wanted)
        for each, wanted in zip(traced, signature.args, strict=True)
    ]
    result = written(code.builder, values)
    context.add_linking_libs(getattr(written, "libs", ()))
    return Traced(code, signature.return_type, result)


def _constant(code: Code, number: float) -> Traced:
    kind = types.intp if isinstance(number, int) else types.float64
    return Traced(code, kind, code.context.get_constant(kind, number))


@contextmanager
def when(truth: Traced) -> Iterator[None]:
    """Write what follows so that it runs where a truth of the running kernel holds."""
    with truth.code.builder.if_then(truth.value):
        yield


def store(rows: Traced, first: int, values: list[Traced]) -> None:
    """Write lanes, or planar vectors, to rows of memory one after the other, from row `first` on."""
    at = first
    for each in values:
        parts = each.code.split(each.kind, each.value) if isinstance(each.kind, Plane) else (each.value,)
        for part in parts:
            write_row(each.code, rows.kind, rows.value, INDEX(at), part)
            at += 1


def unrolled(result: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator for a function of `Traced`, which kernels then call with one tuple of its arguments.

    Args:
        result: gives numba's type of what is returned, from those of the arguments.
    """

    def decorate(write: Callable[..., Any]) -> Any:
        @instruction(lambda arguments: result(*arguments.types)(arguments), literal=True)
        def written(code: Code, arguments: Any) -> Any:
            kinds = code.args[0].types
            values = cgutils.unpack_tuple(code.builder, arguments, len(kinds))
            traced = [Traced(code, kind, value) for kind, value in zip(kinds, values, strict=True)]
            returned = write(*traced)
            return None if returned is None else returned.value

        return written

    return decorate
