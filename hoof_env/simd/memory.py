"""Memory of kernels: rows of lanes on the stack, columns of arrays, and the arrays and records of a caller.

`Arrays` declares the arrays that a kernel takes; `Arrays.hold` makes a `Held` of them, one owner of arrays
and addresses, which is all that Python hands to machine code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NoReturn, overload

import numpy as np
from numpy.typing import NDArray

from hoof_env.simd.layout import AnyLayout, Block, Named, Row, Vector
from hoof_env.simd.machines import CURRENT, Place
from hoof_env.simd.values import (
    Index,
    Lanes,
    Mask,
    Number,
    Plane,
    TraceError,
    Value,
    Whole,
    full,
    index,
    kind_of,
    transposed,
    vector,
    word,
)

LINE = 64
"""Size of a cache line, and of the widest vector [bytes]."""

LARGE = 2**21
"""Size of a large page of the system [bytes]."""

ENOUGH = 2**22
"""Size of the smallest array for which NumPy asks for large pages [bytes]."""


def aligned(*shape: int) -> NDArray[np.float64]:
    """Return a new array of doubles, not filled, that starts at a cache line: a vector across two lines takes
    two loads.

    An array of at least a large page starts at such a page, if the system has them: otherwise each row of
    many environments lies in a separate page, and address translation takes time. This reserves up to 4 MiB
    more, which are never used.
    """
    size = math.prod(shape)
    item_size = np.dtype(np.float64).itemsize
    is_large = size * item_size >= LARGE
    step, least = (LARGE, ENOUGH // item_size) if is_large else (LINE, 0)
    # more than needed, so that an aligned array fits wherever NumPy's memory starts
    room = np.empty(max(size, least) + step // item_size)
    first = -room.ctypes.data % step // item_size
    return room[first : first + size].reshape(shape)


# Arrays of the caller

ITEMS = {"f8": "double", "f4": "float", "i8": "i64"}
"""LLVM's types for NumPy's."""


class Pointer(Value):
    """Place of numbers, read and written as ordinary ones: `pointer[k]`."""

    __slots__ = ("is_locked", "item", "x")
    kind = "a pointer"

    def __init__(self, x: Any, item: str = "double", is_locked: bool = False) -> None:
        self.x = x
        self.item = item
        self.is_locked = is_locked

    def __getitem__(self, k: Whole) -> Any:
        machine = CURRENT.machine
        place = machine.at(self.x, word(k), self.item)
        if self.item == "i64":
            return index(machine.load(place, "i64"))
        return Lanes(machine.load_real(place, self.item), 0)

    def __setitem__(self, k: Whole, value: Number) -> None:
        if self.is_locked:
            refuse_write("this array")
        machine = CURRENT.machine
        machine.store_real(machine.at(self.x, word(k), self.item), full(value, 0).x, self.item)

    def __add__(self, count: Whole) -> Pointer:
        """Return the pointer `count` elements further on."""
        return Pointer(CURRENT.machine.at(self.x, word(count), self.item, False), self.item, self.is_locked)


class Matrix:
    """Array of the caller of up to three axes.

    Attributes:
        first: pointer to its first element.
        shape: lengths of its axes.
    """

    def __init__(self, first: Pointer, shape: tuple[Any, ...]) -> None:
        self.first = first
        self.shape = shape


def refuse_write(what: str) -> NoReturn:
    """Refuse a write of a user's function to its arguments."""
    raise TraceError(
        f"assignment to {what}: a function may set only the `state` that its term declares, as"
        " step.episode.own.<term>.<row>"
    )


def _place(k: Any, size: int) -> Any:
    """Return an index from 0 into `size` elements; an index that is known only at run time stays as it is."""
    if isinstance(k, Index):
        return k
    if isinstance(k, (bool, Value)) or not hasattr(k, "__index__"):
        raise TraceError(f"an index that is {kind_of(k)}: expected a whole number below {size}")
    if not -size <= k < size:
        raise IndexError(f"no element {k}: there are {size}")
    return k if k >= 0 else size + k


