"""Layouts of an engine's memory and numbers of its rows: constants of its kernels."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from hoof_env.dynamics.layout import (
    PLAIN,
    Account,
    Features,
    LegMemory,
    LegRows,
    LegState,
    Reactions,
    Strides,
    StrideSums,
    TrunkMemory,
    TrunkRows,
    TrunkState,
    reactions_layout,
)
from hoof_env.dynamics.leg_constants import LegConstants, constants_layout


class EngineLayout(NamedTuple):
    """Layouts of engines with the same `Features`, and the numbers that their kernels are made for.

    Attributes:
        trunk, leg, account: layouts of rows on the stack.
        trunk_memory, leg_memory: layouts of rows in the engine's array, the trunk's first.
        constants, reactions: layouts of a leg's constants and reactions.
        trunk_rows, leg_rows: numbers of rows in the engine's array.
        trunk_state, leg_state, strides, sums: numbers of rows of these parts.
        gait: number of gait parameters of a leg.
        harmonics, has_limits, feet: as in `Features`.
        springs: number of rows of a hoof point's spring, 0 or 2.
    """

    trunk: type[TrunkRows]
    leg: type[LegRows]
    account: type[Account]
    trunk_memory: type[TrunkMemory]
    leg_memory: type[LegMemory]
    constants: type[LegConstants]
    reactions: type[Reactions]
    trunk_rows: int
    leg_rows: int
    trunk_state: int
    leg_state: int
    strides: int
    sums: int
    gait: int
    harmonics: int
    has_limits: bool
    feet: int
    springs: int


@cache
def engine_layout(features: Features = PLAIN) -> EngineLayout:
    """Return the `EngineLayout` of engines with these features."""
    trunk_memory, leg_memory = features.of(TrunkMemory), features.of(LegMemory)
    return EngineLayout(
        trunk=features.of(TrunkRows),
        leg=features.of(LegRows),
        account=features.of(Account),
        trunk_memory=trunk_memory,
        leg_memory=leg_memory,
        constants=constants_layout(features.structure),
        reactions=reactions_layout(features.structure),
        trunk_rows=trunk_memory.size,
        leg_rows=leg_memory.size,
        trunk_state=TrunkState.size,
        leg_state=features.of(LegState).size,
        strides=Strides.size,
        sums=features.of(StrideSums).size,
        gait=features.gait_size,
        harmonics=features.harmonics,
        has_limits=features.has_limits,
        feet=features.feet,
        springs=2 * features.springs,
    )
