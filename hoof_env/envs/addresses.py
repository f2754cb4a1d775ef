"""Arrays of a control step, reached from one array of addresses: a call from Python with as many arguments
costs more than a step."""

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
)
"""The arrays of a step, those of the engine first."""

AT = ADDRESSES.slots
BEGIN = ADDRESSES.begin
END = ADDRESSES.end


@inline_llvm
def memories(addresses, lanes, layouts, n):  # type: ignore[no-untyped-def]
    """Trunk, leg and episode of environments n, n + 1, ..., as `lanes` columns, see `simd.columns`."""
    row = addresses[AT.data + COLUMNS]
    data = doubles_at(addresses[AT.data])
    episode = doubles_at(addresses[AT.episode])
    return (
        columns(data, lanes, layouts.trunk, n, row, 1),
        columns(data, lanes, layouts.leg, layouts.trunk_rows * row + n, row, 1),
        columns(episode, lanes, layouts.episode, n, row, 1),
    )
