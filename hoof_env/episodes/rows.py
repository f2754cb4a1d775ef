"""Rows of a batch: all arrays that change from step to step, with one row for each environment.

A field of `Rows` declares on which axis the environments are, whether kernels write it, and whether a state
contains it. Copies, states, and the restoration of rows that a kernel should not have changed follow from
these declarations alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from hoof_env.simd.layout import Layout, views

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


class Declared(NamedTuple):
    """Declaration of an array.

    Attributes:
        axis: axis of the environments, 0 or -1.
        is_written: True if kernels write it, in all rows.
        is_saved: True if a state contains it, wherever it is not empty.
    """

    axis: int
    is_written: bool = False
    is_saved: bool = False


@dataclass
class Rows:
    """Arrays of `num_envs` episodes. Arrays that kernels read have as many rows as the engine has columns, of
    which the last may be idle.

    Attributes:
        layout: layout of `episode`.
        num_envs: number of environments.
        episode: memory of the episodes, rows of `episode.Episode`, shape (numbers, columns).
        actions, observations, rewards: input and output of a step, shapes (columns, actions), (columns,
            numbers) and (columns,).
        unweighted: terms of the last reward, each with a weight of 1, shape (terms, columns).
        acted: actions that act now, shape (columns, actions); None where nothing delays `actions`.
        mapped: actions of the body, shape (columns, its actions); None without a user's map.
        past_actions: last actions, the newest first, shape (columns, number, actions); empty where they are
            not needed, like `frames`.
        frames: observations of one instant each, the newest first, shape (columns, number, entries).
        start_values: the body's `start_names`, the gait, and the values drawn by `randomize`, shape (numbers,
            num_envs); NaN where a state does not contain them.
        steps_before: control steps in earlier episodes, from which schedules follow, shape (num_envs,).
        has_overrides: True where the engine's parameters may differ from the settings, shape (num_envs,).
        pushes: tuple of the pushes that were given for the present episode, in the order of their times, as
            objects, shape (num_envs,).
        costs, cost_sums: costs of the last step and of the episode so far, shape (costs, num_envs).
        stance_rises: steepest rise of the normal force in the present stance of each leg [N/s], shape (legs,
            num_envs); no rows without a cost of them.
        debts: weight that the legs must bear and have not borne, over the weight [s], shape (1, num_envs); no
            row without a cost of it.
        named: views of `episode` by name.
    """

    layout: type[Layout]
    num_envs: int
    episode: Annotated[Floats, Declared(-1, is_written=True, is_saved=True)]
    actions: Annotated[NDArray[np.float32], Declared(0)]
    observations: Annotated[NDArray[np.float32], Declared(0, is_written=True)]
    rewards: Annotated[Floats, Declared(0, is_written=True)]
    unweighted: Annotated[Floats, Declared(-1, is_written=True)]
    acted: Annotated[NDArray[np.float32] | None, Declared(0, is_written=True)]
    mapped: Annotated[NDArray[np.float32] | None, Declared(0, is_written=True)]
    past_actions: Annotated[NDArray[np.float32], Declared(0, is_written=True, is_saved=True)]
    frames: Annotated[NDArray[np.float32], Declared(0, is_written=True, is_saved=True)]
    start_values: Annotated[Floats, Declared(-1, is_saved=True)]
    steps_before: Annotated[Floats, Declared(0, is_saved=True)]
    has_overrides: Annotated[NDArray[np.bool_], Declared(0)]
    pushes: Annotated[NDArray[Any], Declared(0)]
    costs: Annotated[Floats, Declared(-1, is_saved=True)]
    cost_sums: Annotated[Floats, Declared(-1, is_saved=True)]
    stance_rises: Annotated[Floats, Declared(-1, is_saved=True)]
    debts: Annotated[Floats, Declared(-1, is_saved=True)]
    named: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.open(self.layout)

    def open(self, layout: type[Layout]) -> None:
        """Find the views of the episodes' memory, in rows that come from a pickle."""
        self.layout = layout
        self.named = views(layout, self.episode)

    # Operations by declaration

    def written(self) -> Iterator[tuple[NDArray[Any], int]]:
        """Yield the arrays that kernels write, each with the axis of the environments."""
        for name, declared in ARRAYS.items():
            array = getattr(self, name)
            if declared.is_written and array is not None and array.size:
                yield array, declared.axis

    def saved(self) -> list[str]:
        """Return the names of the arrays that a state contains."""
        return [name for name, declared in ARRAYS.items() if declared.is_saved and getattr(self, name).size]

    def get(self, name: str) -> NDArray[Any]:
        """Return a copy of an array, without idle columns."""
        return np.array(self._used(name))

    def put(self, name: str, values: Any) -> None:
        """Write all rows of an array, except idle columns."""
        self._used(name)[...] = values

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Return copies of all arrays by name, for `restore`."""
        return {
            name: array.copy() for name, array in vars(self).items() if name in ARRAYS and array is not None
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write what `snapshot` returned into the arrays, at their addresses."""
        for name, values in arrays.items():
            getattr(self, name)[...] = values

    def _used(self, name: str) -> NDArray[Any]:
        array: NDArray[Any] = getattr(self, name)
        return array[: self.num_envs] if ARRAYS[name].axis == 0 else array[..., : self.num_envs]

    def copy(self) -> Rows:
        """Return a copy with arrays of its own."""
        given = {item.name: getattr(self, item.name) for item in fields(self) if item.init}
        return Rows(**{**given, **self.snapshot()})

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for a pickle: without layout and views, whose classes are of one process. The
        rows then need `open`."""
        return {name: value for name, value in vars(self).items() if name not in ("layout", "named")}


ARRAYS: dict[str, Declared] = {
    name: declared
    for name, hint in get_type_hints(Rows, include_extras=True).items()
    for declared in getattr(hint, "__metadata__", ())
}
"""Declarations of the arrays of `Rows` by name."""


def repeated(name: str, values: Any, n: int) -> NDArray[Any]:
    """Return the values of one row of an array of `Rows`, as a state holds them, n times."""
    return np.repeat(np.asarray(values), n, ARRAYS[name].axis)
