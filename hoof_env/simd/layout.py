"""Named rows of memory: `leg.load` instead of a row number.

A subclass of `Layout` lists its fields in order, each a `Row`, a planar `Vector`, a `Block`
of rows or another layout. Positions follow from the order, here and nowhere else. `Annotated[Row, note]` and
`Annotated[Block, size, note]` keep a note about a field, such as its unit; `Annotated[Row, size, note]` is a
row that some engines lack. Kernels reach the fields as attributes, of `Rows` on the stack and of `Columns` in
an array; Python reaches them by `rows` and `names`.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, NamedTuple, get_origin, get_type_hints

from numba.core import types
from numba.core.datamodel import models
from numba.core.extending import infer_getattr, register_model, typeof_impl
from numba.core.imputils import lower_constant, lower_getattr_generic, lower_setattr_generic
from numba.core.typing.templates import AttributeTemplate
from numpy.typing import NDArray

from hoof_env.simd.memory import absent_row, part_of, read_row, row_type, write_row
from hoof_env.simd.types import INDEX, Code, Columns, Plane, Rows


class Row:
    """One number for each lane."""

    size: ClassVar[int] = 1


class Vector:
    """Planar vector: two rows, x and y."""

    size: ClassVar[int] = 2


class Block:
    """Several rows that are reached by their number: `Annotated[Block, n]`, where n is a number or a
    `Size`."""


class Size(NamedTuple):
    """Default number of rows of a block, 0 or 1 of a row, which `Layout.sized` may change. With 0 it takes no
    memory; kernels may still mention its name in branches that are not taken."""

    name: str
    rows: int


class Field(NamedTuple):
    """First row of a field, its number of rows, and its kind: `Row`, `Vector`, `Block` or a layout."""

    start: int
    size: int
    kind: Any


class _Named(type):
    """Metaclass that makes the fields of a `Layout` from its annotations."""

    fields: dict[str, Field]
    notes: dict[str, Any]
    size: int
    names: tuple[str, ...]

    def __init__(cls, name: str, bases: Any, namespace: dict[str, Any]) -> None:
        super().__init__(name, bases, namespace)
        cls.fields = {}
        cls.notes = {}
        cls.size = 0
        names = []
        for key, hint in get_type_hints(cls, include_extras=True).items():
            kind, notes = _taken_apart(hint)
            size = notes.pop(0) if _has_size(kind, notes) else kind.size
            size = size.rows if isinstance(size, Size) else size
            if notes:
                cls.notes[key] = notes[0]
            cls.fields[key] = Field(cls.size, size, kind)
            cls.size += size
            names += _names(key, cls.fields[key])
        cls.names = tuple(names)

    def rows(cls, name: str) -> slice:
        """Return the rows of a field."""
        start, size, _ = cls.fields[name]
        return slice(start, start + size)

    def sized(cls, **sizes: int) -> Any:
        """Return this layout, and all inside it, with other numbers of rows for the named `Size`s."""
        return _sized(cls, tuple(sorted(sizes.items())))


class Layout(metaclass=_Named):
    """Base of all layouts; the annotations of a subclass are its fields, in order.

    Attributes:
        fields: `Field`s by name; `sized` gives the layout with other sizes of blocks.
        notes: notes about fields, by name, of those that have one.
        size: number of rows.
        names: names of the rows, those of inner fields behind their field's name.
    """


@cache
def _sized(layout: Any, sizes: tuple[tuple[str, int], ...]) -> Any:
    wanted = dict(sizes)
    hints = get_type_hints(layout, include_extras=True)
    kept = {}
    for key, hint in hints.items():
        kind, notes = _taken_apart(hint)
        if not _has_size(kind, notes):
            kept[key] = hint.sized(**wanted) if isinstance(hint, _Named) else hint
            continue
        size, *rest = notes
        if isinstance(size, Size):
            size = size._replace(rows=wanted.get(size.name, size.rows))
        kept[key] = Annotated[(kind, size, *rest)]
    # the layout itself if nothing changed: equal layouts must be one type to numba
    if kept == hints:
        return layout
    name = layout.__qualname__ + "".join(f" {key}={rows}" for key, rows in sizes)
    return _Named(name, (Layout,), {"__annotations__": kept, "__module__": layout.__module__})


def new_layout(name: str, fields: dict[str, Any]) -> Any:
    """Return a layout of fields that are known only at run time; equal names must have equal fields."""
    return _Named(name, (Layout,), {"__annotations__": fields, "__module__": __name__})


def extended(layout: Any, name: str, inner: dict[str, dict[str, Any]]) -> Any:
    """Return a layout with another field behind its own, whose parts are layouts themselves.

    Args:
        layout: layout.
        name: name of the field.
        inner: fields of each part, by the part's name.
    """
    parts = {part: new_layout(f"{part} of {fields}", fields) for part, fields in inner.items()}
    own = get_type_hints(layout, include_extras=True)
    return new_layout(f"{layout.__qualname__} with {inner}", {**own, name: new_layout(f"{inner}", parts)})


def views(layout: Any, data: NDArray[Any]) -> Any:
    """Return the fields of memory by name, as views of an array. Its first axis is the rows; the view of a
    `Row` does not have that axis."""
    fields = {}
    for name, field in layout.fields.items():
        rows = data[layout.rows(name)]
        fields[name] = rows[0] if is_row(field) else rows
    return SimpleNamespace(**fields)


def _taken_apart(hint: Any) -> tuple[Any, list[Any]]:
    """Return what an annotation is of, and what is said of it."""
    if get_origin(hint) is Annotated:
        return hint.__origin__, list(hint.__metadata__)
    return hint, []


def _has_size(kind: Any, notes: list[Any]) -> bool:
    """True if the first note about a field is its number of rows."""
    return kind is Block or bool(notes and isinstance(notes[0], Size))


def is_row(field: Field) -> bool:
    """True for one row that takes memory."""
    return field.kind is Row and field.size == 1


def _names(key: str, field: Field) -> list[str]:
    if isinstance(field.kind, _Named):
        return [f"{key}_{name}" for name in field.kind.names]
    if field.kind is Vector:
        return [f"{key}_x", f"{key}_y"]
    return [key] if is_row(field) else [f"{key}_{k}" for k in range(field.size)]


class LayoutConstant(types.Opaque):
    """Numba's type of a layout, which a kernel passes to `rows`, `columns` and `block_at`."""

    def __init__(self, layout: Any) -> None:
        self.layout = layout
        super().__init__(f"Layout({layout.__module__}.{layout.__qualname__})")


