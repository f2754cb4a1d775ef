"""What is in the x86 code of a compiled kernel."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

KINDS = ("divisions", "square_roots", "arithmetic", "accesses")


def assembly(compiled: Any) -> str:
    """The code of a numba function that was compiled in this process."""
    return "".join(compiled.inspect_asm().values())


_WORK = re.compile(r"^\s+v(add|sub|mul|div|sqrt|min|max)(sd|pd)\s+(.*)$", re.M)
_LANES = {"x": 2, "y": 4, "z": 8}


def count_operations(assembly: str) -> Counter[str]:
    """Doubles that AVX instructions work on, by kind, and those that they read or write in memory."""
    counts: Counter[str] = Counter(dict.fromkeys(KINDS, 0))
    for line in assembly.splitlines():
        name, _, operands = line.strip().partition("\t")
        if not name.startswith("v"):
            continue
        widths = [_LANES[w] for w in re.findall(r"%([xyz])mm", operands)]
        lanes = 1 if name.endswith("sd") or not widths else max(widths)
        counts["accesses"] += lanes if "(" in operands and "(%rip)" not in operands else 0
        if work := _WORK.match("\t" + line.strip()):
            counts[{"div": "divisions", "sqrt": "square_roots"}.get(work[1], "arithmetic")] += lanes
    return counts


def vector_widths(assembly: str) -> dict[str, int]:
    """Floating-point instructions in x86 code: scalar, and packed by width in bits."""
    found = {"scalar": 0, "128": 0, "256": 0, "512": 0}
    for _, size, operands in _WORK.findall(assembly):
        wide = max(_LANES[w] for w in re.findall(r"%([xyz])mm", operands))
        found["scalar" if size == "sd" else str(64 * wide)] += 1
    return found


def packed_and_not(assembly: str) -> dict[str, int]:
    """Division and square root instructions in x86 code, packed and scalar."""
    found = {f"{kind} {size}": 0 for kind in ("div", "sqrt") for size in ("packed", "scalar")}
    for kind, size, _ in _WORK.findall(assembly):
        if kind in ("div", "sqrt"):
            found[f"{kind} {'packed' if size == 'pd' else 'scalar'}"] += 1
    return found