class Field:
    """Array in a record: `field[k]`, or `field[k, j]` of two axes."""

    def __init__(self, first: Any, shape: tuple[int, ...]) -> None:
        self._first = first
        self.shape = shape

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, k: Any) -> Any:
        if isinstance(k, tuple):
            i, j = (_place(part, size) for part, size in zip(k, self.shape, strict=True))
            return self._first[i * self.shape[1] + j]
        return self._first[_place(k, self.shape[0] if len(self.shape) == 1 else math.prod(self.shape))]


class Record:
    """Record of the caller: fields that are known when the kernel is traced, and fields that are read when it
    runs."""

    def __init__(self, place: Any, kind: np.dtype[Any], known: Mapping[str, Any]) -> None:
        vars(self).update(_place=place, _kind=kind, _known=known)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        refuse_write(f"{name!r}")

    def __delattr__(self, name: str) -> NoReturn:
        refuse_write(f"{name!r}")

    def __getattr__(self, name: str) -> Any:
        if name in self._known:
            return self._known[name]
        fields: Mapping[str, Any] = self._kind.fields or {}
        if name not in fields:
            raise AttributeError(f"no field {name!r}; there are {', '.join(fields)}")
        kind, start = fields[name][:2]
        machine = CURRENT.machine
        item = {"f": "double", "i": "i64", "b": "i8"}[kind.base.kind]
        pointer = Pointer(machine.field(self._place, name, start), item)
        if item == "i8":
            return Mask(machine.load_truth(pointer.x), 0)
        return Field(pointer, kind.shape) if kind.shape else pointer[0]


class RecordType:
    """Type of a record that a kernel takes.

    Args:
        kind: NumPy's type.
        known: values of the fields that are known when the kernel is traced.
    """

    def __init__(self, kind: np.dtype[Any], known: Mapping[str, Any]) -> None:
        self.kind = kind
        self.known = known


class Held(int):
    """Address of the addresses of some arrays, which all live as long as it does."""

    arrays: dict[str, NDArray[Any]]
    numbers: NDArray[np.int64]
    columns: range

    @classmethod
    def of(cls, arrays: dict[str, NDArray[Any]], numbers: NDArray[np.int64], columns: range) -> Held:
        """Return arrays with their addresses and shapes; the last two numbers become the columns."""
        numbers[-2:] = columns.start, columns.stop
        held = cls(numbers.ctypes.data)
        held.arrays, held.numbers, held.columns = arrays, numbers, columns
        return held

    def on(self, columns: range) -> Held:
        """Return the same arrays for a call on different columns."""
        return self if columns == self.columns else Held.of(self.arrays, self.numbers.copy(), columns)

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "addresses are valid in one process only: expected the arrays to be copied, and held again"
        )

    def __deepcopy__(self, memo: Any) -> NoReturn:
        self.__reduce__()


AXES = 3
"""Largest number of axes of an array."""


class Arrays:
    """Arrays that a kernel takes, by name: one argument for all, since each takes a tenth of a microsecond.

    Args:
        types: type of each array by its name: "f8", "f4", "i8", or a `RecordType`.
    """

    def __init__(self, types: Mapping[str, str | RecordType]) -> None:
        self.types = dict(types)
        self.slots = {name: k * (1 + AXES) for k, name in enumerate(self.types)}
        self.begin = len(self.types) * (1 + AXES)

    def hold(self, arrays: Mapping[str, NDArray[Any]], columns: range = range(0)) -> Held:
        """Return the arrays as an argument of a kernel, with the columns that it works on.

        Raises:
            TypeError: an array is missing, is of another type, or is not contiguous.
        """
        numbers = np.zeros(self.begin + 2, np.int64)
        kept = {}
        for name, kind in self.types.items():
            if not isinstance(array := arrays.get(name), np.ndarray):
                raise TypeError(f"{name}: expected an array, got {array!r}")
            kept[name] = array
            dtype = kind.kind if isinstance(kind, RecordType) else np.dtype(kind)
            if array.dtype != dtype or not array.flags.c_contiguous or array.ndim > AXES:
                raise TypeError(
                    f"{name}: expected a contiguous array of {dtype}, got {array.dtype}, {array.flags}"
                )
            first = self.slots[name]
            numbers[first] = array.ctypes.data
            numbers[first + 1 : first + 1 + array.ndim] = array.shape
        return Held.of(kept, numbers, columns)


