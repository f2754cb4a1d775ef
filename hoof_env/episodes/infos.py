"""Measurements in infos: state, forces and sums of the legs, as rows of numbers that have names.

Infos of the single environment hold NumPy's scalars and rows, infos of the vector environment hold arrays of
them, under the same keys at a reset and at a step: libraries that stack infos need that.
"""

from __future__ import annotations

from collections.abc import Callable, ItemsView, Iterable, KeysView, Mapping, Sequence, ValuesView
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env._display import html_table
from hoof_env.dynamics.layout import (
    LEG_REPORT,
    PLAIN,
    STRIDES,
    TRUNK_REPORT,
    Features,
    engine_layout,
    leg_state,
    stride_sums,
)
from hoof_env.gait import parameter_names


def measured_names(features: Features = PLAIN, prefixes: Iterable[str] = ("",)) -> tuple[str, ...]:
    """Return the names of the measurements in an info, in order: the trunk's, then each leg's.

    Args:
        features: features of the engine.
        prefixes: prefix of the names of each leg; see `body.Body.hips`.
    """
    leg = (*leg_state(features), *STRIDES, *stride_sums(features))
    command = tuple(f"command_{name}" for name in parameter_names(features.harmonics))
    each = (f"{prefix}{name}" for prefix in prefixes for name in (*leg, *command, *LEG_REPORT))
    return ("pitch", "angular_momentum", *TRUNK_REPORT, "result", *each)


class InfoLayout:
    """Rows of the measurements in the memory of engines with the same features.

    Attributes:
        names: names of the measurements.
        kind: class of `NamedArray` with these names, for views of arrays.
        last_step: positions of the measurements of the whole last control step; the rest are of its end.
    """

    def __init__(self, features: Features, prefixes: tuple[str, ...]) -> None:
        self._arguments = features, prefixes
        self.names = measured_names(features, prefixes)
        self.kind = _kind(self.names)
        form = engine_layout(features)
        trunk = form.trunk_memory.rows
        leg = form.leg_memory.rows
        rows = [*range(trunk("state").stop - 2, form.trunk_rows)]  # from the pitch on
        for k in range(len(prefixes)):
            first = form.trunk_rows + k * form.leg_rows
            for part in ("state", "strides", "sums", "command", "report"):
                rows += [first + row for row in range(leg(part).start, leg(part).stop)]
        # A slice is read several times faster than rows by number.
        is_slice = rows == [*range(rows[0], rows[-1] + 1)]
        self._rows: Any = slice(rows[0], rows[-1] + 1) if is_slice else np.array(rows)
        sums = [f"{prefix}{name}" for prefix in prefixes for name in stride_sums(features)]
        self.last_step = np.array([k for k, name in enumerate(self.names) if name in sums])

    def __reduce__(self) -> Any:
        """Pickle the arguments: the class of `kind` is made at run time."""
        return InfoLayout, self._arguments

    def read(self, memory: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a copy of the measurements in columns of memory, shape (rows, ...)."""
        return np.array(memory[self._rows])

    def reader(self, column: NDArray[np.float64]) -> Callable[[], Any]:
        """Return a function that reads the measurements of a column as a `NamedArray`. The column must stay
        at its address."""
        if isinstance(self._rows, slice):
            copied: Callable[[], Any] = name_columns(column[self._rows], self.names).copy
            return copied
        rows = self._rows
        kind = self.kind
        return lambda: column[rows].view(kind)


class NamedArray(np.ndarray[Any, np.dtype[np.float64]]):
    """Numbers that have names along the last axis: `row["crank_speed"]` is `row[..., 0]`.

    A float array with a last axis that can also be indexed by name, and a mapping of its names; made by
    `name_columns`. It compares with another `NamedArray` or a mapping as mappings do.
    """

    # No dictionary, which would take as long to make as the array.
    __slots__ = ()
    names: tuple[str, ...] = ()

    def __getitem__(self, key: Any) -> Any:
        return np.asarray(self)[self._place(key)][()]

    def __setitem__(self, key: Any, value: Any) -> None:
        np.asarray(self)[self._place(key)] = value

    def _place(self, key: Any) -> Any:
        """Return an index for an array without names.

        Raises:
            KeyError: there is no such name.
        """
        if not isinstance(key, str):
            return key
        if key not in self.names:
            raise KeyError(key)
        return (..., self.names.index(key))

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """Return the result of an operation as a plain array: it has no names."""
        return array[()] if return_scalar else np.asarray(array)

    def __repr__(self) -> str:
        """The numbers by name; of many environments each name has its row."""
        if self.ndim == 0 or self.shape[-1] != len(self.names):
            return repr(np.asarray(self))
        parts = [f"{name}={np.array2string(np.asarray(self[name]), separator=', ')}" for name in self.names]
        return (
            f"NamedArray({', '.join(parts)})"
            if self.ndim == 1
            else "NamedArray(\n  " + ",\n  ".join(parts) + "\n)"
        )

    def __str__(self) -> str:
        return repr(self)

    def _repr_html_(self) -> str:
        """Return the names and numbers as a table; of many environments the shape of each row."""
        if self.ndim == 1:
            return html_table(("name", "value"), [(name, f"{self[name]:.6g}") for name in self.names])
        return html_table(("name", "shape"), [(name, self[name].shape) for name in self.names])

    def get(self, key: str, default: Any = None) -> Any:
        """Return the numbers of a name, or `default` if there is no such name."""
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
        if isinstance(other, NamedArray | Mapping):
            return self.keys() == other.keys() and all(
                np.array_equal(self[name], other[name]) for name in self.names
            )
        return super().__eq__(other)

    def __ne__(self, other: Any) -> Any:
        return not self == other if isinstance(other, NamedArray | Mapping) else super().__ne__(other)

    __hash__ = None

    # The class is made at run time and cannot be pickled by name.
    def __reduce__(self) -> Any:
        return name_columns, (np.array(self), self.names)


@cache
def _kind(names: tuple[str, ...]) -> type[NamedArray]:
    """Return the class of `NamedArray` for a set of names: views and copies of a row inherit them from their
    class, at no cost."""
    return type("Named", (NamedArray,), {"names": names, "__slots__": (), "__doc__": NamedArray.__doc__})


def name_columns(values: ArrayLike, names: Sequence[str]) -> NamedArray:
    """Return a view of numbers, shape (..., len(names)), that has names."""
    return np.asarray(values, np.float64).view(_kind(tuple(names)))


def row_of(infos: Mapping[str, Any], env: int) -> dict[str, Any]:
    """Extract one environment's info from the vector info: the entries that apply to it."""
    # Gymnasium's masks: "_key" is True for the environments that have "key".
    row = {}
    for key, values in infos.items():
        if not key.startswith("_") and infos.get(f"_{key}", np.ones(env + 1, bool))[env]:
            is_named = isinstance(values, NamedArray)
            row[key] = name_columns(values[env].copy(), values.names) if is_named else values[env]
    return row
