"""Numbers side by side: values of kernels that work on many environments, or many legs, in one
instruction."""

from hoof_env.simd.control import Cell, cond, loop, one_of, when
from hoof_env.simd.memory import (
    Matrix,
    Pointer,
    apply_to_rows,
    block_at,
    columns,
    full_like,
    gather_eight,
    load_rows,
    new_rows,
    read,
    store_vectors,
    write,
)
from hoof_env.simd.values import (
    Index,
    Lanes,
    Mask,
    Number,
    Plane,
    Truth,
    Whole,
    absolute,
    any_lane,
    cross,
    dot,
    floor,
    full,
    lane_of,
    lane_sum,
    maximum,
    minimum,
    perpendicular,
    quarter_turns,
    rounded,
    sqrt,
    steady,
    vector,
    where,
    whole,
)

__all__ = [
    "Cell", "Index", "Lanes", "Mask", "Matrix", "Number", "Plane", "Pointer", "Truth", "Whole", "absolute",
    "any_lane", "apply_to_rows", "block_at", "columns", "cond", "cross", "dot", "floor", "full", "full_like",
    "gather_eight", "lane_of", "lane_sum", "load_rows", "loop", "maximum", "minimum", "new_rows", "one_of",
    "perpendicular", "quarter_turns", "read", "rounded", "sqrt", "steady", "store_vectors", "vector", "when", "where",
    "whole", "write",
]  # fmt: skip
