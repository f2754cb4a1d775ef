"""Constant settings of an engine: the record that its kernels take, and its form inside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hoof_env.dynamics.layout import EngineLayout
from hoof_env.simd import Lanes, Matrix, Pointer
from hoof_env.simd.memory import Record

MODEL = np.dtype(
    [
        ("legs", "i8"),  # number of legs
        ("cells", "f8"),  # number of cells of a leg's table
        ("kind", "i8"),  # of the trunk, its `parts.FREEDOMS`
        ("eighths", "i8"),  # contact exponent times 8
        ("friction_law", "i8"),  # position in `laws.FRICTION_LAWS`
        ("is_interpolated", "?"),  # the approach speed; see `Ground`
        ("is_terrain", "?"),  # false if level and the same everywhere
        ("uses_new_rates", "?"),  # as are averages, stages, fractions and weights: of the `Scheme`
        ("counts_strides", "?"),  # true if stances are counted
        ("has_motors", "?"),  # true if any crank has a motor
        ("averages", "?"),
        ("stages", "i8"),
        ("fractions", "f8", (4,)),
        ("weights", "f8", (4,)),
        ("settings", "f8", (12,)),  # of the filters
        ("ground_origin", "f8"),  # of the terrain's grid
        ("ground_per_metre", "f8"),
    ],
    align=True,
)
"""Record type of all settings that stay constant while the engine runs, except large arrays."""


STATIC = (
    "legs", "kind", "eighths", "friction_law", "is_interpolated", "is_terrain", "uses_new_rates",
    "counts_strides", "has_motors", "averages", "stages", "fractions", "weights",
)  # fmt: skip
"""Fields of `MODEL` that are known when a kernel is traced."""


def static_of(model: Any) -> tuple[tuple[str, Any], ...]:
    """Return the fields `STATIC` of a model with their values."""
    return tuple((name, _plain(model[0][name])) for name in STATIC)


def _plain(value: Any) -> Any:
    return tuple(value.tolist()) if value.shape else value.item()


class Model(NamedTuple):
    """Constant settings inside the kernels: the fields of `MODEL`, and settings that do not fit into a
    record."""

    kind: int
    eighths: int
    friction_law: int
    is_interpolated: bool
    is_terrain: bool
    uses_new_rates: bool
    counts_strides: bool
    has_motors: bool
    lanes_are_legs: bool  # the lanes are the legs of one trunk
    form: EngineLayout
    cells: Lanes | float  # of a leg's table
    tables: Pointer  # to the tables of all legs, one after the other
    settings: Sequence[Lanes | float]  # of the filters
    averages: bool
    stages: int
    fractions: Sequence[float]
    weights: Sequence[float]
    ground_cells: Matrix  # of the terrain's grid
    ground_origin: Lanes | float
    ground_per_metre: Lanes | float
    contact_law: Callable[..., Any] | None  # user's law of the normal force; see `hoof.contact_force`


def unpack_model(
    record: Record,
    tables: Matrix,
    ground: Matrix,
    lanes_are_legs: bool,
    contact_law: Callable[..., Any] | None,
    form: EngineLayout,
) -> Model:
    """Return the `Model` of a record and its arrays."""
    # higher harmonics have the filters of the first
    places = [*range(12), *(k % 3 + 9 for k in range(12, 3 * form.gait))]
    return Model(
        kind=record.kind,
        eighths=record.eighths,
        friction_law=record.friction_law,
        is_interpolated=record.is_interpolated,
        is_terrain=record.is_terrain,
        uses_new_rates=record.uses_new_rates,
        counts_strides=record.counts_strides,
        has_motors=record.has_motors,
        lanes_are_legs=lanes_are_legs,
        form=form,
        cells=record.cells,
        tables=tables.first,
        settings=[record.settings[k] for k in places],
        averages=record.averages,
        stages=record.stages,
        fractions=record.fractions,
        weights=record.weights,
        ground_cells=ground,
        ground_origin=record.ground_origin if record.is_terrain else 0.0,
        ground_per_metre=record.ground_per_metre if record.is_terrain else 0.0,
        contact_law=contact_law,
    )
