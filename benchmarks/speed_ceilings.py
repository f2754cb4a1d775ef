"""The machine's ceilings: loops of one kind of instruction, each independent of the others.

Lanes are arithmetic of LLVM's for any processor. There is no assembly for one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types

from benchmarks.speed_cases import worked
from benchmarks.speed_stages import fence, jit
from hoof_env.simd import root, rows, write
from hoof_env.simd.compile import inlined
from hoof_env.simd.memory import address, doubles, intrinsic
from hoof_env.simd.types import DOUBLE, wide

WIDE = 14
"""Rows that a turn of a loop works on: enough to fill every pipeline, and two of 16 registers stay free."""


class _Kept(ir.instructions.LoadInstr):
    """A load that is done although nobody wants what it loads."""

    def descr(self, buf: list[str]) -> None:
        super().descr(buf)
        buf[-1] = buf[-1].replace("load", "load volatile", 1)


@intrinsic
def _load_row(context: Any, rows: Any, row: Any) -> Any:
    """Load a row and forget it."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        count = rows.count
        first = builder.gep(values[0], [builder.mul(values[1], values[1].type(count))])
        place = builder.bitcast(first, wide(DOUBLE, count).as_pointer())
        load = _Kept(builder.block, place)
        load.align = 8 * count
        builder._insert(load)
        return context.get_dummy_value()

    return types.void(rows, row), emit


@inlined
def _divide(x, k):  # type: ignore[no-untyped-def]
    x[k] = 1.7 / x[k]


@inlined
def _root(x, k):  # type: ignore[no-untyped-def]
    x[k] = root(x[k])


@inlined
def _multiply_add(x, k):  # type: ignore[no-untyped-def]
    x[k] = x[k] * 0.7 + 0.3


@inlined
def _load(x, k):  # type: ignore[no-untyped-def]
    _load_row(x, k)


@inlined
def _store(x, k):  # type: ignore[no-untyped-def]
    x[k] = 1.0
    fence(x)


_BODIES = {
    "divisions": (_divide, 1),
    "square roots": (_root, 1),
    "arithmetic": (_multiply_add, 2),
    "loads": (_load, 1),
    "stores": (_store, 1),
}
"""By kind: what is done with a row, and how many instructions that is."""


def _loop(body: Any, lanes: int) -> Any:
    def loop(out, n):  # type: ignore[no-untyped-def]
        x = rows(doubles(WIDE * lanes), lanes)
        for k in range(WIDE):
            x[k] = 1.01 + 0.01 * k  # 1 is what 0.7 x + 0.3 leaves as it is: no arithmetic for LLVM
        for _ in range(n):
            for k in range(WIDE):
                body(x, k)
        for k in range(WIDE):
            write(x[k], address(out), k * lanes, 1)

    return jit(loop)


def ceilings(lanes: int, turns: int) -> dict[str, tuple[Callable[[], float], int]]:
    """By kind: a loop on vectors of so many lanes, and how many instructions it does."""
    out = np.zeros(WIDE * lanes)
    return {
        kind: (partial(worked, _nothing, partial(loop, out, turns)), turns * WIDE * count)
        for kind, (loop, count) in loops(lanes).items()
    }


def loops(lanes: int) -> dict[str, tuple[Any, int]]:
    """By kind: a compiled loop(out, turns), and how many instructions a row of it takes."""
    return {kind: (_loop(body, lanes), count) for kind, (body, count) in _BODIES.items()}


def _nothing() -> None:
    pass


@jit
def _squares(n):  # type: ignore[no-untyped-def]
    x = 3
    for _ in range(n):
        x = x * x
    return x


def clock(turns: int) -> tuple[Callable[[], float], int]:
    """A loop and how many cycles it takes: a chain of products of whole numbers, three cycles each on x86."""
    return partial(worked, _nothing, partial(_squares, turns)), 3 * turns