class Given:
    """Arrays inside a kernel: `given.name` is a `Matrix` or a `Record`.

    Attributes:
        begin, end: range of the call's columns.
    """

    def __init__(self, arrays: Arrays, x: Any) -> None:
        self._arrays = arrays
        self._x = x
        if CURRENT.machine.runs_now:
            self.begin, self.end = x.columns.start, x.columns.stop
        else:
            numbers = Pointer(x, "i64")
            self.begin, self.end = numbers[arrays.begin], numbers[arrays.begin + 1]

    def __getattr__(self, name: str) -> Any:
        kind = self._arrays.types.get(name)
        if kind is None:
            raise AttributeError(f"no array {name!r}; there are {', '.join(self._arrays.types)}")
        machine = CURRENT.machine
        if machine.runs_now:
            array = self._x.arrays[name]
            place, shape = Place(array.reshape(-1)), array.shape
        else:
            numbers, first = Pointer(self._x, "i64"), self._arrays.slots[name]
            place = machine.pointer(word(numbers[first]))
            shape = tuple(numbers[first + 1 + k] for k in range(AXES))
        if isinstance(kind, RecordType):
            return Record(place, kind.kind, kind.known)
        return Matrix(Pointer(place, ITEMS[kind]), shape)


# Rows of lanes


