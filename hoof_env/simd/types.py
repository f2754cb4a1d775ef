"""Types of lanes, their values in LLVM's terms, and a decorator for functions that write their own
instructions."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import cgutils, extending, types
from numba.core.datamodel import models
from numba.core.extending import register_model

INDEX = ir.IntType(64)
DOUBLE = ir.DoubleType()
SINGLE = ir.FloatType()
TRUTH = ir.IntType(1)
_POSITION = ir.IntType(32)


class _Counted(types.Type):
    def __init__(self, count: int) -> None:
        self.count = count
        super().__init__(f"{type(self).__name__}({count})")


class Lanes(_Counted):
    """`count` doubles, one for each lane."""


class Mask(_Counted):
    """`count` truth values, one for each lane."""


class Plane(_Counted):
    """`count` planar vectors, x and y, that multiply like complex numbers."""


class _Memory(_Counted):
    """Memory with named rows, those of `layout`, or with numbered rows if that is None; without any row if it
    is empty, as a block that an engine does not have."""

    def __init__(self, count: int, layout: Any = None, is_empty: bool = False) -> None:
        self.layout = layout
        self.is_empty = is_empty
        super().__init__(count)
        if is_empty:
            self.name = f"{self.name[:-1]}, empty)"
        if layout is not None:
            self.name = f"{self.name[:-1]}, {layout.__module__}.{layout.__qualname__})"


class Rows(_Memory):
    """Memory of a kernel with `count` doubles a row, aligned to whole rows."""


class Columns(_Memory):
    """`count` columns of an array of doubles, with a row for each name. A count of 0 is one column with
    ordinary numbers."""


def wide(element: Any, count: int) -> Any:
    """Return LLVM's type of `count` elements: a scalar if it is one."""
    return element if count == 1 else ir.VectorType(element, count)


@register_model(Lanes)
@register_model(Mask)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, wide(DOUBLE if isinstance(kind, Lanes) else TRUTH, kind.count))


@register_model(Rows)
class _RowsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Rows) -> None:
        super().__init__(manager, kind, DOUBLE.as_pointer())


@register_model(Plane)
class _PlaneModel(models.StructModel):
    def __init__(self, manager: Any, kind: Plane) -> None:
        super().__init__(manager, kind, [("real", Lanes(kind.count)), ("imag", Lanes(kind.count))])


@register_model(Columns)
class _ColumnsModel(models.StructModel):
    def __init__(self, manager: Any, kind: Columns) -> None:
        first = types.CPointer(types.float64)
        super().__init__(manager, kind, [("first", first), ("row", types.intp), ("stride", types.intp)])


def spread(builder: Any, x: Any, count: int) -> Any:
    """Return a scalar in every lane."""
    if count == 1:
        return x
    # a constant stays one, so that LLVM can compute with it
    if isinstance(x, ir.Constant):
        return ir.Constant(ir.VectorType(x.type, count), [x.constant] * count)
    nothing = ir.Constant(ir.VectorType(x.type, count), ir.Undefined)
    first = builder.insert_element(nothing, x, ir.Constant(_POSITION, 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(_POSITION, count), [0] * count))


def pick(builder: Any, x: Any, lane: int, count: int) -> Any:
    """Return one lane as a scalar."""
    return x if count == 1 else builder.extract_element(x, ir.Constant(_POSITION, lane))


def gathered(builder: Any, scalars: list[Any]) -> Any:
    """Return scalars as lanes."""
    if len(scalars) == 1:
        return scalars[0]
    vector = ir.Constant(ir.VectorType(scalars[0].type, len(scalars)), ir.Undefined)
    for lane, x in enumerate(scalars):
        vector = builder.insert_element(vector, x, ir.Constant(_POSITION, lane))
    return vector


def count_of(*kinds: Any) -> int:
    """Return the number of lanes in an operation, 0 if it is not one on lanes."""
    # 0 also for different numbers of lanes, which no operation combines
    counts = {kind.count for kind in kinds if isinstance(kind, _Counted)}
    return counts.pop() if len(counts) == 1 else 0


def is_real(kind: Any) -> bool:
    """True for types of real numbers: lanes, floats and integers."""
    return isinstance(kind, Lanes | types.Float | types.Integer)


def fused(builder: Any, sign: str, x: Any, y: Any) -> Any:
    """Return x + y or x - y by `sign`.

    If x or y is a product that was written just before (y if both are), it is not rounded: a * b + c is one
    fused operation. The expression decides this here, and not the compiler, so that it is the same for any
    number of lanes.
    """
    if _is_product(y):
        a, b = y.operands
        return call(builder, "fma", [builder.fneg(a) if sign == "-" else a, b, x])
    if _is_product(x):
        return call(builder, "fma", [*x.operands, builder.fneg(y) if sign == "-" else y])
    return builder.fadd(x, y) if sign == "+" else builder.fsub(x, y)


def _is_product(value: Any) -> bool:
    return isinstance(value, ir.Instruction) and value.opname == "fmul"


def call(builder: Any, name: str, values: list[Any]) -> Any:
    """Return a call of LLVM's own function of that name, on lanes."""
    kind = values[0].type
    full = f"llvm.{name}.{f'v{kind.count}f64' if isinstance(kind, ir.VectorType) else 'f64'}"
    function = ir.FunctionType(kind, [kind] * len(values))
    return builder.call(cgutils.get_or_insert_function(builder.module, function, full), values)


class Code(NamedTuple):
    """Place where instructions are written: numba's context, LLVM's builder, types of arguments and
    result."""

    context: Any
    builder: Any
    args: Any = ()
    result: Any = None

    def number(self, kind: Any, value: Any, count: int) -> Any:
        """Return lanes, or a Python number in every lane."""
        if isinstance(kind, Lanes):
            return value
        return spread(self.builder, self.context.cast(self.builder, value, kind, types.float64), count)

    def reals(self, *values: Any) -> list[Any]:
        """Return the arguments as lanes of the result."""
        count = getattr(self.result, "count", 1)
        return [self.number(kind, value, count) for kind, value in zip(self.args, values, strict=True)]

    def split(self, kind: Any, value: Any) -> tuple[Any, Any]:
        """Return x and y of planar vectors."""
        # take back what `join` put together: `fused` must still see products as such
        if isinstance(value, ir.instructions.InsertValue):
            return value.operands[0].operands[1], value.operands[1]
        return self.builder.extract_value(value, 0), self.builder.extract_value(value, 1)

    def planes(self, *values: Any) -> list[tuple[Any, Any]]:
        """Return x and y of each argument."""
        return [self.split(kind, value) for kind, value in zip(self.args, values, strict=True)]

    def join(self, x: Any, y: Any, kind: Any = None) -> Any:
        """Return planar vectors, of the result's type unless `kind` is given."""
        nothing = ir.Constant(self.context.get_value_type(kind or self.result), ir.Undefined)
        return self.builder.insert_value(self.builder.insert_value(nothing, x, 0), y, 1)


def instruction(typed: Callable[..., Any], literal: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator for a function for kernels that writes its own instructions: it takes a `Code` and
    LLVM's values.

    Args:
        typed: makes numba's signature from the types of the arguments.
        literal: true if constants among the arguments have literal types.
    """

    def decorate(write: Callable[..., Any]) -> Any:
        @wraps(write)
        def intrinsic(context: Any, *kinds: Any) -> Any:
            def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                result = write(Code(context, builder, signature.args, signature.return_type), *values)
                # functions without a result, such as `store_vectors`
                return context.get_dummy_value() if result is None else result

            return typed(*kinds), emit

        return extending.intrinsic(prefer_literal=literal)(intrinsic)

    return decorate
