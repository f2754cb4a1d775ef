"""Memory of kernels: the stack, arrays of the caller by their addresses, and rows of lanes in both.

On a machine that computes at once rows are a list, of which a store replaces an entry: arrays themselves do
not change, so that JAX can follow.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.simd.layout import Row, Vector, _Named
from hoof_env.simd.machines import CURRENT, wide
from hoof_env.simd.values import Index, Lanes, Plane, Value, full, vector, word

LINE = 64
"""Size of a cache line, and of the widest vector [bytes]."""

LARGE = 2**21
"""Size of a large page of the system [bytes]."""

ENOUGH = 2**22
"""Size of the smallest array for which NumPy asks for large pages [bytes]."""


def aligned(*shape: int) -> NDArray[np.float64]:
    """Return a new array of doubles, not filled, that begins at a cache line: a vector across two lines takes
    two loads.

    An array of a large page or more begins at such a page, if the system has them: otherwise each row of many
    environments lies in a page of its own, and address translation takes time. This reserves up to 4 MiB
    more, which are not touched.
    """
    size = math.prod(shape)
    item_size = np.dtype(np.float64).itemsize
    is_large = size * item_size >= LARGE
    step, least = (LARGE, ENOUGH // item_size) if is_large else (LINE, 0)
    # more than needed, so that an aligned array fits wherever NumPy's memory begins
    room = np.empty(max(size, least) + step // item_size)
    first = -room.ctypes.data % step // item_size
    return room[first : first + size].reshape(shape)


# Pointers


class Pointer(Value):
    """Place of numbers, read and written as ordinary ones."""

    __slots__ = ("item", "x")
    kind = "a pointer"

    def __init__(self, x: str, item: str = "double") -> None:
        self.x = x
        self.item = item

    def __getitem__(self, k: Any) -> Any:
        machine = CURRENT.machine
        size = {"double": 8, "float": 4, "i64": 8, "i8": 1}[self.item]
        value = machine.load(machine.at(self.x, word(k), self.item), self.item, size)
        if self.item == "i64":
            return Index(value)
        return Lanes(machine.new(f"fpext float {value} to double") if self.item == "float" else value, 0)

    def __setitem__(self, k: Any, value: Any) -> None:
        machine = CURRENT.machine
        x = full(value, 0).x
        if self.item == "float":
            x = machine.new(f"fptrunc double {x} to float")
        machine.store(machine.at(self.x, word(k), self.item), x, self.item, 8 if self.item == "double" else 4)


def doubles(count: int) -> Pointer:
    """Return a pointer to `count` doubles on the stack of the kernel."""
    return Pointer(CURRENT.machine.slot("double", max(count, 1)))


def offset(pointer: Pointer, count: Any) -> Pointer:
    """Return the pointer `count` elements further on."""
    return Pointer(CURRENT.machine.at(pointer.x, word(count), pointer.item, False), pointer.item)


def doubles_at(number: Index) -> Pointer:
    """Return a pointer to the doubles at an address."""
    return Pointer(CURRENT.machine.new(f"inttoptr i64 {number.x} to ptr"))


def singles_at(number: Index) -> Pointer:
    """Return a pointer to the singles at an address."""
    return Pointer(CURRENT.machine.new(f"inttoptr i64 {number.x} to ptr"), "float")


COLUMNS = 2
"""Offset from the slot of a matrix in an array of `Addresses` to its number of columns."""


class Addresses:
    """Addresses of some arrays, in one array of whole numbers.

    The caller must keep the arrays alive, and make new addresses for a copy.

    Attributes:
        slots: for each array, by its name, the position of its address; its shape follows there.
        begin, end: positions of the range of columns that a call works on.
    """

    def __init__(self, *names: str) -> None:
        self.slots: Any = namedtuple("Slots", names)(*range(0, 4 * len(names), 4))
        self.begin = 4 * len(names)
        self.end = 4 * len(names) + 1

    def of(self, *arrays: NDArray[Any], columns: range) -> NDArray[np.int64]:
        """Return the array of addresses. The arrays are in the order of the names, each of at most three
        axes."""
        rows = [[a.ctypes.data, *a.shape, *[0] * (3 - a.ndim)] for a in arrays]
        assert len(rows) == len(self.slots)
        return np.array([*np.ravel(rows), columns.start, columns.stop], np.int64)


class Matrix:
    """Array of the caller of two or three axes."""

    def __init__(self, first: Pointer, *shape: Any) -> None:
        self.first = first
        self.shape = shape


def matrix_at(addresses: Pointer, slot: int) -> Matrix:
    """Return the array of doubles, of two axes, at a slot of an array of `Addresses`."""
    return Matrix(doubles_at(addresses[slot]), addresses[slot + 1], addresses[slot + 2])


def cube_at(addresses: Pointer, slot: int) -> Matrix:
    """Return the array of doubles, of three axes, at a slot of an array of `Addresses`."""
    return Matrix(doubles_at(addresses[slot]), *(addresses[slot + k] for k in (1, 2, 3)))


def address(matrix: Matrix) -> Pointer:
    """Return a pointer to the first element of an array."""
    return matrix.first


def record_at(kind: np.dtype[Any], known: tuple[tuple[str, Any], ...]) -> Any:
    """Return a function for kernels that makes a `Record` from an address."""
    return lambda number: Record(doubles_at(number).x, kind, dict(known))


class Record:
    """Record of the caller: fields that are known when the kernel is traced, others are read when it runs."""

    def __init__(self, place: str, kind: np.dtype[Any], known: dict[str, Any]) -> None:
        self._place = place
        self._fields = kind.fields
        self._known = known

    def __getattr__(self, name: str) -> Any:
        if name in self._known:
            return self._known[name]
        if name not in self._fields:
            raise AttributeError(f"{name!r}, which the record has not")
        kind, start = self._fields[name][:2]
        item = {"f": "double", "i": "i64"}[kind.base.kind]
        pointer = Pointer(CURRENT.machine.at(self._place, start, "i8"), item)
        return Field(pointer, kind.shape) if kind.shape else pointer[0]


class Field:
    """Array in a record."""

    def __init__(self, first: Pointer, shape: tuple[int, ...]) -> None:
        self._first = first
        self.shape = shape

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, k: Any) -> Any:
        return self._first[k[0] * self.shape[1] + k[1] if isinstance(k, tuple) else k]


# Rows of lanes


class Rows:
    """Memory on the stack with n doubles a row, named by a layout; or, of a machine that computes at once, a
    list of arrays."""

    __slots__ = ("_empty", "_first", "_layout", "_n", "_place")

    def __init__(self, place: Any, count: int, layout: Any, first: int = 0, is_empty: bool = False) -> None:
        put = object.__setattr__
        put(self, "_place", place)
        put(self, "_n", count)
        put(self, "_layout", layout)
        put(self, "_first", first)
        put(self, "_empty", is_empty)

    # where a row is

    def _part(self, start: Any, layout: Any, is_empty: bool = False) -> Any:
        if isinstance(start, Index):
            place = CURRENT.machine.at(self._place, word(start * self._n))
            return type(self)(place, self._n, layout, self._first, is_empty)
        return type(self)(self._place, self._n, layout, self._first + start, is_empty)

    def _read(self, k: Any) -> Lanes:
        if isinstance(self._place, list):
            return Lanes(self._place[self._first + k], self._n)
        return Lanes(
            CURRENT.machine.load(self._at(k), wide("double", self._n), 8 * max(self._n, 1)), self._n
        )

    def _write(self, k: Any, value: Any) -> None:
        x = full(value, self._n).x
        if isinstance(self._place, list):
            self._place[self._first + k] = x
            return
        CURRENT.machine.store(self._at(k), x, wide("double", self._n), 8 * max(self._n, 1))

    def _at(self, k: Any) -> str:
        return CURRENT.machine.at(self._place, word((k + self._first) * max(self._n, 1)))

    # by number and by name

    def __getitem__(self, k: Any) -> Lanes:
        return full(math.nan, self._n) if self._empty else self._read(k)

    def __setitem__(self, k: Any, value: Any) -> None:
        if not self._empty:
            self._write(k, value)

    def __getattr__(self, name: str) -> Any:
        if self._layout is None or name not in self._layout.fields:
            raise AttributeError(f"{name!r}, which {self._layout and self._layout.__name__} has not")
        start, size, kind = self._layout.fields[name]
        if kind is Row:
            return self._read(start) if size else full(math.nan, self._n)
        if kind is Vector:
            return vector(self._read(start), self._read(start + 1))
        if isinstance(kind, _Named):
            return self._part(start, kind)
        return self._part(start, None, size == 0)

    def __setattr__(self, name: str, value: Any) -> None:
        start, size, kind = self._layout.fields[name]
        if kind is Vector:
            self._write(start, value.a)
            self._write(start + 1, value.b)
        elif kind is Row:
            if size:
                self._write(start, value)
        else:
            raise TypeError(f"{name}: the rows of a block or a layout are set one by one")


class Columns(Rows):
    """n columns of an array, `stride` apart, with rows that are `row` apart. Of a count of 0 it is one column
    with ordinary numbers."""

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
        return _read(Pointer(self._place), k * self._row, self._stride, self._n)

    def _write(self, k: Any, value: Any) -> None:
        _write(full(value, self._n), Pointer(self._place), k * self._row, self._stride)


def _read(pointer: Pointer, at: Any, stride: Any, n: int) -> Lanes:
    machine = CURRENT.machine
    first = machine.at(pointer.x, word(at), pointer.item, False)
    size = 8 if pointer.item == "double" else 4
    if n <= 1 or (isinstance(stride, int) and stride == 0):
        x = machine.spread(machine.load(first, pointer.item, size), n, pointer.item)
    elif isinstance(stride, int) and stride == 1:
        x = machine.load(first, wide(pointer.item, n), size)
    else:
        places = [machine.at(first, word(stride * lane), pointer.item, False) for lane in range(n)]
        x = machine.gathered([machine.load(place, pointer.item, size) for place in places], pointer.item)
    if pointer.item == "float":
        x = machine.new(f"fpext {wide('float', n)} {x} to {wide('double', n)}")
    return Lanes(x, n)


def _write(value: Lanes, pointer: Pointer, at: Any, stride: Any) -> None:
    machine, n = CURRENT.machine, value.n
    first = machine.at(pointer.x, word(at), pointer.item, False)
    size = 8 if pointer.item == "double" else 4
    x = value.x
    if pointer.item == "float":
        x = machine.new(f"fptrunc {wide('double', n)} {x} to {wide('float', n)}")
    if n <= 1:
        machine.store(first, x, pointer.item, size)
    elif isinstance(stride, int) and stride == 1:
        machine.store(first, x, wide(pointer.item, n), size)
    else:
        for lane in range(n):
            place = machine.at(first, word(stride * lane), pointer.item, False)
            machine.store(place, machine.pick(x, lane, n, pointer.item), pointer.item, size)


def rows(pointer: Pointer, count: int, layout: Any) -> Rows:
    """Return the memory at a pointer to doubles, aligned to 64 bytes, as rows of `count` lanes with the names
    of a layout, or None."""
    return Rows(pointer.x, count, layout)


def rows_of(values: list[Any], count: int, layout: Any) -> Rows:
    """Return a list of arrays, one for each row, as rows of a machine that computes at once."""
    return Rows(values, count, layout)


def columns(pointer: Pointer, count: int, layout: Any, start: Any, row: Any, stride: Any) -> Columns:
    """Return columns of an array of doubles, `stride` apart; its rows are `row` apart, and the first number of
    the first column is pointer[start]."""
    place = CURRENT.machine.at(pointer.x, word(start), inbounds=False)
    return Columns(place, count, layout, row, stride)


def block_at(rows: Rows, number: Any) -> Any:
    """Return the rows of the `number`-th of several equal layouts, the first of which is `rows`."""
    if isinstance(number, int) and number == 0:
        return rows
    return rows._part(number * rows._layout.size, rows._layout)


def load_rows(to: Rows, start: Rows) -> None:
    """Read columns into rows of the same layout."""
    for k in range(to._layout.size):
        to._write(k, start._read(k))


def read(like: Rows, pointer: Pointer, start: Any, stride: Any) -> Lanes:
    """Return pointer[start], pointer[start + stride], ... as the lanes of `like`."""
    return _read(pointer, start, stride, like._n)


def write(x: Lanes, pointer: Pointer, start: Any, stride: Any) -> None:
    """Store lanes at pointer[start], pointer[start + stride], ...; they are rounded if singles are there."""
    _write(x, pointer, start, stride)


def full_like(like: Rows, value: Any) -> Lanes:
    """Return the same value in every lane of `like`."""
    return full(value, like._n)


def set_lane(rows: Rows, row: Any, lane: Any, x: Any) -> None:
    """Store an ordinary number in one lane of a row."""
    machine = CURRENT.machine
    machine.store(machine.at(rows._at(row), word(lane)), full(x, 0).x, "double", 8)


def store_vectors(rows: Rows, vectors: tuple[Plane, ...]) -> None:
    """Store planar vectors in rows, two rows each."""
    for k, value in enumerate(vectors):
        rows[2 * k] = value.a
        rows[2 * k + 1] = value.b


def gather_eight(pointer: Any, index: Lanes) -> tuple[Lanes, ...]:
    """Return pointer[index] to pointer[index + 7] in every lane; the index is a double that holds a whole
    number."""
    from hoof_env.simd.values import transposed

    machine, n = CURRENT.machine, index.n
    if machine.runs_now:
        found = machine.table_rows(pointer, machine.whole_of(index.x), 8)
        return tuple(Lanes(x, n) for x in found)
    loaded = []
    for lane in range(max(n, 1)):
        at = machine.new(f"fptosi double {machine.pick(index.x, lane, n)} to i64")
        loaded.append(Lanes(machine.load(machine.at(pointer.x, at), wide("double", 8), 8), 8))
    columns = transposed(loaded)
    return tuple(Lanes(column.x, n) for column in columns)