class Rows:
    """Memory on the stack with n doubles a row, named by a layout. On a machine that computes at once it
    is a list of arrays, and a store replaces an entry: arrays themselves do not change.

    `locked` gives the same rows to functions that may not write them: `_open` is then None, or the path
    of field names to the rows that they may set nevertheless; else it is (). `_size` is
    the number of rows and `_legs` the number of consecutive equal layouts, against which indices of such
    functions are checked; None for rows of the package itself.
    """

    __slots__ = ("_empty", "_first", "_layout", "_legs", "_n", "_open", "_place", "_size")
    kind = "memory"

    def __init__(self, place: Any, count: int, layout: Any, first: int = 0, is_empty: bool = False) -> None:
        put = object.__setattr__
        put(self, "_place", place)
        put(self, "_n", count)
        put(self, "_layout", layout)
        put(self, "_first", first)
        put(self, "_empty", is_empty)
        put(self, "_open", ())
        put(self, "_size", None)
        put(self, "_legs", None)

    @property
    def lanes(self) -> int:
        """Number of lanes."""
        return self._n

    def __repr__(self) -> str:
        """Return the names of the fields or, on a machine that computes at once, their values."""
        names = () if self._layout is None else tuple(self._layout.fields)
        if not (names and CURRENT.machine.runs_now):
            return f"rows of {', '.join(names) or 'numbers'}"
        parts = {name: repr(getattr(self, name)) for name in names}
        return "\n".join(
            f"{name}: " + ("\n" + part if "\n" in part else part).replace("\n", "\n  ")
            for name, part in parts.items()
        )

    # where a row is

    def _part(self, start: Any, layout: Any, is_empty: bool = False) -> Any:
        if isinstance(start, Index):
            place = CURRENT.machine.at(self._place, word(start * max(self._n, 1)))
            return Rows(place, self._n, layout, self._first, is_empty)
        return Rows(self._place, self._n, layout, self._first + start, is_empty)

    def _read(self, k: Any) -> Lanes:
        if isinstance(self._place, list):
            return Lanes(self._place[self._first + k], self._n)
        return Lanes(CURRENT.machine.load(self._at(k), "double", self._n, 8 * max(self._n, 1)), self._n)

    def _write(self, k: Any, value: Any) -> None:
        x = full(value, self._n).x
        if isinstance(self._place, list):
            self._place[self._first + k] = x
            return
        CURRENT.machine.store(self._at(k), x, "double", self._n, 8 * max(self._n, 1))

    def _at(self, k: Any) -> Any:
        return CURRENT.machine.at(self._place, word((k + self._first) * max(self._n, 1)))

    # by number and by name

    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        if self._open != ():
            raise TraceError(f"a comparison of memory with {kind_of(other)}: expected its numbers")
        return self is other

    def __len__(self) -> int:
        if self._size is None:
            raise TypeError("these rows have no length")
        return int(self._size)

    def __bool__(self) -> bool:
        if self._open != ():
            raise TraceError("`if`, `and`, `or` or `not` of memory: expected a condition of its numbers")
        return True

    def __array__(self, *arguments: Any, **named: Any) -> Any:
        raise TraceError("a NumPy function of memory: expected its numbers, by name or number")

    def __getitem__(self, k: Any) -> Lanes:
        if self._empty:
            return full(math.nan, self._n)
        return self._read(k if self._size is None else _place(k, self._size))

    def __setitem__(self, k: Any, value: Any) -> None:
        self._check_open(f"[{k}]")
        if not self._empty:
            self._write(k if self._size is None else _place(k, self._size), value)

    def __delitem__(self, k: Any) -> NoReturn:
        refuse_write("a row")

    def _check_open(self, name: str) -> None:
        if self._open != ():
            refuse_write(name if name.startswith("[") else repr(name))

    def __getattr__(self, name: str) -> Any:
        if self._layout is None or name not in self._layout.fields:
            raise AttributeError(_no_field(self._layout, name))
        start, size, kind = self._layout.fields[name]
        if kind is Row:
            return self._read(start) if size else full(math.nan, self._n)
        if kind is Vector:
            return vector(self._read(start), self._read(start + 1))
        if isinstance(kind, Named):
            return self._inside(name, self._part(start, kind))
        return self._inside(name, self._part(start, None, size == 0))

    def _inside(self, name: str, part: Any) -> Any:
        """Return a part that is checked, and may be written, if this is."""
        if self._size is not None:
            start, size, _ = self._layout.fields[name]
            is_open = self._open is not None and self._open[:1] in ((), (name,))
            part._check(size, self._open[1:] if is_open else None)
            room = (self._layout.size - start) // max(size, 1)
            object.__setattr__(part, "_legs", 1 if part._open == () else room)
        return part

    def _check(self, size: int | None, may_set: tuple[str, ...] | None) -> None:
        """Check indices from now on, and refuse to set rows except at the path `may_set`."""
        object.__setattr__(self, "_size", size)
        object.__setattr__(self, "_open", may_set)

    def __delattr__(self, name: str) -> NoReturn:
        refuse_write(f"{name!r}")

    def __setattr__(self, name: str, value: Any) -> None:
        if self._layout is None or name not in self._layout.fields:
            raise AttributeError(_no_field(self._layout, name))
        self._check_open(name)
        start, size, kind = self._layout.fields[name]
        if kind is Vector:
            if not isinstance(value, Plane):
                raise TraceError(f"{kind_of(value)} in place of a planar vector, {name!r}")
            self._write(start, value.a)
            self._write(start + 1, value.b)
        elif kind is Row:
            if size:
                self._write(start, value)
        else:
            raise TypeError(f"{name}: the rows of a block or a layout are set one by one")


def _no_field(layout: Any, name: str) -> str:
    if layout is None:
        return f"no field {name!r}: these rows have numbers only"
    title = layout.__name__.split()[0]  # without the sizes of blocks
    return f"no field {name!r}; {title if title.isidentifier() else 'it'} has {', '.join(layout.fields)}"


