"""Arrays of a control step, reached from one array of addresses: a call from Python with an argument for each
array costs more than a step."""

from __future__ import annotations

from hoof_env.simd import columns
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.memory import COLUMNS, Addresses, doubles_at

ADDRESSES = Addresses(
    "data",
    "model",
    "tables",
    "ground",
    "constants",
    "reactions",
    "episode",
    "task",
    "actions",
    "observations",
    "rewards",
    "acted",
    "past_actions",
    "frames",
    "mapped",
)
"""Arrays of a step; the first ones, to `reactions`, are `TrunkEngine.arrays` in their order. `acted` are the
actions that act now, the same array as `actions` where nothing delays them; `mapped` are those of the body,
the same array as `acted` without a map of one's own."""

AT = ADDRESSES.slots
BEGIN = ADDRESSES.begin
END = ADDRESSES.end


@inline_llvm
def memories(addresses, lanes, layouts, n):  # type: ignore[no-untyped-def]
    """Return trunk, first leg and episode of environments n, n + 1, ..., as `lanes` columns, see
    `simd.columns`."""
    # The distance from one row of memory to the next: engine and episode have the same number of columns.
    row = addresses[AT.data + COLUMNS]
    data = doubles_at(addresses[AT.data])
    episode = doubles_at(addresses[AT.episode])
    return (
        columns(data, lanes, layouts.trunk, n, row, 1),
        columns(data, lanes, layouts.leg, layouts.trunk_rows * row + n, row, 1),
        columns(episode, lanes, layouts.episode, n, row, 1),
    )
