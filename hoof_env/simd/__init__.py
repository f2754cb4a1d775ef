"""Numbers side by side: types for kernels that work on many environments, or many legs, in one instruction.

README.md has the reason, the types, the rules and an example. Lanes exist inside kernels only: they are read
from `rows` and written to them.
"""

from typing import TYPE_CHECKING

import hoof_env.simd.layout
import hoof_env.simd.operators  # noqa: F401  both teach numba: fields and operators
from hoof_env.simd.functions import (
    absolute,
    any_lane,
    cross,
    dot,
    floor,
    gather_eight,
    lane_sum,
    maximum,
    minimum,
    perpendicular,
    quarter_turns,
    sqrt,
    vector,
    where,
)
from hoof_env.simd.memory import (
    block_at,
    columns,
    full_like,
    lane_of,
    load_rows,
    read,
    rows,
    set_lane,
    store_vectors,
    write,
)
from hoof_env.simd.renamed import refuse_old_names

if not TYPE_CHECKING:
    __getattr__ = refuse_old_names(
        __name__,
        {
            "across": "perpendicular",
            "anywhere": "any_lane",
            "choose": "where",
            "fill": "load_rows",
            "larger": "maximum",
            "level": "full_like",
            "nth": "block_at",
            "plane": "vector",
            "root": "sqrt",
            "size": "absolute",
            "smaller": "minimum",
        },
    )

__all__ = [
    "absolute",
    "any_lane",
    "block_at",
    "columns",
    "cross",
    "dot",
    "floor",
    "full_like",
    "gather_eight",
    "lane_of",
    "lane_sum",
    "load_rows",
    "maximum",
    "minimum",
    "perpendicular",
    "quarter_turns",
    "read",
    "rows",
    "set_lane",
    "sqrt",
    "store_vectors",
    "vector",
    "where",
    "write",
]