def locked(rows: Any, but: tuple[str, ...] = (), legs: int = 1) -> Any:
    """Return rows, or another argument of a user's function, in a form that it cannot write.

    Args:
        rows: rows, a pointer, a matrix, or a named tuple of these.
        but: path of names to the field whose rows it may set.
        legs: number of consecutive equal layouts in the field `leg`, for `block_at`.
    """
    if isinstance(rows, Rows):
        view = object.__new__(type(rows))
        for name in ("_place", "_n", "_layout", "_first", "_empty", "_row", "_stride"):
            if hasattr(type(rows), name):
                object.__setattr__(view, name, getattr(rows, name))
        view._check(rows._layout and rows._layout.size, but or None)
        object.__setattr__(view, "_legs", legs)
        return view
    if isinstance(rows, Pointer):
        return Pointer(rows.x, rows.item, True)
    if isinstance(rows, Matrix):
        return Matrix(locked(rows.first), rows.shape)
    if isinstance(rows, tuple) and hasattr(rows, "_fields"):
        parts = zip(rows._fields, rows, strict=True)
        return type(rows)(*(locked(part, but, legs if name == "leg" else 1) for name, part in parts))
    return rows


class Columns(Rows):
    """n columns of an array, `stride` apart, with rows that are `row` apart. With a count of 0 it is one
    column of ordinary numbers."""

    __slots__ = ("_row", "_stride")

    def __init__(
        self, place: Any, count: int, layout: Any, row: Any, stride: Any, is_empty: bool = False
    ) -> None:
        super().__init__(place, count, layout, 0, is_empty)
        object.__setattr__(self, "_row", row)
        object.__setattr__(self, "_stride", stride)

    def _part(self, start: Any, layout: Any, is_empty: bool = False) -> Any:
        place = CURRENT.machine.at(self._place, word(start * self._row), inbounds=False)
        return Columns(place, self._n, layout, self._row, self._stride, is_empty)

    def _read(self, k: Any) -> Lanes:
        return read(Pointer(self._place), k * self._row, self._stride, self._n)

    def _write(self, k: Any, value: Any) -> None:
        write(full(value, self._n), Pointer(self._place), k * self._row, self._stride)


def read(pointer: Pointer, start: Whole, stride: Whole, n: int) -> Lanes:
    """Return pointer[start], pointer[start + stride], ... as n lanes."""
    machine, item = CURRENT.machine, pointer.item
    first = machine.at(pointer.x, word(start), item, False)
    if n <= 1 or (isinstance(stride, int) and stride == 0):
        x = machine.load_real(first, item)
        return Lanes(machine.spread(x, n) if n else x, n)
    if isinstance(stride, int) and stride == 1:
        return Lanes(machine.load_real(first, item, n), n)
    places = [machine.at(first, word(stride * lane), item, False) for lane in range(n)]
    return Lanes(machine.gathered([machine.load_real(place, item) for place in places]), n)


def write(x: Lanes, pointer: Pointer, start: Whole, stride: Whole) -> None:
    """Store lanes at pointer[start], pointer[start + stride], ...; they are rounded if singles are there."""
    if pointer.is_locked:
        refuse_write("this array")
    machine, item, n = CURRENT.machine, pointer.item, x.n
    first = machine.at(pointer.x, word(start), item, False)
    if n <= 1:
        machine.store_real(first, machine.single(x.x) if n else x.x, item)
    elif isinstance(stride, int) and stride == 1:
        machine.store_real(first, x.x, item, n)
    else:
        for lane in range(n):
            place = machine.at(first, word(stride * lane), item, False)
            machine.store_real(place, machine.pick(x.x, lane, n), item)


