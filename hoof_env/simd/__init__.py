"""Numbers side by side: values of kernels that work on many environments, or many legs, in one instruction."""

from hoof_env.simd.flow import Cell, cond, loop, one_of, when
from hoof_env.simd.memory import (
    block_at,
    columns,
    full_like,
    gather_eight,
    load_rows,
    read,
    rows,
    set_lane,
    store_vectors,
    write,
)
from hoof_env.simd.values import (
    absolute,
    any_lane,
    cross,
    dot,
    floor,
    lane_of,
    lane_sum,
    maximum,
    minimum,
    perpendicular,
    quarter_turns,
    sqrt,
    steady,
    vector,
    where,
    whole,
)