register_model(LayoutConstant)(models.OpaqueModel)


@typeof_impl.register(_Named)
def _type_of_layout(layout: Any, context: Any) -> LayoutConstant:
    return LayoutConstant(layout)


@lower_constant(LayoutConstant)
def _no_value(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.get_dummy_value()


class Constants:
    """Base of named tuples that kernels take as a whole: layouts, and numbers that the compiler must know."""


class ConstantsType(types.Opaque):
    """Numba's type of one such tuple; its values are part of the type."""

    def __init__(self, given: Any) -> None:
        self.given = given
        super().__init__(f"{type(given).__name__}({', '.join(map(_shown, given))})")


def _shown(part: Any) -> str:
    return LayoutConstant(part).name if isinstance(part, _Named) else repr(part)


register_model(ConstantsType)(models.OpaqueModel)
lower_constant(ConstantsType)(_no_value)


@typeof_impl.register(Constants)
def _type_of_constants(given: Any, context: Any) -> ConstantsType:
    return ConstantsType(given)


@infer_getattr
class _PartsOfConstants(AttributeTemplate):
    key = ConstantsType

    def generic_resolve(self, constants: Any, name: str) -> Any:  # type: ignore[override]
        part = getattr(constants.given, name)
        return LayoutConstant(part) if isinstance(part, _Named) else types.literal(part)


@lower_getattr_generic(ConstantsType)
def _get_part(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    part = getattr(kind.given, name)
    # a layout is in the type alone; there is nothing at run time
    if isinstance(part, _Named):
        return context.get_dummy_value()
    return context.get_constant(types.boolean if isinstance(part, bool) else types.intp, part)


def _vector_type(memory: Any) -> Any:
    return Plane(memory.count) if memory.count else types.complex128


class _FieldsOfMemory(AttributeTemplate):
    def generic_resolve(self, memory: Any, name: str) -> Any:  # type: ignore[override]
        field = memory.layout and memory.layout.fields.get(name)
        # None makes numba report an unknown attribute
        if not field:
            return None
        if field.kind is Row:
            return row_type(memory)
        if field.kind is Vector:
            return _vector_type(memory)
        if isinstance(field.kind, _Named):
            return type(memory)(memory.count, field.kind)
        return type(memory)(memory.count, None, is_empty=field.size == 0)


def _get_field(context: Any, builder: Any, memory: Any, value: Any, name: str) -> Any:
    field = memory.layout.fields[name]
    (start, _, kind) = field
    code = Code(context, builder)
    if kind is Row and not field.size:
        return absent_row(builder, memory)
    if kind is Row:
        return read_row(code, memory, value, INDEX(start))
    if kind is Vector:
        x, y = (read_row(code, memory, value, INDEX(start + k)) for k in range(2))
        return code.join(x, y, _vector_type(memory))
    return part_of(code, memory, value, INDEX(start))


def _set_field(context: Any, builder: Any, signature: Any, values: Any, name: str) -> Any:
    (memory, given) = signature.args
    (place, value) = values
    field = memory.layout.fields[name]
    (start, _, kind) = field
    code = Code(context, builder)
    # a whole block would need a copy of memory; kernels have no use for it
    if kind not in (Row, Vector):
        raise TypeError(f"{name}: the rows of a block or a layout are set one by one")
    if not field.size:
        return
    parts = [value] if kind is Row else code.split(given, value)
    for k, part in enumerate(parts):
        write_row(code, memory, place, INDEX(start + k), part)


for _memory in (Rows, Columns):
    infer_getattr(type(f"_{_memory.__name__}Fields", (_FieldsOfMemory,), {"key": _memory}))
    lower_getattr_generic(_memory)(_get_field)
    lower_setattr_generic(_memory)(_set_field)
