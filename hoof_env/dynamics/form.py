"""Layouts of an engine's memory and lengths of its loops: constants when its kernels are compiled."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from hoof_env.dynamics.layout import (
    PLAIN,
    Account,
    Features,
    LegMemory,
    LegRows,
    LegState,
    Strides,
    StrideSums,
    TrunkMemory,
    TrunkRows,
    TrunkState,
)
from hoof_env.dynamics.leg_constants import constants_layout
from hoof_env.dynamics.reactions import reactions_layout


class _EngineLayout(NamedTuple):
    trunk: Any
    leg: Any
    account: Any
    trunk_memory: Any
    leg_memory: Any
    trunk_size: int
    leg_size: int
    account_size: int
    trunk_rows: int
    leg_rows: int
    trunk_state: int
    leg_state: int
    strides: int
    sums: int
    gait: int
    harmonics: int
    springs: int
    has_limits: bool
    feet: int
    constants: Any
    reactions: Any
    constants_size: int
    reactions_size: int


class EngineLayout(_EngineLayout):
    """Layouts of engines with the same `Features`, and the numbers that the compiler must know of them.

    Attributes:
        trunk, leg, account: layouts of rows on the stack.
        trunk_memory, leg_memory: layouts of rows in the engine's array, the trunk's first.
        trunk_size, leg_size, account_size, trunk_rows, leg_rows: number of rows of these five.
        trunk_state, leg_state, strides, sums: number of rows of these parts.
        gait: number of gait parameters of a leg.
        harmonics, has_limits: as in `Features`.
        springs: number of rows of a hoof point's spring, 0 or 2.
        feet: number of points of a hoof.
        constants, reactions: layouts of a leg's constants and reactions, with their numbers of rows.
    """


@cache
def engine_layout(features: Features = PLAIN) -> EngineLayout:
    """Return the `EngineLayout` of engines with these features."""
    rows = [features.of(layout) for layout in (TrunkRows, LegRows, Account, TrunkMemory, LegMemory)]
    inner = [features.of(layout).size for layout in (TrunkState, LegState, Strides, StrideSums)]
    # in the order of the fields of `_EngineLayout`
    sizes = [*(layout.size for layout in rows), *inner, features.gait_size]
    flags = [features.harmonics, 2 * features.springs, features.has_limits, features.feet]
    ofs = [constants_layout(features.structure), reactions_layout(features.structure)]
    return EngineLayout._make([*rows, *sizes, *flags, *ofs, *(layout.size for layout in ofs)])
