"""Memory for kernels without reference counts: the stack, and the addresses of a caller's arrays.

numba counts references to every array that a kernel slices, with atomic instructions; in a step of a
hundred nanoseconds that is most of the time. Arrays made by `numba.carray` from these pointers are not
counted. Memory on the stack is also known to be nobody else's, so that loops over it become vector code,
and where every index is a constant it becomes registers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
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


def pointer_to(kind: Any) -> Any:
    """A function for kernels that makes a pointer to numba's type `kind` of an address, a whole number.

    A call from Python takes a tenth of a microsecond for each array; one array of addresses replaces many.
    Whoever makes the addresses keeps the arrays alive, and makes them anew for a copy.
    """

    def pointer(context: Any, number: Any) -> Any:
        def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

        return types.CPointer(kind)(types.int64), emit

    return intrinsic(pointer)
