"""What infos say besides the reward: where a leg is, what acts on it, and rows of numbers that have names.

The single environment's infos hold NumPy's scalars and rows, those of many hold arrays of them, under the
same keys at a reset and at a step: libraries that stack infos ask for that.
"""

from __future__ import annotations

from collections.abc import Callable, ItemsView, KeysView, Mapping, Sequence, ValuesView
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics.form import form_of
from hoof_env.dynamics.layout import (
    LEG_REPORT,
    PLAIN,
    STRIDES,
    TRUNK_REPORT,
    Features,
    leg_state,
    stride_sums,
)
from hoof_env.envs.reference import LEGS
from hoof_env.gait import parameter_names


def measured_names(features: Features = PLAIN, legs: int = 1) -> tuple[str, ...]:
    """What an info measures: of one leg neighbours in the engine's memory, read with one copy; of a horse
    the trunk's pitch, too, and each leg's command and report, under its name in `reference.LEGS`."""
    leg = (*leg_state(features), *STRIDES, *stride_sums(features))
    if legs == 1:
        return (*TRUNK_REPORT, "result", *leg)
    command = tuple(f"command_{name}" for name in parameter_names(features.harmonics))
    each = (f"{one}_{name}" for one in LEGS for name in (*leg, *command, *LEG_REPORT))
    return ("pitch", *TRUNK_REPORT, "result", *each)


MEASURED = measured_names()
"""Of a leg with a rigid hoof."""


class Measurements:
    """Where what is measured lies in the memory of engines of a kind.

    Attributes:
        names: of it.
        kind: of `Named`, to view arrays as.
        last_step: which of it is of the last control step, not of its end.
    """

    def __init__(self, features: Features, legs: int) -> None:
        self.names = measured_names(features, legs)
        self.kind = _kind(self.names)
        form = form_of(features)
        trunk, leg, first = form.trunk_memory.rows, form.leg_memory.rows, form.trunk_rows
        self._rows: Any = slice(trunk("report").start, first + leg("sums").stop)
        if legs > 1:
            pitch = trunk("state").stop - 2
            rows = [pitch, *range(trunk("report").start, first)]
            for k in range(legs):
                parts = (range(0, leg("sums").stop), *(range(leg(name).start, leg(name).stop)
                         for name in ("command", "report")))  # fmt: skip
                rows += [first + k * form.leg_rows + row for part in parts for row in part]
            self._rows = np.array(rows)
        sums = [
            f"{leg}{name}" for leg in ("", *(f"{one}_" for one in LEGS)) for name in stride_sums(features)
        ]
        self.last_step = np.array([k for k, name in enumerate(self.names) if name in sums])

    def read(self, memory: NDArray[np.float64]) -> NDArray[np.float64]:
        """A copy of what is measured, from columns of memory, shape (rows, ...)."""
        found: NDArray[np.float64] = memory[self._rows]
        return found.copy() if isinstance(self._rows, slice) else found

    def reader(self, column: NDArray[np.float64]) -> Callable[[], Any]:
        """A function that reads a column that stays where it is, with names."""
        if isinstance(self._rows, slice):
            copied: Callable[[], Any] = named(column[self._rows], self.names).copy
            return copied
        rows, kind = self._rows, self.kind
        return lambda: column[rows].view(kind)


class Named(np.ndarray[Any, np.dtype[np.float64]]):
    """Numbers that have names along the last axis: `row["crank_speed"]` is `row[..., 0]`.

    An array to libraries, and to people also a mapping; made by `named`. Equality is that of mappings where
    the other one has names, too.
    """

    __slots__ = ()  # no dictionary, which would take as long to make as the array
    names: tuple[str, ...] = ()

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self.names:
                raise KeyError(key)
            key = (..., self.names.index(key))
        return np.asarray(self)[key][()]

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """What is computed from named numbers has no names."""
        return array[()] if return_scalar else np.asarray(array)

    def __repr__(self) -> str:
        """The numbers by name; of many environments each name has its row."""
        if self.ndim == 0 or self.shape[-1] != len(self.names):
            return repr(np.asarray(self))
        parts = [f"{name}={np.array2string(np.asarray(self[name]), separator=', ')}" for name in self.names]
        return f"Named({', '.join(parts)})" if self.ndim == 1 else "Named(\n  " + ",\n  ".join(parts) + "\n)"

    def __str__(self) -> str:
        return repr(self)

    def get(self, key: str, default: Any = None) -> Any:
        return self[key] if key in self.names else default

    def _mapping(self) -> dict[str, Any]:
        return {name: self[name] for name in self.names}

    def keys(self) -> KeysView[str]:
        return self._mapping().keys()

    def values(self) -> ValuesView[Any]:
        return self._mapping().values()

    def items(self) -> ItemsView[str, Any]:
        return self._mapping().items()

    def __contains__(self, key: Any) -> bool:
        return key in self.names if isinstance(key, str) else super().__contains__(key)

    def __bool__(self) -> bool:
        return bool(self.names)

    def __eq__(self, other: Any) -> Any:
        if isinstance(other, Named | Mapping):
            return self.keys() == other.keys() and all(
                np.array_equal(self[name], other[name]) for name in self.names
            )
        return super().__eq__(other)

    def __ne__(self, other: Any) -> Any:
        return not self == other if isinstance(other, Named | Mapping) else super().__ne__(other)

    __hash__ = None

    def __reduce__(self) -> Any:
        return named, (np.array(self), self.names)


@cache
def _kind(names: tuple[str, ...]) -> type[Named]:
    """A class for each set of names: views and copies of a row have them without another thought."""
    return type("Named", (Named,), {"names": names, "__slots__": (), "__doc__": Named.__doc__})


def named(values: ArrayLike, names: Sequence[str]) -> Named:
    """A view of some numbers, shape (..., len(names)), that has names."""
    return np.asarray(values, np.float64).view(_kind(tuple(names)))


def row_of(infos: Mapping[str, Any], env: int) -> dict[str, Any]:
    """The info of one environment from those of many, where they are about it."""
    row = {}
    for key, values in infos.items():
        if not key.startswith("_") and infos.get(f"_{key}", np.ones(env + 1, bool))[env]:
            is_named = isinstance(values, Named)
            row[key] = named(values[env].copy(), values.names) if is_named else values[env]
    return row
