"""Numbers side by side: types for kernels that work on many environments, or many legs, in one instruction.

README.md says why, and has the types, the rules and an example. Lanes live inside kernels only: they come
from `rows` and go back into them.
"""

import hoof_env.simd.layout
import hoof_env.simd.operators  # noqa: F401  both teach numba: fields and operators
from hoof_env.simd.functions import (
    across,
    anywhere,
    choose,
    cross,
    dot,
    floor,
    gather_eight,
    lane_sum,
    larger,
    plane,
    quarter_turns,
    root,
    size,
    smaller,
)
from hoof_env.simd.memory import (
    columns,
    fill,
    lane_of,
    level,
    nth,
    read,
    rows,
    set_lane,
    store_vectors,
    write,
)

__all__ = [
    "across", "anywhere", "choose", "columns", "cross", "dot", "fill", "floor", "gather_eight", "lane_of",
    "lane_sum", "larger", "level", "nth", "plane", "quarter_turns", "read", "root", "rows", "set_lane",
    "size", "smaller", "store_vectors", "write",
]  # fmt: skip