@overload
def new_rows(layout: None, lanes: int, count: int = 1) -> Block: ...
@overload
def new_rows(layout: type[AnyLayout], lanes: int, count: int = 1) -> AnyLayout: ...
def new_rows(layout: Any, lanes: int, count: int = 1) -> Any:
    """Return memory on the stack of the kernel, `count` times the rows of a layout, or `count` unnamed rows
    if `layout` is None."""
    size = count * (1 if layout is None else layout.size)
    if CURRENT.machine.runs_now:
        return Rows([None] * size, lanes, layout)
    return Rows(CURRENT.machine.slot("double", size * max(lanes, 1)), lanes, layout)


@overload
def columns(
    matrix: Matrix, lanes: int, layout: None, column: Whole, row: Whole = 0, stride: Whole = 1
) -> Block: ...
@overload
def columns(
    matrix: Matrix, lanes: int, layout: type[AnyLayout], column: Whole, row: Whole = 0, stride: Whole = 1
) -> AnyLayout: ...
def columns(matrix: Matrix, lanes: int, layout: Any, column: Whole, row: Whole = 0, stride: Whole = 1) -> Any:
    """Return columns of a matrix of two axes by the names of a layout.

    Args:
        matrix: array.
        lanes: number of columns side by side; 0 for one with ordinary numbers.
        layout: names of the rows from `row` on; None for numbers only.
        column: first of the columns.
        row: first of the rows.
        stride: distance from one lane to the next [elements].
    """
    width = matrix.shape[1]
    place = CURRENT.machine.at(matrix.first.x, word(row * width + column), inbounds=False)
    made = Columns(place, lanes, layout, width, stride)
    return locked(made) if matrix.first.is_locked else made


def block_at(first: AnyLayout, number: Whole) -> AnyLayout:
    """Return the rows of the `number`-th of several equal layouts, of which the first is given."""
    rows: Any = first
    is_checked, legs = rows._size is not None, rows._legs
    if is_checked:
        number = _place(number, legs)
    if isinstance(number, int) and number == 0:
        return first
    part: Any = rows._part(number * rows._layout.size, rows._layout)
    if is_checked:
        part._check(rows._size, rows._open)
        object.__setattr__(part, "_legs", 1 if isinstance(number, Index) else legs - number)
    return part


def load_rows(to: AnyLayout, start: AnyLayout) -> None:
    """Read columns into rows of the same layout."""
    rows: Any = to
    read_from: Any = start
    rows._check_open("rows")
    for k in range(rows._layout.size):
        rows._write(k, read_from._read(k))


def full_like(like: Any, value: Number) -> Lanes:
    """Return the same value in every lane of rows."""
    return full(value, like._n)


def apply_to_rows(rows: Any, count: int, function: Any, width: int) -> None:
    """Set each of the first rows, which have no names, to a function of it. Rows of one lane are taken
    `width` at
    a time: `count` is a multiple of it, and there is memory for as many."""
    rows._check_open("rows")
    if rows._n == 1 and not CURRENT.machine.runs_now:
        rows = Rows(rows._place, width, None)
        count //= width
    for k in range(count):
        rows[k] = function(rows[k])


def store_vectors(rows: Any, vectors: tuple[Plane, ...]) -> None:
    """Store planar vectors in rows, two rows each."""
    for k, value in enumerate(vectors):
        rows[2 * k] = value.a
        rows[2 * k + 1] = value.b


def gather_eight(pointer: Pointer, first: Lanes) -> tuple[Lanes, ...]:
    """Return pointer[first] to pointer[first + 7] in every lane; `first` is a double that holds a whole
    number."""
    machine, n = CURRENT.machine, first.n
    if machine.runs_now:
        return tuple(Lanes(x, n) for x in machine.table_rows(pointer.x, machine.whole_of(first.x), 8))
    loaded = []
    for lane in range(max(n, 1)):
        at = machine.real_to_index(machine.pick(first.x, lane, n))
        loaded.append(Lanes(machine.load(machine.at(pointer.x, at), "double", 8), 8))
    return tuple(Lanes(column.x, n) for column in transposed(loaded))
