"""What is in the x86 code of a compiled kernel."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

KINDS = ("divisions", "square roots", "arithmetic", "loads", "stores")
WIDTHS = (64, 128, 256, 512)
"""Bits that an instruction works on; 64 is one double, and whatever is not a vector."""

_LINE = re.compile(r"^\t([a-z]\w*)(?:[ \t]+([^#\n]*))?", re.M)
_WORK = re.compile(r"v(add|sub|mul|div|sqrt|min|max)[sp]d$")
_WIDTH = {"x": 128, "y": 256, "z": 512}
_NO_ACCESS = ("lea", "nop", "call", "jmp", "prefetch")


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
        width = max(registers) if registers and not name.endswith("sd") else 64
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
