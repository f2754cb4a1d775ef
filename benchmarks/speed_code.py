"""What numba compiles for, and what is in the x86 code of a compiled kernel."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from typing import Any

import numba
import numpy as np
from numba.core.registry import cpu_target

from hoof_env.simd import read, rows, write
from hoof_env.simd.memory import address, doubles

KINDS = ("divisions", "square roots", "arithmetic", "loads", "stores")
WIDTHS = (64, 128, 256, 512)
"""Bits that an instruction works on; 64 is one double, and whatever is not a vector."""

_LINE = re.compile(r"^\t([a-z]\w*)(?:[ \t]+([^#\n]*))?", re.M)
_WORK = re.compile(r"v?(add|sub|mul|div|sqrt|min|max)[sp]d$")
_HALF_MOVE = re.compile(r"v?mov[hl]p[sd]$")
_WIDTH = {"x": 128, "y": 256, "z": 512}
_NO_ACCESS = ("lea", "nop", "call", "jmp", "prefetch")


def target() -> tuple[str, str, list[str]]:
    """What numba compiles for, which need not be the processor that this runs on (`NUMBA_CPU_NAME`): LLVM's
    names of architecture and processor, and of the vector features if numba lists any."""
    triple, name, features = cpu_target.target_context.codegen().magic_tuple()
    listed = re.findall(r"\+((?:avx|sse4|fma|neon|sve)[^,]*)", features)
    return triple.split("-")[0], name, listed


def is_counted() -> bool:
    """Whether `instructions` reads the code of this machine."""
    return target()[0] == "x86_64"


@cache
def vector_bits() -> int:
    """Bits of the widest vectors in the code that numba makes here, read off the sum of eight lanes."""

    @numba.njit
    def add(x):  # type: ignore[no-untyped-def]
        row = rows(doubles(8), 8)
        one = read(row, address(x), 0, 1)
        write(one + one, address(x), 0, 1)

    add(np.zeros(8))
    code = assembly(add)
    if is_counted():
        return max(_WIDTH[r] for r in re.findall(r"%([xyz])mm", code))
    return 128 if re.search(r"\bv\d+\.2d", code) else 64


def assembly(compiled: Any) -> str:
    """The code of a numba function that was compiled in this process."""
    return "".join(compiled.inspect_asm().values())


def instructions(assembly: str) -> Counter[tuple[str, int]]:
    """How many instructions there are of each of `KINDS` and `WIDTHS`; those of ("all", 0) are all. One that
    also reads its operand from memory is a load, too; constants are not counted as such."""
    found: Counter[tuple[str, int]] = Counter()
    for name, operands in _LINE.findall(assembly):
        found["all", 0] += 1
        registers = [_WIDTH[r] for r in re.findall(r"%([xyz])mm", operands)]
        is_vector = registers and not name.endswith("sd") and not _HALF_MOVE.match(name)
        width = max(registers) if is_vector else 64
        if work := _WORK.match(name):
            kind = {"div": "divisions", "sqrt": "square roots"}.get(work[1], "arithmetic")
            found[kind, width] += 1
        if "(" in operands and "(%rip)" not in operands and not name.startswith(_NO_ACCESS):
            last = re.sub(r"\{.*?\}", "", operands).rstrip()
            found["stores" if last.endswith(")") else "loads", width] += 1
    return found


def by_kind(found: Counter[tuple[str, int]]) -> dict[str, int]:
    """The same of all widths together, and "instructions" of any kind."""
    totals = {kind: sum(found[kind, width] for width in WIDTHS) for kind in KINDS}
    return {"instructions": found["all", 0]} | totals
