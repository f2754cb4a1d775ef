"""Memory for kernels without reference counts: the stack, and the addresses of a caller's arrays.

numba counts references to every array that a kernel slices, with atomic instructions; in a step of a
hundred nanoseconds that is most of the time. Arrays made by `numba.carray` from these pointers are not
counted. Memory on the stack cannot be aliased, so that loops over it become vector code,
and where every index is a constant it becomes registers.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, from_dtype  # type: ignore[attr-defined]
from numba.core import cgutils, extending, types
from numpy.typing import NDArray

LINE = 64
"""Bytes of a line of the cache, and of the widest vector."""


def aligned(*shape: int) -> NDArray[np.float64]:
    """A new array of doubles, not filled, that begins with a line of the cache: a vector that lies across two
    takes two loads."""
    size, each = math.prod(shape), np.dtype(np.float64).itemsize
    room = np.empty(size + LINE // each)
    first = -room.ctypes.data % LINE // each
    return room[first : first + size].reshape(shape)


intrinsic: Any = extending.intrinsic
"""numba's decorator for functions that write their own instructions; it adds their first argument."""


@intrinsic
def doubles(context: Any, count: Any) -> Any:
    """A pointer to `count` doubles on the stack of the function that calls it, gone when that returns, an
    inlined one included; not for use in a loop."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = builder.alloca(ir.DoubleType(), size=values[0])
        place.align = LINE
        return place

    return types.CPointer(types.float64)(count), emit


@intrinsic
def address(context: Any, array: Any) -> Any:
    """A pointer to the first element of a C-contiguous array; the caller keeps the array alive."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return cgutils.create_struct_proxy(signature.args[0])(context, builder, value=values[0]).data

    return types.CPointer(array.dtype)(array), emit


@intrinsic
def offset(context: Any, pointer: Any, count: Any) -> Any:
    """The pointer `count` elements further on."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.gep(values[0], [values[1]])

    return pointer(pointer, count), emit


def _pointer_to(kind: Any) -> Any:
    """A function for kernels that makes a pointer to numba's type `kind` of an address, a whole number."""

    def pointer(context: Any, number: Any) -> Any:
        def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

        return types.CPointer(kind)(types.int64), emit

    return intrinsic(pointer)


doubles_at, singles_at = _pointer_to(types.float64), _pointer_to(types.float32)
"""For kernels: a pointer to what is at an address."""

COLUMNS = 2
"""Behind the slot of a matrix in an array of `Addresses`: how many columns it has."""


class Addresses:
    """Where some arrays are, in one array of whole numbers.

    A call from Python takes a tenth of a microsecond for each array; one array of addresses replaces many.
    Whoever makes it keeps the arrays alive, and makes it anew for a copy.

    Args:
        names: of the arrays.

    Attributes:
        slots: by name, where the address of each is; behind it its shape.
    """

    def __init__(self, *names: str) -> None:
        self.slots: Any = namedtuple("Slots", names)(*range(0, 4 * len(names), 4))

    def of(self, *arrays: NDArray[Any]) -> NDArray[np.int64]:
        """The array of addresses; the arrays in the order of the names, each of three axes at most."""
        rows = [[a.ctypes.data, *a.shape, *[0] * (3 - a.ndim)] for a in arrays]
        assert len(rows) == len(self.slots)
        return np.array(rows, np.int64).ravel()


def _array_at(axes: int) -> Any:
    from hoof_env.simd.compile import inlined

    if axes == 2:

        @inlined
        def array(addresses, slot):  # type: ignore[no-untyped-def]
            return carray(doubles_at(addresses[slot]), (addresses[slot + 1], addresses[slot + 2]))

        return array

    @inlined
    def cube(addresses, slot):  # type: ignore[no-untyped-def]
        shape = (addresses[slot + 1], addresses[slot + 2], addresses[slot + 3])
        return carray(doubles_at(addresses[slot]), shape)

    return cube


def record_at(kind: np.dtype[Any]) -> Any:
    """For kernels: the array of one record of a type at an address."""
    from hoof_env.simd.compile import inlined

    pointer = _pointer_to(from_dtype(kind))
    return inlined(lambda number: carray(pointer(number), (1,)))


matrix_at, cube_at = _array_at(2), _array_at(3)
"""For kernels: the array of doubles whose slot in an array of `Addresses` is given."""
