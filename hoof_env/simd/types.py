"""The types of lanes, and their values in LLVM's terms."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.datamodel import models
from numba.core.extending import register_model

INDEX, DOUBLE, SINGLE, TRUTH = ir.IntType(64), ir.DoubleType(), ir.FloatType(), ir.IntType(1)
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


class _Memory(_Counted):
    """Memory whose rows have the names of `layout`, or numbers only where that is None."""

    def __init__(self, count: int, layout: Any = None) -> None:
        self.layout = layout
        super().__init__(count)
        if layout is not None:
            self.name = f"{self.name[:-1]}, {layout.__module__}.{layout.__qualname__})"


class Rows(_Memory):
    """Memory of a kernel's own with `count` doubles a row, aligned to whole rows."""


class Columns(_Memory):
    """`count` columns of an array of doubles, a row for each name; 0 is one column whose rows are ordinary
    numbers."""


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


@register_model(Columns)
class _ColumnsModel(models.StructModel):
    def __init__(self, manager: Any, kind: Columns) -> None:
        first = types.CPointer(types.float64)
        super().__init__(manager, kind, [("first", first), ("row", types.intp), ("stride", types.intp)])


def spread(builder: Any, x: Any, count: int) -> Any:
    """A scalar in every lane."""
    if count == 1:
        return x
    if isinstance(x, ir.Constant):
        return ir.Constant(ir.VectorType(x.type, count), [x.constant] * count)
    nothing = ir.Constant(ir.VectorType(x.type, count), ir.Undefined)
    first = builder.insert_element(nothing, x, ir.Constant(_POSITION, 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(_POSITION, count), [0] * count))


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


def number(context: Any, builder: Any, kind: Any, value: Any, count: int) -> Any:
    """Lanes, or a Python number in every lane."""
    if isinstance(kind, Lanes):
        return value
    return spread(builder, context.cast(builder, value, kind, types.float64), count)


def split(context: Any, builder: Any, kind: Plane, value: Any) -> tuple[Any, Any]:
    found = context.make_helper(builder, kind, value=value)
    return found.real, found.imag


def join(context: Any, builder: Any, kind: Any, x: Any, y: Any) -> Any:
    found = context.make_helper(builder, kind)
    found.real, found.imag = x, y
    return found._getvalue()


def count_of(*kinds: Any) -> int:
    """Of lanes in an operation, 0 if it is not one on lanes."""
    counts = {kind.count for kind in kinds if isinstance(kind, _Counted)}
    return counts.pop() if len(counts) == 1 else 0


def is_real(kind: Any) -> bool:
    return isinstance(kind, Lanes | types.Float | types.Integer)
